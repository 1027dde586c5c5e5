"""Minimum and maximum of every state variable in training, for manifests and decisions."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from app.sim.core.arrays import Vec
from app.sim.core.kernels.bounds import are_inside
from app.sim.core.out_of_range import OutOfRangeValue
from app.state_dict import State, Stateful

TOLERANCE = 0.02
"""Excess over the range that is not reported [m, rad or per second]."""


class TrainingRange(Stateful):
    """Minimum and maximum of every state variable in training."""

    def __init__(self) -> None:
        self._low: dict[str, Vec] = {}
        self._high: dict[str, Vec] = {}

    def state_dict(self) -> State:
        """Return the ranges with all digits: minimum and maximum of each variable."""
        return {name: np.stack([low, self._high[name]]) for name, low in self._low.items()}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Restore the ranges."""
        self._low = {name: one[0].copy() for name, one in state.items()}
        self._high = {name: one[1].copy() for name, one in state.items()}

    def extend(self, visited: Mapping[str, Vec]) -> None:
        """Extend the ranges by visited states: rows of each variable, shape (n, size)."""
        for name, rows in visited.items():
            low, high = rows.min(axis=0), rows.max(axis=0)
            self._low[name] = np.minimum(self._low.get(name, low), low)
            self._high[name] = np.maximum(self._high.get(name, high), high)

    def as_json(self) -> dict[str, dict[str, list[float]]]:
        """Return the ranges in the format of manifests."""
        return {
            name: {
                "low": [round(float(value), 5) for value in self._low[name]],
                "high": [round(float(value), 5) for value in self._high[name]],
            }
            for name in sorted(self._low)
        }


class KnownRange:
    """Training range of some state variables, to flag inputs outside it.

    Args:
        ranges: ``trained_range`` of a manifest.
        sizes: Names of the variables and their numbers of values; infinite where unknown.
    """

    def __init__(self, ranges: Mapping[str, Any], sizes: Mapping[str, int]) -> None:
        low: list[float] = []
        high: list[float] = []
        for name, size in sizes.items():
            entry = ranges.get(name, {"low": (), "high": ()})
            unknown = size - len(entry["low"])
            low += [*entry["low"], *[-np.inf] * unknown]
            high += [*entry["high"], *[np.inf] * unknown]
        self._low, self._high = np.array(low, dtype=float), np.array(high, dtype=float)
        self.least, self.most = self._low - TOLERANCE, self._high + TOLERANCE
        """Bounds with TOLERANCE, shape (n,) each."""

    def outside(
        self, values: Vec, fields: Sequence[str], path: str = ""
    ) -> tuple[OutOfRangeValue, ...]:
        """Return the values outside.

        Args:
            values: All values, shape (n,), contiguous.
            fields: Their names in messages.
            path: Start of the names.
        """
        if are_inside(values, self.least, self.most):
            return ()
        inside = (self.least <= values) & (values <= self.most)
        return tuple(
            OutOfRangeValue(
                field=path + fields[i],
                value=float(values[i]),
                low=float(self._low[i]),
                high=float(self._high[i]),
            )
            for i in np.flatnonzero(~inside).tolist()
        )
