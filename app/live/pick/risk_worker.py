"""Maps of choice and risk for a live cell, computed in a thread of their own."""

import logging
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from app.errors import ServiceError
from app.sim.core.arrays import Vec
from app.sim.human.person import Person
from app.sim.pick.person_grid import PersonGrid
from app.sim.pick.task_policy import Candidate, ChoiceTerms, MovedPerson, RiskMap, TaskPolicy

logger = logging.getLogger(__name__)

INTERVAL_S = 0.5
"""Shortest time between the starts of two maps [s]."""
GRID = PersonGrid(x=np.linspace(-0.95, 0.95, 28), y=np.linspace(0.55, 1.95, 21))
"""Positions of the person's pelvis, in front of the robot [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PersonRisk:
    """Risk map over the positions of one person."""

    person: int
    """Id of the person."""
    map: RiskMap
    """Choice and probabilities at each position of ``GRID``."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RiskQuery:
    """State for which a map is computed; immutable."""

    policy: TaskPolicy
    """Policy."""
    q: Vec
    """Joint positions of the robot [rad], shape (6,)."""
    qd: Vec
    """Joint speeds of the robot [rad/s], shape (6,)."""
    people: Sequence[Person]
    """The people; the first one is moved."""
    person: int
    """Id of the first one."""
    offered: tuple[Candidate, ...]
    """The candidates."""
    terms: ChoiceTerms
    """Previous choice, progress, time left and objective of the choices."""

    def answer(self) -> PersonRisk:
        """Return the map over ``GRID``."""
        person = self.people[0]
        moved = MovedPerson(index=0, q=GRID.postures(person)[0])
        found = self.policy.risk_map(
            self.q, self.qd, self.people, self.offered, moved, terms=self.terms
        )
        return PersonRisk(person=self.person, map=found)


class RiskWorker:
    """Computes one map at a time, at most two per second."""

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="risk-map")
        self._running: Future[PersonRisk] | None = None
        self._started = -INTERVAL_S
        self.newest: PersonRisk | None = None
        """The last finished map."""

    def offer(self, query: Callable[[], RiskQuery | None]) -> None:
        """Store a finished map, and start the next one if it is due; does not wait.

        Args:
            query: Returns the state; called only if a map is due. None: there is no map.
        """
        if self._running is not None and self._running.done():
            done, self._running, self.newest = self._running, None, None
            try:
                self.newest = done.result()
            except ServiceError as error:
                logger.warning("no risk map: %s", error.message)
        if self._running is not None or time.monotonic() < self._started + INTERVAL_S:
            return
        self._started = time.monotonic()
        if (asked := query()) is None:
            self.newest = None
        else:
            self._running = self._pool.submit(asked.answer)

    def forget(self) -> None:
        """Drop the last map, and the one that is being computed."""
        self._running = self.newest = None

    def close(self) -> None:
        """End the thread after the present map."""
        self._pool.shutdown(wait=False, cancel_futures=True)
