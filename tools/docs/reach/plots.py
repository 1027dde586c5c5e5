"""Draw the pictures of ``docs/results/reach.md`` from ``docs/results/reach*.json``.

    python -m tools.docs.reach.plots

Writes ``docs/img/reach/*.png``: four walks (thesis fig. 4.1), heat maps of success and
collisions over the targets at three heights (fig. 4.5 and 4.6), episode durations, goals
between targets, other people and trackers, joint trajectories of an episode, and learning
curves. Pictures without results are skipped.
"""

from collections.abc import Sequence
from itertools import count, islice
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Colormap, LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from app.sim.people.kernels.pedestrian import WALKING
from app.sim.people.pedestrian import PedestrianSettings
from tools.arguments import parser_of
from tools.docs.reach.other_plots import curves, others, smoothness
from tools.docs.reach.style import INK, MODES, PURPLE, draw_rates, percent
from tools.docs.reach.tables import policy_of, siblings
from tools.docs.results import IMAGES, RESULTS, Json, read_if_measured
from tools.docs.world.plots import BLUE, GREEN, GREY, MISSES, ORANGE, RED, panels, save
from tools.docs.world.walks import Walk, walk

PICTURES = IMAGES / "reach"
FLOOR, CEILING = 0.90, 0.10
"""Success at and below which, and collisions at and above which, the colour saturates."""
HITS = LinearSegmentedColormap.from_list("hits", ["#f4f5f7", "#f3c567", "#d9622b", "#7f1d1d"])
"""From no collision to many."""


def read(name: str) -> Json | None:
    """Return a result, or None if it does not exist."""
    return read_if_measured(RESULTS / f"{name}.json")


def read_all(name: str) -> list[Json]:
    """Return a result and those of other checkpoints."""
    first = read(name)
    return [] if first is None else [first, *siblings(RESULTS / f"{name}.json")]


def heat_maps(result: Json) -> Figure:
    """Draw success and collisions of each target, one panel per height."""
    row = result["results"][0]
    heights = sorted({cell["height_m"] for cell in row["targets"]})
    figure, axes = panels(2, len(heights), 3.7, sharex=True, sharey=True)
    kinds: tuple[tuple[str, Colormap, Normalize], ...] = (
        ("success", MISSES, Normalize(FLOOR, 1.0)),
        ("collision", HITS, Normalize(0.0, CEILING)),
    )
    for line, (kind, colours, norm) in enumerate(kinds):
        for column, height in enumerate(heights):
            cells = [cell for cell in row["targets"] if cell["height_m"] == height]
            image = _layer(axes[line, column], cells, kind, colours, norm)
            mean = np.mean([cell[kind]["mean"] for cell in cells])
            axes[line, column].set_title(f"z = {height:.1f} m: {100.0 * mean:.1f} %")
        axes[line, 0].set_ylabel(f"{'success' if kind == 'success' else 'collisions'}\ny [m]")
        bar = figure.colorbar(
            image,
            ax=list(axes[line]),
            extend="min" if kind == "success" else "max",
            aspect=14,
            shrink=0.9,
        )
        bar.outline.set_visible(False)
        percent(bar.ax.yaxis)
    for axis in axes[1]:
        axis.set_xlabel("x [m]")
    return figure


def _layer(
    axis: Axes, cells: Sequence[Json], kind: str, colours: Colormap, norm: Normalize
) -> Any:
    """Draw the targets of one height as squares with their rates in percent."""
    xs = sorted({cell["goal"][0] for cell in cells})
    ys = sorted({cell["goal"][1] for cell in cells})
    grid = np.full((len(ys), len(xs)), np.nan)
    for cell in cells:
        x, y, _ = cell["goal"]
        value = cell[kind]["mean"]
        grid[ys.index(y), xs.index(x)] = value
        red, green, blue, _ = colours(norm(value))
        dark = 0.3 * red + 0.6 * green + 0.1 * blue < 0.55
        axis.text(
            x,
            y,
            f"{100.0 * value:.0f}",
            ha="center",
            va="center",
            fontsize=8,
            color="white" if dark else "#1f2937",
        )
    half = 0.5 * (xs[1] - xs[0])
    edges = [np.append(np.array(one) - half, one[-1] + half) for one in (xs, ys)]
    image = axis.pcolormesh(*edges, grid, cmap=colours, norm=norm, ec="white", lw=1.2)
    axis.set(aspect="equal", xticks=xs, yticks=ys)
    axis.grid(False)
    axis.tick_params(length=0)
    for spine in axis.spines.values():
        spine.set_visible(False)
    return image


