"""Draw policy and planners under the safety layer, from ``docs/results/reach-ssm.json``.

    python docs/reach_ssm_plots.py

Writes ``docs/img/reach/override.png``, the override over time in one crossing (the source's
fig. 4.9), and ``docs/img/reach/arrivals.png``, how many runs have arrived by when.
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from docs.world_plots import BLUE, GREEN, GREY, ORANGE, RED, panels, save  # noqa: E402

RESULT = ROOT / "docs/results/reach-ssm.json"
IMAGES = ROOT / "docs/img/reach"
ROWS = {
    "policy-ahead": ("policy, looking ahead", BLUE, "-"),
    "policy-heedless": ("... knowing nothing of the layer", BLUE, "--"),
    "policy": ("policy alone", BLUE, ":"),
    "rrt-star-once": ("RRT*, planned once", ORANGE, "-"),
    "rrt-connect": ("RRT-Connect, again where blocked", RED, "-"),
    "aorrtc": ("AORRTC, again where blocked", RED, ":"),
    "replan-every-cycle": ("RRT-Connect, every 20 ms", GREEN, "-"),
    "policy-alone": ("policy, nobody there", GREY, "-"),
    "hindsight": ("best replay in hindsight", GREY, ":"),
}
"""Words, colour and line of each row."""
LAYER = "measured"
"""The layer that is drawn: the one that goes by measured velocities."""
SHOWN = ("policy-ahead", "rrt-star-once")
"""Rows whose override is drawn."""
Json = dict[str, Any]


def override(example: Json) -> Figure:
    """Draw the override over time in one crossing, a panel for each row."""
    figure, axes = panels(len(SHOWN), 1, 3.9, sharex=True)
    longest = max(len(example["override"][name]) for name in SHOWN) * example["dt_s"]
    for axis, name in zip(axes[:, 0], SHOWN, strict=True):
        label, colour, _ = ROWS[name]
        course = 100.0 * np.array(example["override"][name])
        time = example["dt_s"] * np.arange(len(course) + 1)
        axis.stairs(course, time, color=colour, fill=True, alpha=0.15)
        axis.stairs(course, time, color=colour, baseline=None)
        axis.axvline(time[-1], color=colour, lw=0.9, ls="--")
        axis.annotate(
            f"there after {time[-1]:.2f} s",
            (time[-1], 50.0),
            xytext=(-4, 0),
            textcoords="offset points",
            ha="right",
            color=colour,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.5},
        )
        axis.set(title=label[0].upper() + label[1:], ylabel="override [%]", ylim=(0.0, 105.0))
    axes[-1, 0].set(xlabel="time [s]", xlim=(0.0, 1.05 * longest))
    return figure


def arrivals(seconds: Json, cap: float) -> Figure:
    """Draw how many runs have arrived by when, a line for each row."""
    figure, axes = panels(1, 1, 3.6)
    axis = axes[0, 0]
    for name, (label, colour, line) in ROWS.items():
        if name in seconds:
            times = np.sort([cap if s is None else s for s in seconds[name]])
            share = 100.0 * np.arange(1, len(times) + 1) / len(times)
            axis.step(times, share, where="post", color=colour, ls=line, label=label)
    axis.set(
        title="Runs that have arrived",
        xlabel="time since the start [s]",
        ylabel="runs [%]",
        xlim=(0.0, 0.7 * cap),
        ylim=(0.0, 101.0),
    )
    axis.legend(loc="lower right")
    return figure


def main() -> int:
    """Draw both pictures; without a result there is nothing to draw."""
    if not RESULT.exists():
        print(f"{RESULT.relative_to(ROOT)} is not there: run `evaluate reach-ssm` first")
        return 1
    result = json.loads(RESULT.read_text(encoding="utf-8"))
    example, seconds = result["example"][LAYER], result["seconds"][LAYER]
    save(override, IMAGES / "override.png", example)
    save(arrivals, IMAGES / "arrivals.png", seconds, result["settings"]["cap_s"])
    return 0


if __name__ == "__main__":
    sys.exit(main())
