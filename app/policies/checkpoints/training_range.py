"""Minimum and maximum of every state variable in training, for manifests."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from app.sim.core.arrays import Vec


class Ranges:
    """Minimum and maximum of every state variable in training.

    Args:
        known: Ranges of an earlier attempt's manifest; None without one.
    """

    def __init__(self, known: Mapping[str, Any] | None) -> None:
        known = known or {}
        self._low = {name: np.array(entry["low"]) for name, entry in known.items()}
        self._high = {name: np.array(entry["high"]) for name, entry in known.items()}

    def look(self, met: Mapping[str, Vec]) -> None:
        """Extend the ranges by visited states: rows of each variable, shape (n, size)."""
        for name, rows in met.items():
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
            for name in self._low
        }
