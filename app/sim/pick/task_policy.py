"""Interface of a policy that selects a task, and its decision."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.out_of_range import OutsideField
from app.sim.human.person import Person
from app.sim.robot.actions import ActionSettings


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """One geometric task the robot may choose: bring the tool to ``position``."""

    id: str
    """Name given by the caller, unique among the candidates."""
    position: Vec
    """Point the tcp must reach, robot base frame [m], shape (3,)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """The critic's choice among candidates, with all that explains it (METHOD 3.1)."""

    chosen: str
    """Id of the chosen candidate."""
    index: int
    """Its place in the list of candidates."""
    values: tuple[float, ...]
    """``Q(s_i, pi(s_i))`` of every candidate, discounted reward."""
    actions: NDArray[np.float32]
    """The policy's action for every candidate in [-1, 1], shape (n, 5)."""
    qd_target: Vec
    """The joint speeds these actions ask for [rad/s], shape (n, 6)."""
    reachable: tuple[bool, ...]
    """Whether inverse kinematics finds a vertical-tool posture at each candidate."""
    outside: tuple[OutsideField, ...]
    """Fields of the state outside the joints' limits or the training range."""
    outside_candidates: tuple[tuple[OutsideField, ...], ...]
    """The same for each candidate's position."""
    checkpoint: str
    """SHA-256 of the checkpoint that decided."""
    elapsed_ms: float
    """Time the decision took [ms]."""
    seen: int | None = None
    """Which of the people a policy for one person saw: the nearest; None for nobody."""


class TaskPolicy(Protocol):
    """Chooses among candidates and says how to move; safe to call from several threads."""

    @property
    def checkpoint(self) -> str:
        """SHA-256 of the checkpoint."""

    @property
    def action(self) -> "ActionSettings":
        """What its actions mean."""

    @property
    def title(self) -> str:
        """Short text for people, such as ``"pick-td3, 2.0 M steps"``."""

    @property
    def cell(self) -> str:
        """Name of the work cell it was trained for."""

    @property
    def cell_sha256(self) -> str:
        """Identity of that cell's content (``Cell.sha256``)."""

    def decide(
        self,
        q: Vec,
        qd: Vec,
        people: Sequence[Person],
        candidates: Sequence[Candidate],
        *,
        previous: str | None = None,
        time_left_s: float = 10.0,
    ) -> Decision:
        """Choose one candidate.

        Args:
            q: Robot joint positions [rad], shape (6,).
            qd: Robot joint speeds [rad/s], shape (6,).
            people: The people in the cell, at most four. A policy that knows one person sees
                the one nearest to the robot.
            candidates: What may be chosen, at least one.
            previous: The candidate chosen last, for hysteresis; None chooses afresh.
            time_left_s: Time left to reach a candidate [s].

        Raises:
            InvalidInput: A value that no answer can be given for.
        """
