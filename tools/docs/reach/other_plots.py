"""Pictures of the reach results: several people, trackers, smoothness, learning curves.

Called by ``reach/plots.py``.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter

from tools.docs.reach.style import INK, MODES, PURPLE, THESIS_SUCCESS, draw_rates, percent
from tools.docs.results import Json
from tools.docs.world.plots import BLUE, GREEN, GREY, ORANGE, RED, panels

PEOPLE = {"direct": "nearest person", "direct-rollout": "nearest, rollout"}
"""Labels of two modes beside several people."""
TRACKERS = {
    "exact": "exact state",
    "30hz": "30 Hz",
    "100ms": "30 Hz, 100 ms latency",
    "100ms-noise": "100 ms, noise 20 mm",
    "200ms-noise": "200 ms, noise 20 mm",
    "100ms-not-predicted": "100 ms, no prediction",
    "30hz-rollout": "30 Hz, rollout",
    "100ms-noise-rollout": "100 ms, 20 mm, rollout",
}
"""Labels of the rows of ``reach-tracker``."""
PRESET_COLOURS = {"td3": BLUE, "thesis": ORANGE, "stock": GREY}
"""Colour of a learning curve by a part of its name; later entries take precedence."""
JOINTS = ("shoulder pan", "shoulder lift", "elbow", "wrist 1", "wrist 2", "wrist 3")
JOINT_COLOURS = (BLUE, ORANGE, GREEN, RED, PURPLE, GREY)


def others(people: Sequence[Json], speeds: Json | None, trackers: Json | None) -> Figure:
    """Draw results beside several people, at given speeds, and through a tracker."""
    there: list[tuple[Callable[[Axes, Any], None], Any]] = [
        (draw, one)
        for draw, one in ((_people, people), (_speeds, speeds), (_trackers, trackers))
        if one
    ]
    figure, axes = panels(1, len(there), 3.2, width_ratios=[1.1, 1.0, 1.2][: len(there)])
    for axis, (draw, one) in zip(axes[0], there, strict=True):
        draw(axis, one)
    return figure


def _people(axis: Axes, results: Sequence[Json]) -> None:
    shown = [
        ((PEOPLE.get(mode, MODES[mode][0]), *MODES[mode][1:]), _by_people(results[0], mode))
        for mode in dict.fromkeys(
            one["inference_mode"] for one in results[0]["settings"]["rows"].values()
        )
    ]
    for other in results[1:]:  # one inference mode per further policy
        look = MODES.get(other["label"], (other["label"], INK, "v"))
        shown.append((look, _by_people(other, "direct")))
    for k, (look, own) in enumerate(shown):
        x = [n + 0.06 * (k - 0.5 * (len(shown) - 1)) for n, _ in own]
        draw_rates(axis, x, [rate for _, rate in own], look)
    axis.set(title="Several people", xlabel="people in the cell", ylabel="success")
    axis.xaxis.set_major_locator(FixedLocator(range(5)))
    percent(axis.yaxis)
    axis.set_ylim(bottom=axis.get_ylim()[0] - 0.04)  # space for the legend
    axis.legend(loc="lower left", fontsize=8)


def _by_people(result: Json, mode: str) -> list[tuple[int, Json]]:
    """Return pairs of number of people and success in one inference mode."""
    stated = result["settings"]["rows"]
    return [
        (len(stated[row["name"]]["people"]), row["success"])
        for row in result["results"]
        if stated[row["name"]]["inference_mode"] == mode or _for_all(stated[row["name"]], mode)
    ]


def _for_all(row: Json, mode: str) -> bool:
    """Return whether a row counts for a mode that differs only beside more people."""
    n = len(row["people"])
    return n == 0 or (
        n == 1 and row["inference_mode"] == "direct" and not mode.endswith("-rollout")
    )


def _speeds(axis: Axes, result: Json) -> None:
    stated, rows = result["settings"]["rows"], result["results"]
    speeds = list(dict.fromkeys(one["speed_m_s"] for one in stated.values()))
    ahead = [row["name"].endswith("-rollout") for row in rows]
    shift, width = (0.2, 0.36) if any(ahead) else (0.0, 0.6)
    for row, rollout in zip(rows, ahead, strict=True):
        x = speeds.index(stated[row["name"]]["speed_m_s"]) + (shift if rollout else -shift)
        collision, timeout = row["collision"]["mean"], row["timeout"]["mean"]
        axis.bar(x, collision, color=RED, width=width)
        axis.bar(x, timeout, bottom=collision, color=GREY, width=width)
        text = f"{100.0 * row['success']['mean']:.1f}"
        axis.text(x, collision + timeout, text, ha="center", va="bottom", fontsize=7.5)
    most = max(1.0 - row["success"]["mean"] for row in rows)
    axis.set_xticks(range(len(speeds)), [f"{speed:g}" for speed in speeds])
    words = "[m/s]; right: rollout" if any(ahead) else "[m/s]"
    axis.set(title="Speed of people", xlabel=words, ylabel="collision, timeout")
    axis.set_ylim(0.0, 1.2 * max(most, 1e-3))
    axis.grid(False, axis="x")
    axis.tick_params(axis="x", length=0)
    percent(axis.yaxis)


def _trackers(axis: Axes, result: Json) -> None:
    rows = result["results"]
    for k, row in enumerate(rows):
        axis.barh(-k, row["collision"]["mean"], color=RED, height=0.6)
        axis.barh(
            -k, row["timeout"]["mean"], left=row["collision"]["mean"], color=GREY, height=0.6
        )
        fails = 1.0 - row["success"]["mean"]
        axis.text(fails, -k, f" {100.0 * row['success']['mean']:.1f} %", va="center")
    axis.set_yticks(
        [-k for k in range(len(rows))], [TRACKERS.get(row["name"], row["name"]) for row in rows]
    )
    most = max(1.0 - row["success"]["mean"] for row in rows)
    axis.set(
        title="Observed through a tracker",
        xlabel="collision, timeout",
        xlim=(0.0, 1.35 * max(most, 1e-3)),
    )
    axis.grid(False, axis="y")
    axis.tick_params(axis="y", length=0)
    percent(axis.xaxis)


def smoothness(results: Sequence[Json]) -> Figure:
    """Draw joints, tool and person along an episode, a column for each result."""
    figure, axes = panels(4, len(results), 7.4, sharex="col", height_ratios=(1, 1, 1, 0.75))
    for column, result in enumerate(results):
        _episode(axes[:, column], result, first=column == 0)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=6)
    return figure


def _episode(axes: Sequence[Axes], result: Json, first: bool) -> None:
    shown, row = result["example"], result["results"][0]
    degree = result["settings"]["action"]["degree"]
    t = shown["dt_s"] * np.arange(len(shown["q_rad"]))
    q, qd, qdd = (np.array(shown[name]) for name in ("q_rad", "qd_rad_s", "qdd_rad_s2"))
    for joint, (name, colour) in enumerate(zip(JOINTS, JOINT_COLOURS, strict=True)):
        axes[0].plot(t, q[:, joint], color=colour, label=name)
        axes[1].plot(t, qd[:, joint], color=colour)
        style = "steps-pre" if degree == 2 else "default"
        axes[2].plot(t, qdd[:, joint], color=colour, drawstyle=style, lw=0.9)
    for axis, limit in (
        (axes[1], row["speed_limit_rad_s"]),
        (axes[2], row["acceleration_limit_rad_s2"]),
    ):
        for value in (-limit, limit):
            axis.axhline(value, color=RED, lw=0.9, ls=":")
        axis.set_ylim(-1.12 * limit, 1.12 * limit)
    axes[3].plot(t, shown["distance_m"], color=INK, label="tcp to goal")
    axes[3].plot(t, shown["clearance_m"], color=RED, label="robot to person")
    axes[3].axhline(0.1, color=GREY, lw=0.9, ls=":")
    axes[3].set(ylim=(0.0, None), xlabel="time since the start [s]", xlim=(0.0, t[-1]))
    axes[0].set_title(f"Degree {degree}: {'acceleration' if degree == 2 else 'jerk'}-limited")
    axes[3].legend(loc="upper right", ncols=2)
    if first:
        names = ("position [rad]", "speed [rad/s]", "acceleration [rad/s²]", "distance [m]")
        for axis, name in zip(axes, names, strict=True):
            axis.set_ylabel(name)


def colour_of(name: str) -> str:
    """Return the colour of a preset's curves."""
    return [PURPLE, *(colour for part, colour in PRESET_COLOURS.items() if part in name)][-1]


