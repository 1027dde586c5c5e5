"""Draw the pictures of ``docs/reach.md`` from ``docs/results/reach*.json``.

    python docs/reach_plots.py

Writes ``docs/img/reach/*.png``: heat maps of success and collisions over the targets at three
heights (the source's figs 4.5 and 4.6) and when episodes end; goals between targets; other
people and trackers; joints along an episode; learning curves. What has no result yet is not
drawn.
"""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Colormap, LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from docs.reach_tables import policy_of, siblings  # noqa: E402 - found by the line above
from docs.world_plots import BLUE, GREEN, GREY, ORANGE, RED, panels, save  # noqa: E402

RESULTS, IMAGES = ROOT / "docs/results", ROOT / "docs/img/reach"
PURPLE, INK = "#7c5aa6", "#374151"
SOURCE_SUCCESS = 0.9176
"""The source's success on its targets (METHOD 2.6)."""
FLOOR, CEILING = 0.90, 0.10
"""Success that has the warmest colour, or less; collisions that have it, or more."""
MISSES = LinearSegmentedColormap.from_list(
    "misses", ["#7f1d1d", "#d9622b", "#f3c567", "#dcebd8", "#9ccfb0"]
)
"""From many failures to none."""
HITS = LinearSegmentedColormap.from_list("hits", ["#f4f5f7", "#f3c567", "#d9622b", "#7f1d1d"])
"""From no collision to many."""
JOINTS = ("shoulder pan", "shoulder lift", "elbow", "wrist 1", "wrist 2", "wrist 3")
JOINT_COLOURS = (BLUE, ORANGE, GREEN, RED, PURPLE, GREY)
WAYS = {
    "direct": ("asked directly", BLUE, "o"),
    "interpolated": ("interpolated", ORANGE, "s"),
    "averaged": ("averaged", ORANGE, "s"),
    "set": ("seen as a set", PURPLE, "^"),
    "direct-ahead": ("asked directly, ahead", GREEN, "D"),
    "interpolated-ahead": ("interpolated, ahead", PURPLE, "^"),
}
"""Words, colour and mark of each way of asking a policy."""
PEOPLE = {"direct": "nearest seen", "direct-ahead": "... looking ahead"}
"""Words of two of them where there are several people."""
TRACKERS = {
    "exact": "exact state",
    "30hz": "30 Hz",
    "100ms": "30 Hz, 100 ms late",
    "100ms-noise": "... and 20 mm of noise",
    "200ms-noise": "200 ms late, 20 mm",
    "100ms-not-predicted": "100 ms late, not predicted",
    "30hz-ahead": "30 Hz, looking ahead",
    "100ms-noise-ahead": "100 ms late, 20 mm, ahead",
}
"""Rows of ``reach-tracker`` in words."""
PRESET_COLOURS = {"td3": BLUE, "thesis": ORANGE, "stock": GREY}
"""Colour of a learning curve by a part of its name; later ones win."""
Json = dict[str, Any]
Grid = NDArray[np.float64]


def read(name: str) -> Json | None:
    """Return a result, or None where there is none yet."""
    path = RESULTS / f"{name}.json"
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else None


def read_all(name: str) -> list[Json]:
    """Return a result and those of other checkpoints beside it."""
    first = read(name)
    return [] if first is None else [first, *siblings(RESULTS / f"{name}.json")]


def percent(axis: Any) -> None:
    """Label an axis in percent, with as many decimals as its ticks need."""
    axis.set_major_formatter(FuncFormatter(lambda value, _place: f"{100.0 * value:.4g} %"))


def bars(rates: Sequence[Json]) -> Grid:
    """Return the lengths of error bars below and above rates, shape (2, n)."""
    return np.array(
        [[one["mean"] - one["low"], one["high"] - one["mean"]] for one in rates]
    ).T.clip(0.0)