def start_rules(result: Json) -> Figure:
    """Draw outcomes under each start rule, and durations of episodes under the first."""
    figure, axes = panels(1, 2, 3.1, width_ratios=(1.0, 1.15))
    left, right = axes[0]
    rows = result["results"][::-1]
    names = {"clearance": "0.05 m away", "uniform": "anywhere", "authors": "authors' code"}
    names |= {f"{name}-rollout": f"{words}, rollout" for name, words in names.items()}
    for k, row in enumerate(rows):
        start = 0.0
        for kind, colour in (("collision", RED), ("timeout", GREY)):
            value = row[kind]["mean"]
            left.barh(k, value, left=start, color=colour, height=0.55)
            start += value
        if contact := row["initial_contact"]["mean"]:
            left.plot([contact, contact], [k - 0.37, k + 0.37], color=INK, lw=2)
        left.text(start, k, f"  {100.0 * row['success']['mean']:.1f} % success", va="center")
    left.set_yticks(range(len(rows)), [names.get(row["name"], row["name"]) for row in rows])
    most = max(1.0 - row["success"]["mean"] for row in rows)
    left.set(xlim=(0.0, 1.6 * max(most, 1e-3)), title="Failures by start rule of people")
    left.grid(False, axis="y")
    left.tick_params(axis="y", length=0)
    percent(left.xaxis)
    handles = [left.barh(0, 0, color=RED), left.barh(0, 0, color=GREY)]
    handles += left.plot([], [], "|", color=INK, ms=9, mew=2)
    names_of = ["collision", "timeout", "initial contact"]
    below = {"loc": "upper center", "bbox_to_anchor": (0.45, -0.1), "ncols": 3}
    left.legend(handles, names_of, fontsize=8, columnspacing=1.2, **below)
    _ends(right, result["results"][0])
    return figure


def _ends(axis: Axes, row: Json) -> None:
    ends, n = row["ends"], row["n"]
    step = ends[0]["until_s"]
    middle = [one["until_s"] - 0.5 * step for one in ends]
    for kind, colour, label in (
        ("success", GREEN, "success"),
        ("collision", RED, "collision"),
    ):
        shares = [one[kind] / n for one in ends]
        axis.bar(middle, shares, width=step, color=colour, label=label)
    mean, p95 = row["time_to_goal_s"], row["time_to_goal_p95_s"]
    if mean is not None:
        axis.axvline(mean, color=INK, lw=1.0)
        axis.axvline(p95, color=INK, lw=1.0, ls=":")
        top = 1.12 * axis.get_ylim()[1]
        axis.set_ylim(0.0, top)
        axis.text(mean, 0.98 * top, f"mean {mean:.2f} s ", va="top", ha="right", color=INK)
        axis.text(p95, 0.98 * top, f" 95 % within {p95:.2f} s", va="top", color=INK)
    axis.set(title="Duration of episodes", xlabel="time since the start [s]")
    axis.set(ylabel=f"share of episodes per {step:g} s")
    axis.legend(loc="center right")
    percent(axis.yaxis)


def modes_of(result: Json) -> dict[str, Json]:
    """Return the rows of random goals within 5 s, by inference mode."""
    return {row["name"]: row for row in result["results"] if "between" in row}


def own_mode(result: Json) -> str:
    """Return the inference mode that a policy was trained for, without rollout."""
    modes = [mode for mode in modes_of(result) if not mode.endswith("-rollout")]
    return ([mode for mode in modes if mode.startswith("interpolated")] or modes)[-1]


