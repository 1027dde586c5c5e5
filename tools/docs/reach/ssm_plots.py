"""Draw policy and planners under speed and separation monitoring.

    python -m tools.docs.reach.ssm_plots

Reads ``docs/results/reach-ssm.json``; writes ``docs/img/reach/override.png``, the speed
override over time in one crossing (thesis fig. 4.9), and ``docs/img/reach/arrivals.png``, the
share of the runs that reached the goal over time.
"""

import sys

import numpy as np
from matplotlib.figure import Figure

from tools.arguments import parser_of
from tools.docs.results import IMAGES, RESULTS, ROOT, Json, read_result
from tools.docs.world.plots import BLUE, GREEN, GREY, ORANGE, RED, panels, save

RESULT = RESULTS / "reach-ssm.json"
PICTURES = IMAGES / "reach"
ROWS = {
    "policy-rollout": ("policy with rollout", BLUE, "-"),
    "policy-rollout-ssm-agnostic": ("rollout that does not model SSM", BLUE, "--"),
    "policy": ("policy without rollout", BLUE, ":"),
    "rrtstar-once": ("RRT*, planned once", ORANGE, "-"),
    "rrtconnect-blocked": ("RRT-Connect, replan when blocked", RED, "-"),
    "aorrtc-blocked": ("AORRTC, replan when blocked", RED, ":"),
    "replan-every-cycle": ("RRT-Connect, replan every cycle", GREEN, "-"),
    "policy-no-person": ("policy, no person", GREY, "-"),
    "oracle": ("oracle", GREY, ":"),
}
"""Label, colour and line style of each row."""
LAYER = "directed"
"""Assumption of the safety layer in the pictures."""
SHOWN = ("policy-rollout", "rrtstar-once")
"""Rows of the override picture."""


def override(example: Json) -> Figure:
    """Draw the override over time in one crossing, one panel per row."""
    figure, axes = panels(len(SHOWN), 1, 3.9, sharex=True)
    longest = max(len(example["override"][name]) for name in SHOWN) * example["dt_s"]
    for axis, name in zip(axes[:, 0], SHOWN, strict=True):
        label, colour, _ = ROWS[name]
        percent = 100.0 * np.array(example["override"][name])
        time = example["dt_s"] * np.arange(len(percent) + 1)
        axis.stairs(percent, time, color=colour, fill=True, alpha=0.15)
        axis.stairs(percent, time, color=colour, baseline=None)
        axis.axvline(time[-1], color=colour, lw=0.9, ls="--")
        axis.annotate(
            f"goal after {time[-1]:.2f} s",
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
    """Draw the share of the runs at the goal over time, one line per row."""
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
    """Draw both pictures if the result exists."""
    if not RESULT.exists():
        name = RESULT.relative_to(ROOT)
        print(f"{name} does not exist: write it by `python -m app evaluate reach-ssm --json`")
        return 1
    result = read_result(RESULT)
    example, seconds = result["example"][LAYER], result["seconds"][LAYER]
    save(override, PICTURES / "override.png", example)
    save(arrivals, PICTURES / "arrivals.png", seconds, result["settings"]["cap_s"])
    return 0


if __name__ == "__main__":
    parser_of(__doc__).parse_args()
    sys.exit(main())
