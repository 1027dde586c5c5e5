"""Measure and draw the task primitives; write their section of ``docs/people.md``.

    python -m tools.docs.people_plots          measure, draw and write
    python -m tools.docs.people_plots --page   write the section only, from ``docs/results``

Writes ``docs/results/task-primitives.json``, ``docs/img/people/*.png`` and the section between
the markers ``task-primitives``. Seeded; takes about 15 s.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from app.sim.cells.cell import Cell, load_cell
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.human.anthropometry import percentile_body
from app.sim.primitives.keyframes import STYLES, draw_keyframe
from app.sim.primitives.library_file import FILE, load_primitives, read_header
from app.sim.primitives.primitive_library import MotionLibrary, motion_library
from tests.sim.library_motions import SegmentMotion, random_segment, random_segments
from tools.demonstrations import PHASES, between
from tools.docs.results import IMAGES, RESULTS, ROOT, Json, read_result, write_result
from tools.docs.world.plots import BLUE, GREEN, GREY, LIGHT, ORANGE, panels, save

SEED, LEGS = 11, 4000
DRAWN = 10
"""Segments drawn per primitive and direction."""
PICTURES = IMAGES / "people"
PAGE = ROOT / "docs/people.md"
BEGIN, END = "<!-- begin task-primitives -->\n", "<!-- end task-primitives -->"
KINDS = {"home-cube": (1, 6), "home-dock": (1, 2), "cube-dock": (2, 6)}
"""Rows of panel pairs (top and side view) and columns, per kind of segment."""
BONES = (
    ("pelvis", "neck", "head"),
    ("neck", "shoulder_r", "elbow_r", "wrist_r", "hand_r"),
    ("neck", "shoulder_l", "elbow_l", "wrist_l", "hand_l"),
)


def measure(cell: Cell, library: MotionLibrary) -> Json:
    """Return statistics of random segments between random keyframes, and the primitives."""
    segments = random_segments(cell, library, LEGS, SEED)
    rng = np.random.default_rng(SEED)
    ratios = [segment.path / max(segment.straight, 0.05) for segment in segments]
    swings = [segment.swing for segment in segments]
    paces = [_farther(segment) / _duration(library, segment, rng) for segment in segments]
    rows = [
        {
            "kind": one.segment.kind,
            "start": one.segment.start,
            "end": one.segment.end,
            "hand": one.segment.hand,
            "demonstrations": len(one.durations),
            "duration_s": float(np.exp(np.log(one.durations).mean())),
            "duration_log_sd": float(np.log(one.durations).std(ddof=1)),
        }
        for one in load_primitives()
    ]
    return {
        "page": "people",
        "seed": SEED,
        "file_mb": FILE.stat().st_size / 1e6,
        "legs": LEGS,
        "people": len(library.bodies),
        "nodes": len(library.keyframes.postures),
        "end_miss_m": max(segment.end_miss for segment in segments),
        "beyond_share": float(np.mean([segment.beyond > 1e-3 for segment in segments])),
        "lowest_m": min(segment.lowest for segment in segments),
        "path_ratio": np.percentile(ratios, [50, 99, 100]).tolist(),
        "swing_rad": np.percentile(swings, [50, 99, 100]).tolist(),
        "pace_m_s": np.percentile(paces, [5, 50, 95]).tolist(),
        "pace_log_sd": float(np.log(paces).std()),
        "gain_max": float(np.abs(library.gain).max()),
        "primitives": rows,
        "header": {key: value for key, value in read_header().items() if key != "tasks"},
    }


def _farther(segment: SegmentMotion) -> float:
    return float(np.linalg.norm(segment.keyframes[1] - segment.keyframes[0], axis=1).max())


def _duration(
    library: MotionLibrary, segment: SegmentMotion, rng: np.random.Generator
) -> float:
    mean, spread = library.duration[library.segments[segment.segment][0]]
    return float(np.exp(mean + spread * rng.standard_normal()))


def draw_kind(cell: Cell, library: MotionLibrary, kind: str) -> Figure:
    """Draw palm paths of all primitives of a kind, from above and from the side."""
    pairs: dict[tuple[str, str], None] = {}
    for one in load_primitives():
        if one.segment.kind == kind:
            pairs[one.segment.start, one.segment.end] = None
    blocks, columns = KINDS[kind]
    side = 0 if kind == "cube-dock" else 1
    figure, axes = panels(2 * blocks, columns, 3.9 * blocks, sharex=False, sharey="row")
    rng = np.random.default_rng(SEED)
    order = {station.id: i for i, station in enumerate(cell.pick_stations)}
    order["home"] = len(order)
    for k, (start, end) in enumerate(pairs):
        block, column = divmod(k, columns)
        top, below = axes[2 * block, column], axes[2 * block + 1, column]
        for hand, colour in enumerate((BLUE, ORANGE)):
            for a, b in ((start, end), (end, start)):
                indices = order[a], order[b], hand
                for _ in range(DRAWN // 2):
                    palm = random_segment(cell, library, indices, rng).palms[:, hand]
                    top.plot(palm[:, 0], palm[:, 1], color=colour, lw=0.6, alpha=0.7)
                    below.plot(palm[:, side], palm[:, 2], color=colour, lw=0.6, alpha=0.7)
        _above(top, cell, f"{start} – {end}")
        _beside(below, cell, side)
        if column == 0:
            top.set_ylabel("y [m]")
            below.set_ylabel("z [m]")
    return figure


def _above(axis: Axes, cell: Cell, title: str) -> None:
    table = cell.table
    axis.add_patch(Rectangle((table.x_min, 0.3), 2.0, table.y_max - 0.3, color=LIGHT, zorder=0))
    for station in cell.pick_stations:
        colour = GREY if station.kind == "cube" else GREEN
        axis.plot(*station.position[:2], "s", ms=3, color=colour, zorder=1)
    axis.set(xlim=(-0.85, 0.85), ylim=(0.3, 1.5), aspect="equal", xlabel="x [m]")
    axis.set_title(title, fontsize=9)


def _beside(axis: Axes, cell: Cell, side: int) -> None:
    low, high = (-0.85, 0.85) if side == 0 else (0.3, 1.5)
    edge = high if side == 0 else cell.table.y_max
    top = Rectangle((low, -cell.table.thickness), edge - low, cell.table.thickness, color=LIGHT)
    axis.add_patch(top)
    axis.set(xlim=(low, high), ylim=(-0.1, 0.45), xlabel="xy"[side] + " [m]")


def draw_styles(cell: Cell) -> Figure:
    """Draw one demonstration per style as stick figures, side view."""
    size = percentile_body(pelvis=cell.human.pelvis_height).vector(cell.floor_z)
    target, rng = np.array(cell.station("cube2").position), np.random.default_rng(SEED)
    figure, axes = panels(1, len(STYLES), 2.3, sharey=True)
    for axis, style in zip(axes[0], STYLES, strict=True):
        first = draw_keyframe(cell, size, None, "r", rng, style)
        q, _ = between(
            size, first, draw_keyframe(cell, size, target, "r", rng, style), style, rng
        )
        for k, colour in zip((0, len(PHASES) // 2, -1), ("#c5cad1", GREY, BLUE), strict=True):
            _stick(axis, human.joint_points(q[k], size), colour)
        palm = np.array([human.joint_points(row, size)["hand_r"] for row in q])
        axis.plot(palm[:, 1], palm[:, 2], color=ORANGE, lw=1.2)
        axis.plot(target[1], target[2], "s", ms=4, color=GREEN)
        edge, thick = cell.table.y_max, cell.table.thickness
        axis.add_patch(Rectangle((0.4, -thick), edge - 0.4, thick, color=LIGHT))
        axis.set(xlim=(0.5, 1.75), ylim=(-0.15, 1.0), aspect="equal", xlabel="y [m]")
        axis.set_title(style.name, fontsize=9)
    axes[0, 0].set_ylabel("z [m]")
    return figure


def _stick(axis: Axes, points: dict[str, Vec], colour: str) -> None:
    for bone in BONES:
        line = np.array([points[name] for name in bone])
        axis.plot(line[:, 1], line[:, 2], color=colour, lw=1.6, solid_capstyle="round")


def section(found: Json) -> str:
    """Return the section, from the JSON results only."""
    header, ratio, swing, pace = (
        found[key] for key in ("header", "path_ratio", "swing_rad", "pace_m_s")
    )
    rows = {(one["start"], one["end"], one["hand"]): one for one in found["primitives"]}
    pairs = dict.fromkeys((one["start"], one["end"]) for one in found["primitives"])
    lines = ["| segment | right hand [s] | left hand [s] |", "| --- | ---: | ---: |"]
    for start, end in pairs:
        cells = [_spread(rows[start, end, hand]) for hand in human.HANDS]
        lines.append(f"| {start} – {end} | {cells[0]} | {cells[1]} |")
    low, high = header["percentiles"]["stature"]
    return f"""\
{len(found["primitives"])} primitives, each from {header["demonstrations"]} demonstrations in \
{len(header["styles"])} styles ({", ".join(header["styles"])}) by people of the \
{low:.0f}th to {high:.0f}th percentile of stature, arms and shoulders; seed {header["seed"]}, \
{found["file_mb"]:.1f} MB.