# Targets --------------------------------------------------------------------------------------


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
    """Draw how episodes end under each rule of starting, and when, under the first."""
    figure, axes = panels(1, 2, 3.1, width_ratios=(1.0, 1.15))
    left, right = axes[0]
    rows = result["results"][::-1]
    names = {"clearance": "0.05 m away", "uniform": "anywhere", "authors": "authors' code"}
    names |= {f"{name}-ahead": f"{words}, ahead" for name, words in names.items()}
    for k, row in enumerate(rows):
        start = 0.0
        for kind, colour in (("collision", RED), ("timeout", GREY)):
            value = row[kind]["mean"]
            left.barh(k, value, left=start, color=colour, height=0.55)
            start += value
        if contact := row["begun_in_contact"]["mean"]:
            left.plot([contact, contact], [k - 0.37, k + 0.37], color=INK, lw=2)
        left.text(start, k, f"  {100.0 * row['success']['mean']:.1f} % succeed", va="center")
    left.set_yticks(range(len(rows)), [names.get(row["name"], row["name"]) for row in rows])
    most = max(1.0 - row["success"]["mean"] for row in rows)
    left.set(xlim=(0.0, 1.6 * max(most, 1e-3)), title="What fails, by how people may start")
    left.grid(False, axis="y")
    left.tick_params(axis="y", length=0)
    percent(left.xaxis)
    handles = [left.barh(0, 0, color=RED), left.barh(0, 0, color=GREY)]
    handles += left.plot([], [], "|", color=INK, ms=9, mew=2)
    names_of = ["collision", "time-over", "begins in contact"]
    below = {"loc": "upper center", "bbox_to_anchor": (0.45, -0.1), "ncols": 3}
    left.legend(handles, names_of, fontsize=8, columnspacing=1.2, **below)
    _ends(right, result["results"][0])
    return figure