def curves(found: Sequence[Json]) -> Figure:
    """Draw success and collisions of trainings over their CPU time."""
    figure, axes = panels(1, 2, 3.5)
    left, right = axes[0]
    named: set[str] = set()
    for one in found:
        colour = colour_of(one["name"])
        label = None if one["name"] in named else one["name"]
        named.add(one["name"])
        points = one["played"] or one["targets"]
        minutes = np.array([point["cpu_s"] / 60.0 for point in points])
        for axis, kind in ((left, "success"), (right, "collision")):
            shown = label if kind == "success" else None
            rates = [point[kind] for point in points]
            axis.plot(minutes, rates, color=colour, lw=1.1, alpha=0.85, label=shown)
    left.axhline(THESIS_SUCCESS, color=RED, lw=0.9, ls=":")
    left.text(
        0.98,
        THESIS_SUCCESS - 0.01,
        "thesis, after 47 h",
        color=RED,
        va="top",
        ha="right",
        transform=left.get_yaxis_transform(),
    )
    left.set(title="Success", ylim=(0.0, 1.02))
    right.set(title="Collisions", ylim=(0.0, None))
    for axis in (left, right):
        axis.set(xscale="log", xlabel="CPU time of the training [min]")
        axis.xaxis.set_major_formatter(FuncFormatter(lambda value, _place: f"{value:g}"))
        axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.xaxis.set_minor_formatter(NullFormatter())
        percent(axis.yaxis)
    figure.legend(loc="outside lower center", ncols=min(5, len(named)))
    return figure
