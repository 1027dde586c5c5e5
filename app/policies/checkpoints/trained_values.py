"""What a reach policy met in training, to flag what lies outside of it.

A checkpoint's manifest says the least and the greatest value of every state variable. A person
whom the policy sees otherwise than given (far away, say) is compared as given.
"""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from app.sim.core.arrays import Vec
from app.sim.core.out_of_range import OutsideField
from app.sim.human.person import Person

SLACK = 0.02
"""Inputs this far outside what was met in training are not flagged [m, rad or per second]."""
HUMAN = ("x", "y", "vx", "vy", "r", "growth")
"""What a policy sees of a person."""
ROBOT = (
    *(f"robot.q[{j}]" for j in range(6)),
    *(f"robot.qd[{j}]" for j in range(6)),
    *("goal.x", "goal.y", "goal.z"),
)
"""What messages call the numbers of ``q``, ``qd`` and ``goal`` of a ``trained_range``."""
_SIZES = {"q": 6, "qd": 6, "goal": 3, "human": len(HUMAN)}

Seen = tuple[int | None, Vec]
"""A person, bodies first, or None for nobody, and the cylinder a policy saw, shape (6,)."""


class TrainedValues:
    """Least and greatest values met in training; infinite where unknown.

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
        self._least, self._most = self._low - SLACK, self._high + SLACK

    def outside(
        self, state: Vec, seen: Iterable[Seen], order: Sequence[int]
    ) -> tuple[OutsideField, ...]:
        """Return what lies outside, each field once.

        Args:
            state: q [rad], qd [rad/s] and goal [m], shape (15,).
            seen: People as the policy saw them.
            order: Their numbers in the question, bodies first.
        """
        found = [one for who, view in seen for one in self._of(state, who, view, order)]
        return tuple(dict.fromkeys(found))

    def _of(
        self, state: Vec, who: int | None, seen: Vec, order: Sequence[int]
    ) -> list[OutsideField]:
        """Return what of the state, and of a person or nobody, lies outside."""
        values = np.concatenate((state, seen))
        inside = (self._least <= values) & (values <= self._most)
        if inside.all():
            return []
        names = ROBOT
        if who is not None:
            names += tuple(f"people[{order[who]}].{name}" for name in HUMAN)
        wrong = np.flatnonzero(~inside).tolist()
        found = [
            OutsideField(
                field=names[i],
                value=float(values[i]),
                low=float(self._low[i]),
                high=float(self._high[i]),
            )
            for i in wrong
            if i < len(names)
        ]
        if len(found) < len(wrong):
            found.append(OutsideField(field="people", value=0.0, low=1.0, high=4.0))
        return found


def as_told(
    seen: Iterable[Seen], told: Sequence[Person], viewed: Sequence[Person]
) -> list[Seen]:
    """Return who was seen, with the numbers that were told where the policy saw others.

    Args:
        seen: As the policy saw them.
        told: The people as given.
        viewed: The same people as policies know them.
    """
    return [
        (who, view if who is None else view + _cylinder(told[who]) - _cylinder(viewed[who]))
        for who, view in seen
    ]


def _cylinder(person: Person) -> Vec:
    """Return x, y, 0, 0, radius, growth of a person; no radius where there are joints."""
    x, y, r = (*person.q[:2], 0.0) if person.cylinder is None else person.cylinder
    return np.array([x, y, 0.0, 0.0, r, person.growth])
