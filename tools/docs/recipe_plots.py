"""Draw the trainings of each recipe of the thesis beside ours.

    python -m tools.docs.recipe_plots

Reads the curves in ``docs/results``: ``thesis-sorting``, ``thesis-reach`` and ``thesis-pick``
of the recipes, ``sorting-curves``, ``reach-curves`` and ``pick-curves`` of ours. Writes
``docs/img/recipes.png``: success and collisions over environment steps, updates and processor
time, a line per seed. A curve without a result file is left out.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter, PercentFormatter
from numpy.typing import NDArray

from app.policies.configs import presets
from tools.arguments import parser_of
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
Grid = NDArray[np.float64]


class Row(NamedTuple):
    """Curves of one scenario."""

    title: str
    """Name of the scenario."""
    curves: tuple[tuple[str, str, str], ...]
    """File, name and colour of each training."""
    printed: tuple[tuple[str, float], ...]
    """Rates of the thesis."""


ROWS = (
    Row(
        "sorting, e0",
        (
            ("thesis-sorting", f"sorting-e0-thesis, {PYTORCH}", ORANGE),
            ("thesis-sorting", f"sorting-e0-thesis, {FOUR}", GREEN),
            ("thesis-sorting", f"sorting-e0-thesis, {FOUR}, continued", GREEN),
            ("thesis-sorting", f"sorting-e0-thesis, {FOUR}, {PYTORCH}", RED),
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
        (("success", 0.9176),),
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
            for file, name, colour in row.curves:
                for k, curve in enumerate(curves_of(results, file, name)):
                    points = pooled(curve)
                    shown = name.replace(", ", ",\n") if k == 0 else None
                    view.plot(
                        *_columns(points, over, "success"), color=colour, lw=1.2, label=shown
                    )
                    view.plot(*_columns(points, over, "collision"), "--", color=colour, lw=0.9)
            for end, rate in row.printed:
                view.axhline(rate, color=GREY, lw=0.9, ls=":" if end == "success" else "-.")
            view.set(xscale="log", ylim=(-0.02, 1.02), xlabel=label)
            view.xaxis.set_major_formatter(FuncFormatter(_short))
            view.xaxis.set_minor_formatter(NullFormatter())
            view.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0, symbol=" %"))
        dashed = "; dashed: collisions" if row.printed else ""
        views[0].set_title(f"{row.title}: success{dashed}")
        lines = views[0].get_legend_handles_labels()
        if lines[0]:
            views[-1].legend(*lines, loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=7)
    return figure


def _short(value: float, _place: int) -> str:
    for factor, unit in ((1e6, " M"), (1e3, " k")):
        if value >= factor:
            return f"{value / factor:g}{unit}"
    return f"{value:g}"


def main() -> None:
    """Draw the picture."""
    save(recipes, IMAGE, RESULTS)


if __name__ == "__main__":
    parser_of(__doc__).parse_args()
    main()
