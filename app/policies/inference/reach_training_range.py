"""Training range of a reach policy, to flag inputs outside it.

People are compared as given, also where the policy observes them differently (as far away, for
example).
"""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from app.policies.checkpoints.training_range import KnownRange
from app.sim.core.arrays import Vec
from app.sim.core.out_of_range import OutOfRangeValue
from app.sim.human.person import Person
from app.sim.robot.ur10 import JOINT_NAMES

HUMAN = ("x", "y", "vx", "vy", "r", "growth")
"""Observed variables of a person."""
ROBOT = (
    *(f"robot.q.{name}" for name in JOINT_NAMES),
    *(f"robot.qd.{name}" for name in JOINT_NAMES),
    *("goal.x", "goal.y", "goal.z"),
)
"""Names of ``q``, ``qd`` and ``goal`` of a ``trained_range`` in messages."""
NO_PERSON = OutOfRangeValue(field="people", value=0.0, low=1.0, high=4.0)
"""Finding of an empty cell, whose observed person was not in the training."""

PersonValues = tuple[int | None, Vec]
"""Index of a person, bodies first, or None, and the observed cylinder, shape (6,)."""


class ReachTrainingRange:
    """Minimum and maximum values of training; infinite if unknown.

    Args:
        ranges: ``trained_range`` of the manifest: ``low`` and ``high`` of each variable.
    """

    def __init__(self, ranges: Mapping[str, Mapping[str, Sequence[float]]]) -> None:
        self._state = KnownRange(ranges, {"q": 6, "qd": 6, "goal": 3})
        self._person = KnownRange(ranges, {"human": len(HUMAN)})

    def outside(
        self, state: Vec, seen: Iterable[PersonValues], order: Sequence[int]
    ) -> tuple[OutOfRangeValue, ...]:
        """Return the inputs outside the training range, each field once.

        Args:
            state: q [rad], qd [rad/s] and goal [m], shape (15,).
            seen: Observed people.
            order: Their indices in the query, bodies first.
        """
        found = [*self._state.outside(state, ROBOT)]
        for who, view in seen:
            if who is not None:
                found += self._person.outside(view, HUMAN, f"people[{order[who]}].")
            elif self._person.outside(view, HUMAN):
                found.append(NO_PERSON)
        return tuple(dict.fromkeys(found))


def as_given(
    seen: Iterable[PersonValues], given: Sequence[Person], viewed: Sequence[Person]
) -> list[PersonValues]:
    """Return the observed values, with those of the query where policies observe others.

    Args:
        seen: Observed people.
        given: People of the query.
        viewed: The same people as policies observe them.
    """
    return [
        (who, view)
        if who is None or given[who] is viewed[who]
        else (who, view + _cylinder(given[who]) - _cylinder(viewed[who]))
        for who, view in seen
    ]


def _cylinder(person: Person) -> Vec:
    """Return x, y, 0, 0, radius, growth of a person; no radius where there are joints."""
    x, y, r = (*person.q[:2], 0.0) if person.cylinder is None else person.cylinder
    return np.array([x, y, 0.0, 0.0, r, person.growth])
