"""Draw the trainings of each recipe of the thesis beside ours.

    python -m tools.docs.recipe_plots

Reads the curves in ``docs/results``: ``thesis-sorting``, ``thesis-reach`` and ``thesis-pick``
of the recipes, ``sorting-curves``, ``reach-curves`` and ``pick-curves`` of ours. Writes
``docs/img/recipes.png``: success and collisions over environment steps, updates and processor
time, a line per seed. A curve without a result file is left out. Writes also
``docs/img/reach/curves-thesis.png`` and ``docs/img/pick/curve-thesis.png``, return and rates of
the recipes like figures 4.4 and 5.3 of the thesis, and ``docs/img/reach/ablation.png``, success
of ``reach-ddpg-authors`` with one change at a time.
"""

from collections.abc import Sequence
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter, PercentFormatter
from numpy.typing import NDArray

from app.policies.configs import presets
from tools.arguments import parser_of
from tools.docs.reach.style import PURPLE, THESIS_SUCCESS
from tools.docs.results import IMAGES, RESULTS, Json, read_if_measured
from tools.docs.world.plots import BLUE, GREEN, GREY, ORANGE, RED, panels, save

IMAGE = IMAGES / "recipes.png"
AXES = (
    ("step", "environment steps"),
    ("updates", "updates"),
    ("cpu_min", "processor time [min]"),
)
PYTORCH = "PyTorch's initial weights"
"""Variant of the recipe of sorting."""
FOUR = "four attempts per update"
"""Another one."""
POOLED = 200
"""Least number of episodes behind a drawn point."""
ABLATED = "reach-ddpg-authors"
"""The recipe that is changed."""
CHANGES = MappingProxyType(
    {
        "exchanged learning rates": ORANGE,
        "observations not normalised": RED,
        "goals at random": GREEN,
        "contacts do not block": PURPLE,
        "an update per step": GREY,
    }
)
"""Colour of each variant of it, by the change."""
Grid = NDArray[np.float64]


class Row(NamedTuple):
    """Curves of one scenario."""

    title: str
    """Name of the scenario."""
    curves: tuple[tuple[str, str, str], ...]
    """File, name and colour of each training; the first one of a colour names it."""
    printed: tuple[tuple[str, float], ...]
    """Rates of the thesis."""


ROWS = (
    Row(
        "sorting, e0",
        (
            ("thesis-sorting", f"sorting-e0-thesis, {PYTORCH}", ORANGE),
            ("thesis-sorting", f"sorting-e0-thesis, {FOUR}", GREEN),
            ("thesis-sorting", f"sorting-e0-thesis, {FOUR}, until flat", GREEN),
            ("thesis-sorting", f"sorting-e0-thesis, {FOUR}, continued", GREEN),
            ("thesis-sorting", f"sorting-e0-thesis, {FOUR}, {PYTORCH}", RED),
            ("thesis-sorting", f"sorting-e0-thesis-informed, {FOUR}", PURPLE),
            ("sorting-curves", "sorting-e0-dqn", BLUE),
        ),
        (),
    ),
    Row(
        "sorting, e1",
        (
            ("thesis-sorting", f"sorting-e1-thesis, {FOUR}", GREEN),
            ("sorting-curves", "sorting-e1-dqn", BLUE),
        ),
        (),
    ),
    Row(
        "reach",
        (
            ("thesis-reach", "reach-ddpg-authors", ORANGE),
            ("thesis-reach", "reach-ddpg-authors, exchanged learning rates", GREEN),
            ("thesis-reach", "reach-ddpg-thesis", RED),
            ("reach-curves", "reach-td3", BLUE),
        ),
        (("success", THESIS_SUCCESS),),
    ),
    Row(
        "pick",
        (("thesis-pick", "pick-td3-thesis", ORANGE), ("pick-curves", "pick-td3", BLUE)),
        (("success", 0.75), ("collision", 0.25)),
    ),
)


def updates_at(name: str, step: int) -> int:
    """Return the updates of a preset until an environment step."""
    learning = presets.get(name.partition(",")[0]).learning
    each = getattr(learning, "gradient_steps", 1) / getattr(learning, "update_every", 1)
    return round(max(0, step - learning.learning_starts) / learning.n_envs * each)


def pooled(curve: Json) -> list[Json]:
    """Return the points of a curve, joined until each has ``POOLED`` episodes.

    Rates are means over the episodes; step, updates and time are those of the last point. A
    point without a number of episodes is kept as it is.
    """
    points: list[Json] = []
    waiting: list[Json] = []
    for one in curve["played"]:
        waiting.append(one)
        weights = [point.get("episodes", POOLED) for point in waiting]
        if sum(weights) < POOLED or any(point["success"] is None for point in waiting):
            waiting = [point for point in waiting if point["success"] is not None]
            continue
        rates = {
            end: float(np.average([point[end] for point in waiting], weights=weights))
            for end in ("success", "collision")
            if one.get(end) is not None
        }
        step = one["step"]
        done = one.get("updates", updates_at(curve["name"], step))
        points.append({"step": step, "updates": done, "cpu_min": one["cpu_s"] / 60.0, **rates})
        waiting = []
    return points


def curves_of(results: Path, file: str, name: str) -> list[Json]:
    """Return the curves of a preset in a result file, one per seed; empty without the file."""
    found = read_if_measured(results / f"{file}.json") or {"curves": []}
    return [one for one in found["curves"] if one["name"] == name]


