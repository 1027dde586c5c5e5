"""Pictures of ``docs/world.md``, and the plot style that all scripts here share."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Rectangle

from app.sim.cells.cell import Cell, load_cell
from app.sim.people.pedestrian import PedestrianSettings
from app.sim.robot.capsules import TOOL
from app.sim.robot.kernels.arm import Arm
from tests.sim.mesh_gap import Gap
from tools.docs.world.measures import EXTENT, Episode, ReachMap
from tools.docs.world.walks import Walk

BLUE, ORANGE, GREEN, RED, GREY = "#2563a8", "#d97706", "#2a9d6f", "#b3261e", "#8a8f98"
LIGHT = "#e6e8eb"
MISSES = LinearSegmentedColormap.from_list(
    "misses", ["#7f1d1d", "#d9622b", "#f3c567", "#dcebd8", "#9ccfb0"]
)
"""From many failures to none."""
LIFT = 1
"""The highlighted joint: shoulder lift, which reaches the end of its range."""
STYLE: Any = {
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#4b5563",
    "axes.grid": True,
    "grid.color": LIGHT,
    "grid.linewidth": 0.7,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "lines.linewidth": 1.2,
    "figure.dpi": 100,
    "savefig.dpi": 150,
    "figure.constrained_layout.use": True,
}
WIDTH = 9.0
"""Width of all pictures [in]."""


def save(draw: Callable[..., Figure], path: Path, *shown: Any) -> None:
    """Draw with one style and write a reproducible PNG."""
    with mpl.rc_context(STYLE):
        figure = draw(*shown)
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, metadata={"Software": None})


def panels(rows: int, columns: int, height: float, **options: Any) -> tuple[Figure, Any]:
    """Return a figure without window, and its axes."""
    figure = Figure(figsize=(WIDTH, height))
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def mesh_gap(found: Sequence[Gap]) -> Figure:
    """Draw distances of capsules over those of meshes, and a histogram of the difference."""
    figure, axes = panels(1, 2, 4.2, width_ratios=(1.0, 1.1))
    left, right = axes[0]
    tool = np.array([one.nearest == TOOL for one in found])
    capsules = 1e3 * np.array([one.capsules for one in found])
    meshes = 1e3 * np.array([one.meshes for one in found])
    for mask, colour, label in (
        (~tool, BLUE, "a link is nearest"),
        (tool, ORANGE, "the tool is nearest"),
    ):
        left.plot(meshes[mask], capsules[mask], ".", ms=2.5, color=colour, label=label)
    top = max(meshes.max(), capsules.max())
    left.plot([0, top], [0, top], color=GREY, lw=0.9, label="equal")
    left.set(
        title="Distance of capsules and of meshes",
        xlabel="distance of raw meshes to the person [mm]",
        ylabel="distance of capsules to the person [mm]",
        xlim=(0, top),
        ylim=(0, top),
        aspect="equal",
    )
    left.legend(loc="lower right", markerscale=3)
    gap = (meshes - capsules)[~tool]
    right.hist(gap, bins=np.arange(0.0, gap.max() + 1.0, 1.0), color=BLUE, alpha=0.85)
    marks = (
        (gap.mean(), "mean", RED, -2),
        (np.percentile(gap, 95), "95 %", GREY, -2),
        (gap.max(), "greatest", GREY, -40),
    )
    for value, name, colour, down in marks:
        right.axvline(value, color=colour, lw=1.2)
        right.annotate(
            f"{name}\n{value:.1f} mm",
            (value, right.get_ylim()[1]),
            xytext=(-4 if name == "greatest" else 4, down),
            textcoords="offset points",
            va="top",
            ha="right" if name == "greatest" else "left",
        )
    right.set(
        title="Difference for the links",
        xlabel="distance of meshes minus capsules [mm]",
        ylabel="configurations [per mm]",
    )
    return figure


def limits(arm: Arm, shown: dict[int, Episode]) -> Figure:
    """Draw position, speed, acceleration and jerk of one episode per degree."""
    figure, axes = panels(4, 2, 7.4, sharex=True, sharey="row")
    rows = (
        ("q", "position [rad]", arm.limits.q_min, arm.limits.q_max),
        ("qd", "speed [rad/s]", -arm.limits.qd_max, arm.limits.qd_max),
        ("qdd", "acceleration [rad/s²]", -arm.limits.qdd_max, arm.limits.qdd_max),
        ("jerk", "jerk [rad/s³]", -arm.limits.jerk_max, arm.limits.jerk_max),
    )
    for column, (degree, one) in enumerate(shown.items()):
        for axis, (name, label, low, high) in zip(axes[:, column], rows, strict=True):
            if column == 0:
                axis.set_ylabel(label)
            if name == "jerk" and degree == 2:
                _say(axis, "not limited: acceleration may jump from period to period")
                continue
            values = getattr(one, name)
            if name != "q":  # the other joints have the same limits here
                axis.plot(one.time, np.delete(values, LIFT, axis=1), color="#c5cad1", lw=0.6)
            axis.plot(one.time, values[:, LIFT], color=BLUE)
            for bound in (low[LIFT], high[LIFT]):
                axis.axhline(bound, color=RED, lw=1.1, ls=(0, (5, 3)))
        kind = "acceleration-limited" if degree == 2 else "jerk-limited"
        axes[0, column].set_title(f"Degree {degree}, {kind}")
        axes[-1, column].set(xlabel="time [s]", xlim=(0.0, one.time[-1]))
    lines = (
        (BLUE, "shoulder lift", "-"),
        ("#c5cad1", "the other joints", "-"),
        (RED, "limit", "--"),
    )
    handles = [Line2D([], [], color=colour, label=text, ls=ls) for colour, text, ls in lines]
    figure.legend(handles=handles, ncols=3, loc="outside lower center")
    return figure


def _say(axis: Axes, text: str) -> None:
    """Write a line into the centre of an empty panel."""
    axis.text(0.5, 0.5, text, transform=axis.transAxes, ha="center", va="center", color=GREY)


def walker(one: Walk, rules: PedestrianSettings) -> Figure:
    """Draw path, speed and radius of a pedestrian."""
    figure = Figure(figsize=(WIDTH, 4.2))
    grid = figure.add_gridspec(2, 2, width_ratios=(1.15, 1.0))
    plan = figure.add_subplot(grid[:, 0])
    speed = figure.add_subplot(grid[0, 1])
    radius = figure.add_subplot(grid[1, 1], sharex=speed)
    x, y = one.position.T
    size = (rules.x_max - rules.x_min, rules.y_max - rules.y_min)
    plan.add_patch(Rectangle((rules.x_min, rules.y_min), *size, fill=False, ec=RED, ls="--"))
    for k in range(0, len(x), 75):
        circle = Circle((x[k], y[k]), one.radius[k], fc=BLUE, alpha=0.10, ec=BLUE, lw=0.6)
        plan.add_patch(circle)
    plan.plot(x, y, color=BLUE)
    plan.plot(x[0], y[0], "o", color=GREEN, ms=6)
    plan.annotate("start", (x[0], y[0]), xytext=(8, -4), textcoords="offset points")
    plan.plot(0.0, 0.0, "s", color="#4b5563", ms=8)
    plan.annotate("robot", (0.0, 0.0), xytext=(8, -3), textcoords="offset points")
    plan.annotate(
        "walking area of the axis",
        (rules.x_min, rules.y_min),
        xytext=(2, -11),
        textcoords="offset points",
        color=RED,
    )
    plan.set(
        title="Path, seen from above; one circle per 1.5 s",
        xlabel="x [m]",
        ylabel="y [m]",
        aspect="equal",
        xlim=(-2.5, 1.5),
        ylim=(-0.3, 2.5),
    )
    for axis, values, bounds, label, title in (
        (speed, np.hypot(*one.velocity.T), (rules.v_min, rules.v_max), "speed [m/s]", "Speed"),
        (radius, one.radius, (rules.r_min, rules.r_max), "radius [m]", "Radius"),
    ):
        axis.plot(one.time, values, color=BLUE)
        for bound in bounds:
            axis.axhline(bound, color=RED, lw=1.0, ls="--")
        axis.set(title=title, ylabel=label)
        axis.set_ylim(0.0, 1.15 * bounds[1])
    radius.set_xlabel("time [s]")
    radius.set_xlim(0.0, one.time[-1])
    return figure


MARKS = {
    "cube": ("s", "cube"),
    "dock": ("D", "dock"),
    "clutter": ("o", "clutter slot"),
    "cluster": ("^", "cluster (tower)"),
    "goal": ("v", "training goal"),
}
SHOWN = (
    # Height [m], cell, kinds of places drawn, title.
    (0.05, "sorting-e0", ("clutter", "cluster"), "z = 0.05 m, sorting-e0"),
    (0.05, "sorting-e1", ("clutter", "cluster"), "z = 0.05 m, sorting-e1"),
    (0.12, "pick-and-place", ("cube", "dock"), "z = 0.12 m, pick-and-place"),
    (0.30, "shared-workspace", ("goal",), "z = 0.30 m, shared-workspace"),
    (0.35, "sorting-e0", ("cluster",), "z = 0.35 m, full towers of e0"),
    (0.45, "sorting-e1", ("cluster",), "z = 0.45 m, full towers of e1"),
)


def reach(maps: Sequence[ReachMap]) -> Figure:
    """Draw reachability at several heights, with the stations of the cells."""
    figure, axes = panels(2, 3, 5.4, sharex=True, sharey=True)
    fastest = max(float(np.nanmax(one.slowest)) for one in maps)
    by_height = {one.z: one for one in maps}
    for axis, (z, name, kinds, title) in zip(axes.flat, SHOWN, strict=True):
        one, cell = by_height[z], load_cell(name)
        options = {"origin": "lower", "extent": EXTENT, "zorder": 1, "vmin": 0.0}
        options["interpolation"] = "nearest"
        blocked = np.where(one.blocked, 0.5, np.nan)
        axis.imshow(blocked, cmap="Reds", vmax=1.0, **options)
        image = axis.imshow(one.slowest, cmap="viridis", vmax=fastest, **options)
        corner = (cell.table.x_min, cell.table.y_min)
        size = (cell.table.x_max - corner[0], cell.table.y_max - corner[1])
        for colour, width in (("white", 2.4), ("black", 1.1)):
            axis.add_patch(Rectangle(corner, *size, fill=False, ec=colour, lw=width, zorder=2))
        for kind, places in _places(cell).items():
            if kind in kinds:
                axis.plot(*places.T, MARKS[kind][0], ms=4, mfc="white", mec="black", mew=0.7)
        axis.set_title(title)
        axis.grid(visible=False)
        axis.set_facecolor("#f3f4f6")
    for axis in axes[-1]:
        axis.set_xlabel("x [m]")
    for axis in axes[:, 0]:
        axis.set_ylabel("y, toward the person [m]")
    bar = figure.colorbar(image, ax=axes, shrink=0.8, pad=0.01, aspect=30)
    bar.set_label("tcp speed in its slowest direction,\njoints at 1 rad/s [m/s]")
    bar.outline.set_visible(False)
    handles: list[Artist] = [
        Line2D([], [], marker=mark, label=text, mfc="white", mec="black", color="none")
        for mark, text in MARKS.values()
    ]
    handles.append(Line2D([], [], color="black", lw=1.1, label="table"))
    handles.append(Rectangle((0, 0), 1, 1, fc="#fb7252", label="touches table or itself"))
    figure.legend(handles=handles, ncols=7, loc="outside lower center", columnspacing=1.2)
    return figure


def _places(cell: Cell) -> dict[str, np.ndarray]:
    """Return stations and goals of a cell by kind [m], shape (n, 2) each."""
    found: dict[str, list[Sequence[float]]] = {}
    for station in cell.stations:
        found.setdefault(station.kind, []).append(station.position[:2])
    if (region := cell.goal_region) is not None:
        x, y = (
            np.arange(middle - 0.5 * size, middle + 0.5 * size + 1e-9, region.spacing)
            for middle, size in zip(region.center[:2], region.size[:2], strict=True)
        )
        found["goal"] = [(a, b) for a in x for b in y]
    return {kind: np.array(places) for kind, places in found.items()}


def scaling(rows: Sequence[dict[str, Any]]) -> Figure:
    """Draw the cost of a step over people and over capsules of the robot."""
    figure, axes = panels(1, 2, 3.4, sharey=True)
    for kind, colour in (("workers", BLUE), ("walkers", ORANGE)):
        found = [row for row in rows if row["name"].startswith(f"pick/{kind}-")]
        found += [row for row in rows if row["name"] == "pick/workers-0"] * (kind == "walkers")
        found.sort(key=lambda row: row["people"])
        axes[0, 0].plot(
            [row["people"] for row in found],
            [row["us_per_step"] for row in found],
            "o-",
            color=colour,
            label="18-DoF workers, 12 capsules each"
            if kind == "workers"
            else "walking cylinders",
        )
    axes[0, 0].set(
        title="People, robot of 12 capsules",
        xlabel="people in the cell",
        ylabel="cost of a step [µs of one core]",
        xticks=range(5),
        ylim=(0.0, None),
    )
    axes[0, 0].legend(loc="upper left")
    found = [row for row in rows if row["name"].startswith("pick/capsules-")]
    axes[0, 1].plot(
        [row["pairs"] for row in found],
        [row["us_per_step"] for row in found],
        "o-",
        color=GREEN,
    )
    for row in found:
        axes[0, 1].annotate(
            f"robot of {row['capsules']}",
            (row["pairs"], row["us_per_step"]),
            xytext=(5, -12),
            textcoords="offset points",
        )
    axes[0, 1].set(
        title="Capsules of the robot, one worker",
        xlabel="exact distances per pose [pairs of capsules]",
    )
    axes[0, 1].margins(x=0.15)
    return figure