def between_targets(results: Sequence[Json]) -> Figure:
    """Draw success on goals between targets, by inference mode and by distance to the grid.

    Of several policies, the right panel shows each in the mode it was trained for, without
    rollout.
    """
    several = len(results) > 1
    n_modes = sum(len(modes_of(result)) for result in results)
    figure, axes = panels(1, 2, max(3.3, 0.9 + 0.26 * n_modes), width_ratios=(1.0, 1.2))
    left, right = axes[0]
    labels: list[str] = []
    for number, result in enumerate(results):
        for mode, row in modes_of(result).items():
            words, colour, mark = MODES[mode]
            if several:
                words = f"{policy_of(result)}, {words}"
                colour = (BLUE, ORANGE, GREEN, PURPLE, RED)[number % 5]
            k, gain = -len(labels), row["against_targets"]
            labels.append(words)
            left.plot([100.0 * gain["low"], 100.0 * gain["high"]], [k, k], color=colour, lw=2.0)
            left.plot(100.0 * gain["mean"], k, mark, color=colour, ms=6)
            if not several or mode == own_mode(result):
                groups, aside = row["between"], 2.5 * number
                x = [500.0 * (one["low_m"] + one["high_m"]) + aside for one in groups]
                rates = [one["success"] for one in groups]
                draw_rates(right, x, rates, (words, colour, mark))
    left.axvline(0.0, color=GREY, lw=1.0)
    left.axvline(-0.5, color=RED, lw=1.0, ls=":")
    left.set_yticks([-k for k in range(len(labels))], labels)
    title = f"{next(iter(modes_of(results[0]).values()))['n']} random goals minus targets"
    left.set(ylim=(0.6 - len(labels), 0.6), title=title)
    left.set(xlabel="success rate, points")
    left.grid(False, axis="y")
    right.set(title="By distance to the grid", ylabel="success")
    right.set(xlabel="goal to the nearest target [mm]")
    percent(right.yaxis)
    if several:
        figure.legend(*right.get_legend_handles_labels(), loc="outside lower right", ncols=3)
    return figure


def walks(four: Sequence[Walk], rules: PedestrianSettings) -> Figure:
    """Draw walks of the human occupancy model, seen from above, as in thesis fig. 4.1."""
    figure, axes = panels(2, 2, 5.6, sharex=True, sharey=True)
    for axis, one in zip(axes.ravel(), four, strict=True):
        for (x, y), radius in zip(one.position[::5], one.radius[::5], strict=True):
            axis.add_patch(Circle((x, y), radius, fc="#dbe7f5", lw=0))
        corner, size = (rules.x_min, rules.y_min), (rules.x_max, rules.y_max)
        width, depth = size[0] - corner[0], size[1] - corner[1]
        axis.add_patch(Rectangle(corner, width, depth, fill=False, ec=RED, ls="--"))
        seen = axis.scatter(*one.position[::10].T, c=one.time[::10], s=9, cmap="viridis")
        axis.plot(0.0, 0.0, "s", color=INK, ms=7)
        axis.set(aspect="equal", xlim=(-2.6, 1.6), ylim=(-0.2, 2.6))
    for axis in axes[1]:
        axis.set_xlabel("x [m]")
    for axis in axes[:, 0]:
        axis.set_ylabel("y [m]")
    figure.colorbar(seen, ax=axes, label="time [s]", shrink=0.7).outline.set_visible(False)
    return figure


def four_walks() -> tuple[list[Walk], PedestrianSettings]:
    """Return the first four walks of seed 11 in which nobody stays, and their rules."""
    rules = PedestrianSettings()
    every = (walk(rules, 11, 15.0, episode=k) for k in count())
    return list(islice((one for one in every if (one.gait == WALKING).all()), 4)), rules


def main() -> None:
    """Draw the pictures of all existing results."""
    save(walks, PICTURES / "walks.png", *four_walks())
    if targets := read("reach-targets"):
        save(heat_maps, PICTURES / "targets.png", targets)
        save(start_rules, PICTURES / "starts.png", targets)
    if randoms := read_all("reach-random"):
        save(between_targets, PICTURES / "between.png", randoms)
    three = read_all("reach-people"), read("reach-speeds"), read("reach-tracker")
    if any(three):
        save(others, PICTURES / "others.png", *three)
    smooth = {
        one["settings"]["action"]["degree"]: one
        for one in reversed(read_all("reach-smoothness"))
        if one["example"]
    }
    if smooth:
        save(smoothness, PICTURES / "smoothness.png", [smooth[k] for k in sorted(smooth)])
    if trained := read("reach-curves"):
        save(curves, PICTURES / "curves.png", trained["curves"])


if __name__ == "__main__":
    parser_of(__doc__).parse_args()
    main()