def _columns(points: Sequence[Json], over: str, end: str) -> tuple[Grid, Grid]:
    kept = [(one[over], one[end]) for one in points if end in one and one[over] > 0]
    x, y = np.array(kept, dtype=np.float64).reshape(-1, 2).T
    return x, y


def recipes(results: Path) -> Figure:
    """Draw success (solid) and collisions (dashed) of all trainings, a line per seed."""
    figure, axes = panels(len(ROWS), len(AXES), 10.4, sharey=True)
    for row, views in zip(ROWS, axes, strict=True):
        for view, (over, label) in zip(views, AXES, strict=True):
            named = set()
            for file, name, colour in row.curves:
                for curve in curves_of(results, file, name):
                    points = pooled(curve)
                    shown = None if colour in named else name.replace(", ", ",\n")
                    named.add(colour)
                    view.plot(
                        *_columns(points, over, "success"), color=colour, lw=1.2, label=shown
                    )
                    view.plot(*_columns(points, over, "collision"), "--", color=colour, lw=0.9)
            for end, rate in row.printed:
                style = ":" if end == "success" else "-."
                view.axhline(rate, color=GREY, lw=0.9, ls=style, label=f"thesis: {end}")
            _rates_over(view, label)
        dashed = "; dashed: collisions" if row.printed else ""
        views[0].set_title(f"{row.title}: success{dashed}")
        lines = views[0].get_legend_handles_labels()
        if lines[0]:
            views[-1].legend(*lines, loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=7)
    return figure


def recorded(results: Path, file: str, names: Sequence[str], printed: float) -> Figure:
    """Draw return and rates over the steps, a row per recipe and a line per seed.

    Args:
        results: Folder of the result files.
        file: Name of the file with the curves.
        names: Names of the recipes in it.
        printed: Success in the thesis, 0 to 1.
    """
    figure, axes = panels(len(names), 2, 2.9 * len(names), sharex=True)
    for name, (left, right) in zip(names, axes, strict=True):
        for k, one in enumerate(curves_of(results, file, name)):
            steps = [point["step"] / 1e6 for point in one["played"]]
            left.plot(steps, [point["reward"] for point in one["played"]], color=BLUE, lw=1.0)
            left.axhline(one["standing_still"], color=GREY, lw=0.9, ls="--")
            for end, colour in (("timeout", ORANGE), ("collision", RED), ("success", GREEN)):
                rates = [100.0 * point[end] for point in one["played"]]
                right.plot(steps, rates, color=colour, lw=1.0, label=None if k else end)
        right.axhline(100.0 * printed, color=GREY, lw=0.9, ls="--")
        left.set_title(f"{name}: return; dashed: standing still", fontsize="medium")
        right.set_title("rates [%]; dashed: success in the thesis", fontsize="medium")
        right.set_ylim(-2.0, 102.0)
    lines = axes[0, 1].get_legend_handles_labels()
    figure.legend(*lines, loc="outside lower center", ncols=len(lines[0]))
    for view in axes[-1]:
        view.set(xlabel="environment steps [1e6]", xlim=(0.0, None))
    return figure


def ablation(results: Path) -> Figure:
    """Draw success of a recipe and its variants over environment steps and updates."""
    figure, axes = panels(1, 2, 3.4, sharey=True)
    for view, (over, label) in zip(axes[0], AXES[:2], strict=True):
        for change, colour in (("", BLUE), *CHANGES.items()):
            name = f"{ABLATED}, {change}" if change else ABLATED
            for k, curve in enumerate(curves_of(results, "thesis-reach", name)):
                shown = None if k else change or ABLATED
                points = _columns(pooled(curve), over, "success")
                view.plot(*points, color=colour, lw=1.2, label=shown)
        view.axhline(THESIS_SUCCESS, color=GREY, lw=0.9, ls=":", label="thesis")
        _rates_over(view, label)
    axes[0, 0].set_title("success, one change at a time")
    lines = axes[0, 0].get_legend_handles_labels()
    figure.legend(*lines, loc="outside lower center", ncols=4)
    return figure


def _rates_over(view: Axes, label: str) -> None:
    """Set the axes of rates over a logarithmic amount of training."""
    view.set(xscale="log", ylim=(-0.02, 1.02), xlabel=label)
    view.xaxis.set_major_formatter(FuncFormatter(_short))
    view.xaxis.set_minor_formatter(NullFormatter())
    view.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0, symbol=" %"))


def _short(value: float, _place: int) -> str:
    for factor, unit in ((1e6, " M"), (1e3, " k")):
        if value >= factor:
            return f"{value / factor:g}{unit}"
    return f"{value:g}"


def main() -> None:
    """Draw all pictures."""
    save(recipes, IMAGE, RESULTS)
    save(ablation, IMAGES / "reach/ablation.png", RESULTS)
    reach = ("reach-ddpg-authors", "reach-ddpg-thesis")
    for file, names, printed, image in (
        ("thesis-reach", reach, THESIS_SUCCESS, "reach/curves-thesis.png"),
        ("thesis-pick", ("pick-td3-thesis",), 0.75, "pick/curve-thesis.png"),
    ):
        save(recorded, IMAGES / image, RESULTS, file, names, printed)


if __name__ == "__main__":
    parser_of(__doc__).parse_args()
    main()
