"""Style that the pictures of the reach results share."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.ticker import FuncFormatter

from tools.docs.results import Json
from tools.docs.world.plots import BLUE, GREEN, ORANGE

THESIS_SUCCESS = 0.9176
"""Success on the targets in the thesis (docs/method.md 2.6)."""
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


def draw_rates(
    axis: Any, x: Sequence[float], rates: Sequence[Json], look: tuple[str, str, str]
) -> None:
    """Draw rates and their 95 % intervals over ``x``; ``look`` is label, colour and marker."""
    label, colour, mark = look
    middle, low, high = (
        np.array([one[key] for one in rates]) for key in ("mean", "low", "high")
    )
    axis.errorbar(
        x,
        middle,
        np.array([middle - low, high - middle]).clip(0.0),
        fmt=f"{mark}-",
        color=colour,
        ms=4.5,
        elinewidth=0.9,
        label=label,
    )
