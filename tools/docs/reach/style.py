"""Style that the pictures of the reach results share."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.ticker import FuncFormatter
from numpy.typing import NDArray

from tools.docs.world.plots import BLUE, GREEN, ORANGE

Json = dict[str, Any]
Grid = NDArray[np.float64]
PURPLE, INK = "#7c5aa6", "#374151"
MODES = {
    "direct": ("direct", BLUE, "o"),
    "interpolated": ("interpolated", ORANGE, "s"),
    "distance-weighted": ("distance-weighted", ORANGE, "s"),
    "set": ("set encoding", PURPLE, "^"),
    "direct-rollout": ("direct, rollout", GREEN, "D"),
    "interpolated-rollout": ("interpolated, rollout", PURPLE, "^"),
}
"""Label, colour and marker of each inference mode."""


def percent(axis: Any) -> None:
    """Label an axis in percent, with as many decimals as its ticks need."""
    axis.set_major_formatter(FuncFormatter(lambda value, _place: f"{100.0 * value:.4g} %"))


def bars(rates: Sequence[Json]) -> Grid:
    """Return the lengths of error bars below and above rates, shape (2, n)."""
    return np.array(
        [[one["mean"] - one["low"], one["high"] - one["mean"]] for one in rates]
    ).T.clip(0.0)
