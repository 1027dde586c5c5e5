"""Minimum and maximum of every state variable in training, for manifests."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from app.sim.core.arrays import Vec
from app.state_dict import State

TOLERANCE = 0.02
"""Excess over the range that is not reported [m, rad or per second]."""


class TrainingRange:
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
