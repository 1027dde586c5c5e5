"""Training range of a reach policy, to flag inputs outside it.

The manifest of a checkpoint states minimum and maximum of every state variable. People are
compared as given, also where the policy observes them differently (as far away, for example).
"""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from app.policies.checkpoints.training_range import TOLERANCE
from app.sim.core.arrays import Vec
from app.sim.core.kernels.bounds import are_inside
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
_SIZES = {"q": 6, "qd": 6, "goal": 3, "human": len(HUMAN)}

PersonValues = tuple[int | None, Vec]
"""Index of a person, bodies first, or None, and the observed cylinder, shape (6,)."""


class ReachTrainingRange:
    """Minimum and maximum values of training; infinite if unknown.

    Args:
        ranges: ``trained_range`` of the manifest: ``low`` and ``high`` of each variable.
    """

    def __init__(self, ranges: Mapping[str, Mapping[str, Sequence[float]]]) -> None:
        n, first = sum(_SIZES.values()), 0
        self._low, self._high = np.full(n, -np.inf), np.full(n, np.inf)
        for name, size in _SIZES.items():
            entry = ranges.get(name)
            if entry is not None and len(entry["low"]) <= size:
                known = slice(first, first + len(entry["low"]))
                self._low[known], self._high[known] = entry["low"], entry["high"]
            first += size
        self._least, self._most = self._low - TOLERANCE, self._high + TOLERANCE

    def outside(
        self, state: Vec, seen: Iterable[PersonValues], order: Sequence[int]
    ) -> tuple[OutOfRangeValue, ...]:
        """Return the inputs outside the training range, each field once.

        Args:
            state: q [rad], qd [rad/s] and goal [m], shape (15,).
            seen: Observed people.
            order: Their indices in the query, bodies first.
        """
        found = [one for who, view in seen for one in self._of(state, who, view, order)]
        return tuple(dict.fromkeys(found))

    def _of(
        self, state: Vec, who: int | None, seen: Vec, order: Sequence[int]
    ) -> list[OutOfRangeValue]:
        """Return the variables of the state and of one person outside the range."""
        values = np.concatenate((state, seen))
        if are_inside(values, self._least, self._most):
            return []
        inside = (self._least <= values) & (values <= self._most)
        names = ROBOT
        if who is not None:
            names += tuple(f"people[{order[who]}].{name}" for name in HUMAN)
        wrong = np.flatnonzero(~inside).tolist()
        found = [
            OutOfRangeValue(
                field=names[i],
                value=float(values[i]),
                low=float(self._low[i]),
                high=float(self._high[i]),
            )
            for i in wrong
            if i < len(names)
        ]
        if len(found) < len(wrong):
            found.append(OutOfRangeValue(field="people", value=0.0, low=1.0, high=4.0))
        return found


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