def _ends(axis: Axes, row: Json) -> None:
    ends, n = row["ends"], row["n"]
    step = ends[0]["until_s"]
    middle = [one["until_s"] - 0.5 * step for one in ends]
    for kind, colour, label in (
        ("success", GREEN, "at the goal"),
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
    axis.set(title="When episodes end", xlabel="time since the start [s]")
    axis.set(ylabel=f"of all episodes, per {step:g} s")
    axis.legend(loc="center right")
    percent(axis.yaxis)


# Goals between targets ------------------------------------------------------------------------


def ways_of(result: Json) -> dict[str, Json]:
    """Return the rows of random goals by way, in 5 s."""
    return {row["name"]: row for row in result["results"] if "between" in row}


def own_way(result: Json) -> str:
    """Return the way that a policy is made for, looking ahead where it can."""
    ways = list(ways_of(result))
    return ([way for way in ways if way.startswith("interpolated")] or ways)[-1]


def between_targets(results: Sequence[Json]) -> Figure:
    """Draw what goals between targets cost, by way and by how far off the grid they are.

    Of several policies the right half shows each by the way that it is made for.
    """
    several = len(results) > 1
    n_ways = sum(len(ways_of(result)) for result in results)
    figure, axes = panels(1, 2, max(3.3, 0.9 + 0.26 * n_ways), width_ratios=(1.0, 1.2))
    left, right = axes[0]
    labels: list[str] = []
    for number, result in enumerate(results):
        for way, row in ways_of(result).items():
            words, colour, mark = WAYS[way]
            if several:
                words = f"{policy_of(result)}, {words}"
                colour = (BLUE, ORANGE, GREEN, PURPLE, RED)[number % 5]
            k, gain = -len(labels), row["against_targets"]
            labels.append(words)
            left.plot([100.0 * gain["low"], 100.0 * gain["high"]], [k, k], color=colour, lw=2.0)
            left.plot(100.0 * gain["mean"], k, mark, color=colour, ms=6)
            if not several or way == own_way(result):
                _by_distance(right, row["between"], 2.5 * number, colour, mark, words)
    left.axvline(0.0, color=GREY, lw=1.0)
    left.axvline(-0.5, color=RED, lw=1.0, ls=":")
    left.set_yticks([-k for k in range(len(labels))], labels)
    title = f"{next(iter(ways_of(results[0]).values()))['n']} random goals less the targets"
    left.set(ylim=(0.6 - len(labels), 0.6), title=title)
    left.set(xlabel="success rate, points")
    left.grid(False, axis="y")
    right.set(title="... by how far they are from the grid", ylabel="success")
    right.set(xlabel="goal to the nearest target [mm]")
    percent(right.yaxis)
    if several:
        right.legend(loc="lower left")
    return figure


def _by_distance(
    axis: Axes, groups: Sequence[Json], aside: float, colour: str, mark: str, words: str
) -> None:
    """Draw success by the way to the nearest target, so far to the right [mm]."""
    rates = [one["success"] for one in groups]
    axis.errorbar(
        [500.0 * (one["low_m"] + one["high_m"]) + aside for one in groups],
        [rate["mean"] for rate in rates],
        bars(rates),
        fmt=f"{mark}-",
        color=colour,
        ms=4.5,
        elinewidth=0.9,
        label=words,
    )


# Other people ---------------------------------------------------------------------------------


def others(people: Sequence[Json], speeds: Json | None, trackers: Json | None) -> Figure:
    """Draw several people, fast and slow ones, and people seen through a tracker."""
    there = [
        (draw, one)
        for draw, one in ((_people, people), (_speeds, speeds), (_trackers, trackers))
        if one
    ]
    figure, axes = panels(1, len(there), 3.2, width_ratios=[1.15, 0.8, 1.25][: len(there)])
    for axis, (draw, one) in zip(axes[0], there, strict=True):
        draw(axis, one)
    return figure


def _people(axis: Axes, results: Sequence[Json]) -> None:
    shown = [
        (*WAYS[how][1:], PEOPLE.get(how, WAYS[how][0]), _by_people(results[0], how))
        for how in dict.fromkeys(
            one["asked"] for one in results[0]["settings"]["rows"].values()
        )
    ]
    for other in results[1:]:  # asked in one way only: what it sees is another question
        words, colour, mark = WAYS.get(other["label"], (other["label"], INK, "v"))
        shown.append((colour, mark, words, _by_people(other, "direct")))
    for k, (colour, mark, words, own) in enumerate(shown):
        axis.errorbar(
            [n + 0.06 * (k - 0.5 * (len(shown) - 1)) for n, _ in own],
            [rate["mean"] for _, rate in own],
            bars([rate for _, rate in own]),
            fmt=f"{mark}-",
            color=colour,
            ms=4.5,
            elinewidth=0.9,
            label=words,
        )
    axis.set(title="Several people", xlabel="people in the cell", ylabel="success")
    axis.xaxis.set_major_locator(FixedLocator(range(5)))
    percent(axis.yaxis)
    axis.set_ylim(bottom=axis.get_ylim()[0] - 0.04)  # room for the legend
    axis.legend(loc="lower left", fontsize=8)


def _by_people(result: Json, how: str) -> list[tuple[int, Json]]:
    """Return how many people there are and the success beside them, asked in one way."""
    asked = result["settings"]["rows"]
    return [
        (len(asked[row["name"]]["people"]), row["success"])
        for row in result["results"]
        if asked[row["name"]]["asked"] == how or _for_all(asked[row["name"]], how)
    ]


def _for_all(row: Json, how: str) -> bool:
    """Tell whether a row stands for a way that differs only beside more people."""
    n = len(row["people"])
    return n == 0 or (n == 1 and row["asked"] == "direct" and not how.endswith("-ahead"))


def _speeds(axis: Axes, result: Json) -> None:
    asked, rows = result["settings"]["rows"], result["results"]
    speeds = list(dict.fromkeys(one["speed_m_s"] for one in asked.values()))
    ahead = [row["name"].endswith("-ahead") for row in rows]
    shift, width = (0.2, 0.36) if any(ahead) else (0.0, 0.6)
    for row, looks in zip(rows, ahead, strict=True):
        x = speeds.index(asked[row["name"]]["speed_m_s"]) + (shift if looks else -shift)
        collision, timeout = row["collision"]["mean"], row["timeout"]["mean"]
        axis.bar(x, collision, color=RED, width=width)
        axis.bar(x, timeout, bottom=collision, color=GREY, width=width)
        text = f"{100.0 * row['success']['mean']:.1f}"
        axis.text(x, collision + timeout, text, ha="center", va="bottom", fontsize="small")
    most = max(1.0 - row["success"]["mean"] for row in rows)
    axis.set_xticks(range(len(speeds)), [f"{speed:g}" for speed in speeds])
    words = "[m/s]; right: looking ahead" if any(ahead) else "[m/s]"
    axis.set(title="Their speed", xlabel=words, ylim=(0.0, 1.2 * max(most, 1e-3)))
    axis.grid(False, axis="x")
    axis.tick_params(axis="x", length=0)
    percent(axis.yaxis)


def _trackers(axis: Axes, result: Json) -> None:
    rows = result["results"]
    for k, row in enumerate(rows):
        axis.barh(-k, row["collision"]["mean"], color=RED, height=0.6)
        axis.barh(-k, row["timeout"]["mean"], left=row["collision"]["mean"], color=GREY,
                  height=0.6)  # fmt: skip
        fails = 1.0 - row["success"]["mean"]
        axis.text(fails, -k, f" {100.0 * row['success']['mean']:.1f} %", va="center")
    axis.set_yticks(
        [-k for k in range(len(rows))], [TRACKERS.get(row["name"], row["name"]) for row in rows]
    )
    most = max(1.0 - row["success"]["mean"] for row in rows)
    axis.set(
        title="Seen through a tracker",
        xlabel="collision, time-over",
        xlim=(0.0, 1.35 * max(most, 1e-3)),
    )
    axis.grid(False, axis="y")
    axis.tick_params(axis="y", length=0)
    percent(axis.xaxis)


# Smoothness -----------------------------------------------------------------------------------


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
    for axis, limit in ((axes[1], row["speed_limit_rad_s"]),
                        (axes[2], row["acceleration_limit_rad_s2"])):  # fmt: skip
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


# Learning curves ------------------------------------------------------------------------------


def colour_of(name: str) -> str:
    """Return the colour of a preset's curves."""
    return [PURPLE, *(colour for part, colour in PRESET_COLOURS.items() if part in name)][-1]


def curves(found: Sequence[Json]) -> Figure:
    """Draw success and collisions of trainings over the CPU time they took."""
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
            told = label if kind == "success" else None
            rates = [point[kind] for point in points]
            axis.plot(minutes, rates, color=colour, lw=1.1, alpha=0.85, label=told)
    left.axhline(SOURCE_SUCCESS, color=RED, lw=0.9, ls=":")
    left.text(0.98, SOURCE_SUCCESS - 0.01, "the source, after 47 h", color=RED, va="top",
              ha="right", transform=left.get_yaxis_transform())  # fmt: skip
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


def main() -> None:
    """Draw what there are results of."""
    if targets := read("reach-targets"):
        save(heat_maps, IMAGES / "targets.png", targets)
        save(start_rules, IMAGES / "starts.png", targets)
    if randoms := read_all("reach-random"):
        save(between_targets, IMAGES / "between.png", randoms)
    three = read_all("reach-people"), read("reach-speeds"), read("reach-tracker")
    if any(three):
        save(others, IMAGES / "others.png", *three)
    smooth = {
        one["settings"]["action"]["degree"]: one
        for one in reversed(read_all("reach-smoothness"))
        if one["example"]
    }
    if smooth:
        save(smoothness, IMAGES / "smoothness.png", [smooth[k] for k in sorted(smooth)])
    if trained := read("reach_curves"):
        save(curves, IMAGES / "curves.png", trained["curves"])


if __name__ == "__main__":
    main()
