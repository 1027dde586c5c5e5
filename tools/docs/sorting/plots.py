"""Draw the pictures of ``docs/results/sorting.md`` from ``docs/results/sorting-*.json``.

    python -m tools.docs.sorting.plots

Writes ``docs/img/sorting/grid-e0.png`` and ``grid-e1.png``, heat maps of success and return
over all pairs (K_E, K_G) as in thesis fig. 3.2, and ``curves-e0.png`` and ``curves-e1.png``,
learning curves as in thesis fig. 3.1, also of its recipe (``thesis-sorting.json``). Pictures
without results are skipped.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import Colormap, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter, PercentFormatter
from numpy.typing import NDArray

from tools.arguments import parser_of
from tools.docs.results import IMAGES, RESULTS, Json, read_if_measured
from tools.docs.world.plots import BLUE, GREEN, GREY, MISSES, ORANGE, RED, panels, save

PICTURES = IMAGES / "sorting"
TASKS = ("e0", "e1")
STARTS = ("clean", "disturbed")
"""Rows of the result to draw."""
FLOOR = 0.95
"""Success at and below which the colour saturates."""
COLOURS = {"dqn": BLUE, "pure": GREEN, "thesis": ORANGE, "stock": GREY}
"""Colour of a curve by a part of its name; later entries take precedence."""
Grid = NDArray[np.float64]


def grids(row: Json) -> tuple[Grid, Grid]:
    """Return success and return of a row by (K_G - 1, K_E - 1); NaN without a pair."""
    size = max(one["n_objects"] for one in row["pairs"])
    success, returns = np.full((size, size), np.nan), np.full((size, size), np.nan)
    for one in row["pairs"]:
        place = one["n_goal"] - 1, one["n_objects"] - 1
        success[place], returns[place] = one["success"]["mean"], one["return"]
    return success, returns


def heat_maps(result: Json) -> Figure:
    """Draw success and return of the policy without fallback, clean and disturbed."""
    rows = {row["name"]: row for row in result["results"]}
    found = {name: grids(rows[name]) for name in STARTS}
    returns = np.stack([both[1] for both in found.values()])
    spread = Normalize(float(np.nanmin(returns)), float(np.nanmax(returns)))
    figure, axes = panels(2, 2, 8.4)
    for k, name in enumerate(STARTS):
        starts, mean = f"{name.capitalize()} starts", 100.0 * rows[name]["success"]["mean"]
        maps = (
            (f"{starts}: success {mean:.2f} %", MISSES, Normalize(FLOOR, 1.0)),
            (f"{starts}: return", colormaps["cividis"], spread),
        )
        for column, (title, colours, norm) in enumerate(maps):
            image = _heat_map(axes[k, column], found[name][column], colours, norm)
            axes[k, column].set_title(title)
            if k == 1:
                where = {"ax": list(axes[:, column]), "location": "bottom", "shrink": 0.8}
                _scale(figure, image, column == 0, where)
        _name_misses(axes[k, 0], found[name][0])
    return figure


def _heat_map(axis: Axes, grid: Grid, colours: Colormap, norm: Normalize) -> Any:
    size = len(grid)
    edges = np.arange(size + 1) + 0.5
    image = axis.pcolormesh(edges, edges, grid, cmap=colours, norm=norm, ec="white", lw=0.6)
    ticks = [1, *range(5, size + 1, 5)]
    axis.set(xlabel="objects, $K_E$", ylabel="of these in the goal, $K_G$", aspect="equal")
    axis.set(xticks=ticks, yticks=ticks)
    axis.grid(False)
    return image


def _scale(figure: Figure, image: Any, success: bool, where: Json) -> None:
    """Draw the colour scale of a column."""
    bar = figure.colorbar(image, extend="min" if success else "neither", aspect=30, **where)
    bar.set_label("success rate" if success else "mean return per episode, undiscounted")
    bar.outline.set_visible(False)
    if success:
        bar.ax.xaxis.set_major_formatter(PercentFormatter(1.0, decimals=0, symbol=" %"))


def _name_misses(axis: Axes, grid: Grid) -> None:
    """Write the success rate of pairs with failures into their squares."""
    small = len(grid) > 10
    for k_g, k_e in zip(*np.nonzero(grid < 1.0), strict=True):
        value = grid[k_g, k_e]
        axis.text(
            k_e + 1,
            k_g + 1,
            f"{np.floor(1000.0 * value + 1e-6) / 10.0:.1f}",
            ha="center",
            va="center",
            fontsize=4.6 if small else 7.5,
            color="white" if value < 0.5 * (1.0 + FLOOR) - 0.01 else "#1f2937",
        )
    perfect, pairs = int((grid == 1.0).sum()), int(np.isfinite(grid).sum())
    axis.text(
        0.03,
        0.97,
        f"{perfect} of {pairs} pairs\nwithout a failure",
        transform=axis.transAxes,
        va="top",
        color="#374151",
    )


def colour_of(name: str) -> str:
    """Return the colour of a curve by its name."""
    return [colour for part, colour in COLOURS.items() if part in name][-1]


def curves(found: Sequence[Json]) -> Figure:
    """Draw success over steps and over CPU time, and returns over steps, of one task."""
    figure, axes = panels(1, 3, 3.9, width_ratios=(1.0, 1.0, 1.0))
    steps, seconds, rewards = axes[0]
    named: set[str] = set()
    for one in found:
        colour = colour_of(one["name"])
        label = None if one["name"] in named else one["name"]
        named.add(one["name"])
        _success(steps, one, "step", colour, label)
        _success(seconds, one, "cpu_s", colour, None)
        _returns(rewards, one, colour)
    for axis in (steps, seconds):
        axis.axhline(0.9, color=RED, lw=0.8, ls=":")
        axis.set(ylim=(0.0, 1.02))
        axis.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0, symbol=" %"))
    steps.set(xscale="log", xlabel="environment steps", title="Success over steps")
    seconds.set(
        xscale="log", xlabel="CPU time of the training [s]", title="Success over CPU time"
    )
    rewards.set(xscale="log", xlabel="environment steps", title="Return per episode")
    seconds.xaxis.set_major_formatter(FuncFormatter(lambda value, _place: f"{value:,.0f}"))
    for axis in (steps, rewards):
        axis.xaxis.set_major_formatter(FuncFormatter(_short))
        axis.xaxis.set_minor_formatter(NullFormatter())
    figure.legend(loc="outside lower center", ncols=min(4, len(named)))
    return figure


def _short(value: float, _place: int) -> str:
    return f"{value / 1e6:g} M" if value >= 1e6 else f"{value / 1e3:g} k"


def _success(axis: Axes, one: Json, over: str, colour: str, label: str | None) -> None:
    played, pairs = one["played"], one["pairs"]
    x, y = _columns(played, over, "success")
    axis.plot(x, y, color=colour, lw=1.0, alpha=0.55 if pairs else 0.9)
    x, y = _columns(pairs, over, "success")
    axis.plot(x, y, "o-", color=colour, ms=3.0, lw=1.4, label=label)


def _returns(axis: Axes, one: Json, colour: str) -> None:
    if not one["pairs"]:
        axis.plot(*_columns(one["played"], "step", "mean_return"), color=colour, lw=1.0)
        return
    x, mean = _columns(one["pairs"], "step", "mean_return")
    _, spread = _columns(one["pairs"], "step", "return_sd")
    axis.fill_between(x, mean - spread, mean + spread, color=colour, alpha=0.14, lw=0)
    axis.plot(x, mean, "o-", color=colour, ms=3.0, lw=1.4)


def _columns(points: Sequence[Json], x: str, y: str) -> tuple[Grid, Grid]:
    kept = [one for one in points if one.get(x) is not None and one.get(y) is not None]
    return np.array([float(one[x]) for one in kept]), np.array([float(one[y]) for one in kept])


def recipes(result: Json, task: str) -> list[Json]:
    """Return the thesis' recipe with four attempts per update in the form of :func:`curves`.

    Args:
        result: Result file ``thesis-sorting``.
        task: e0 or e1.
    """
    return [
        {
            **one,
            "played": [{**point, "mean_return": point["reward"]} for point in one["played"]],
            "pairs": [],
        }
        for one in result["curves"]
        if one["name"] == f"sorting-{task}-thesis, four attempts per update"
    ]


def main() -> None:
    """Draw the pictures of all existing results."""
    for task in TASKS:
        if result := read_if_measured(RESULTS / f"sorting-grid-{task}.json"):
            save(heat_maps, PICTURES / f"grid-{task}.png", result)
    trained = read_if_measured(RESULTS / "sorting-curves.json") or {"curves": []}
    thesis = read_if_measured(RESULTS / "thesis-sorting.json") or {"curves": []}
    for task in TASKS:
        ours = [one for one in trained["curves"] if one["task"] == f"sorting-{task}"]
        of_task = [*ours, *recipes(thesis, task)]
        if of_task:
            save(curves, PICTURES / f"curves-{task}.png", of_task)


if __name__ == "__main__":
    parser_of(__doc__).parse_args()
    main()