Measured on {found["legs"]:,} random segments between random keyframe postures of \
{found["people"]} people ({found["nodes"]:,} postures; seed {found["seed"]}):

| measure | value |
| --- | ---: |
| distance of palms to their keyframe positions at both ends, maximum [mm] | \
{1e3 * found["end_miss_m"]:.2g} |
| segments beyond a joint limit by more than 1 mrad (clamped) [%] | \
{100.0 * found["beyond_share"]:.2g} |
| lowest palm, wrist or elbow above the table [mm] | {1e3 * found["lowest_m"]:.0f} |
| path length of the working palm / straight distance: median, p99, maximum | \
{ratio[0]:.2f}, {ratio[1]:.2f}, {ratio[2]:.2f} |
| joint angle beyond the range of both ends: median, p99, maximum [rad] | \
{swing[0]:.2f}, {swing[1]:.2f}, {swing[2]:.2f} |
| mean speed of the farther palm: p5, median, p95 [m/s] | \
{pace[0]:.2f}, {pace[1]:.2f}, {pace[2]:.2f} |
| largest entry of a gain G ([method](method.md#34-human-model-and-motion)) | \
{found["gain_max"]:.2f} |

Duration of a segment: median of the demonstrations and range of one standard deviation of the
logarithm; equal in both directions.

{chr(10).join(lines)}

"""


def _spread(one: Json) -> str:
    middle, factor = one["duration_s"], np.exp(one["duration_log_sd"])
    return f"{middle:.2f} ({middle / factor:.2f}–{middle * factor:.2f})"


def page(text: str, results: Path = RESULTS) -> str:
    """Return the text of a page with the section replaced."""
    found = read_result(results / "task-primitives.json")
    before, rest = text.split(BEGIN)
    return before + BEGIN + section(found) + END + rest.split(END)[1]


def main() -> None:
    """Measure, draw and write."""
    parser = argparse.ArgumentParser(description="Write the task primitives' section.")
    parser.add_argument("--page", action="store_true", help="measure and draw nothing")
    if not parser.parse_args().page:
        cell = load_cell()
        library = motion_library(cell, 0)
        write_result(RESULTS / "task-primitives.json", measure(cell, library))
        for kind in KINDS:
            save(draw_kind, PICTURES / f"{kind}.png", cell, library, kind)
        save(draw_styles, PICTURES / "styles.png", cell)
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
