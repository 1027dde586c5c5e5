"""Measure the import of recorded motion and draw the error along one clip.

    python -m tools.docs.recording_plots FILE.bvh ...

Writes ``docs/results/recordings.json``, one row per file (table of ``docs/recordings.md``),
and ``docs/img/motions/error.png``. The picture shows the file with artefacts that keeps most
clean frames: speeds of the recorded points, removed frames with their reason, and the distance
between model and recorded points. The recordings are not part of this repository.
"""

import argparse
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.mocap.artifacts import MAX_SPEED, Artifact, clean_runs, find_artifacts
from app.sim.mocap.bvh import read_bvh
from app.sim.mocap.importer import ImportedMotion, Spread, read_motion
from app.sim.mocap.inverse_kinematics import body_angles
from app.sim.mocap.joint_centres import (
    ELBOW_L,
    ELBOW_R,
    PELVIS,
    WRIST_L,
    WRIST_R,
    measure,
    model_points,
)
from app.sim.mocap.skeletons import body_track
from tools.docs.results import IMAGES, RESULTS, Json, write_result
from tools.docs.world.plots import BLUE, GREEN, GREY, ORANGE, RED, panels, save

RESULT, IMAGE = RESULTS / "recordings.json", IMAGES / "motions/error.png"
WRISTS = {"right wrist": (WRIST_R, BLUE), "left wrist": (WRIST_L, ORANGE)}
POINTS = {"pelvis": (PELVIS, GREEN), **WRISTS}
LABELS = {
    "pelvis": "pelvis",
    "elbow_r": "right elbow",
    "wrist_r": "right wrist",
    "elbow_l": "left elbow",
    "wrist_l": "left wrist",
    "time": "no frame,",
}
"""Labels of the monitored points."""
NEIGHBOURS = 0.12
"""Artefacts closer than this share of the file share a label."""
TIMINGS = 3
"""Imports of each file; the fastest counts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClipErrors:
    """Speeds and errors along a file; NaN in removed frames."""

    name: str
    """Name of the file."""
    times: Vec
    """From 0 [s], shape (n,)."""
    speeds: dict[str, Vec]
    """Speeds of recorded points [m/s], shape (n - 1,) each."""
    errors: dict[str, Vec]
    """Distances between model points and recorded points [mm], shape (n,) each."""
    fixed: Vec
    """Error of the farther wrist with constant pelvis height [mm], shape (n,)."""
    artifacts: tuple[Artifact, ...]
    """Artefacts in temporal order."""
    dropped: tuple[tuple[float, float], ...]
    """Removed spans between artefacts [s]."""


def clip_errors(path: Path) -> ClipErrors:
    """Return speeds and errors of the import of a BVH file along its frames."""
    track, _ = body_track(read_bvh(path.read_text(encoding="utf-8-sig")))
    size, n = measure(track.points), len(track.times)
    artifacts = find_artifacts(track.times, track.points)
    spans = clean_runs(track.times, artifacts)
    q, height = np.full((n, 18), np.nan), np.full(n, np.nan)
    for first, last in spans:
        part = slice(first, last + 1)
        hips = None if track.hips is None else track.hips[part]
        run = replace(track, times=track.times[part], points=track.points[part], hips=hips)
        q[part], height[part] = body_angles(run, size)
    away = np.linalg.norm(model_points(q, height, size) - track.points, axis=2)
    standing = np.where(np.isnan(height), np.nan, np.nanpercentile(height, 95.0))
    level = np.linalg.norm(model_points(q, standing, size) - track.points, axis=2)
    steps = np.linalg.norm(np.diff(track.points, axis=0), axis=2)
    times = track.times - track.times[0]
    return ClipErrors(
        name=name_of(path),
        times=times,
        speeds={name: steps[:, k] / np.diff(times) for name, (k, _) in POINTS.items()},
        errors={
            **{name: 1e3 * away[:, k] for name, (k, _) in POINTS.items()},
            "elbows": 1e3 * away[:, [ELBOW_R, ELBOW_L]].max(axis=1),
        },
        fixed=1e3 * level[:, [WRIST_R, WRIST_L]].max(axis=1),
        artifacts=artifacts,
        dropped=_dropped(times, artifacts, spans),
    )


def _dropped(
    times: Vec, artifacts: tuple[Artifact, ...], spans: tuple[tuple[int, int], ...]
) -> tuple[tuple[float, float], ...]:
    """Return the removed spans between artefacts [s]."""
    gone: NDArray[np.bool_] = np.ones(len(times), dtype=bool)
    for first, last in spans:
        gone[first : last + 1] = False
    for one in artifacts:
        gone[one.first : one.last + 1] = False
    edges = np.flatnonzero(np.diff(np.concatenate([[False], gone, [False]]).astype(int)))
    ends = edges.reshape(-1, 2) - np.array([0, 1])
    return tuple((float(times[a]), float(times[b])) for a, b in ends)


def name_of(path: Path) -> str:
    """Return folder and name of a file; clips are often numbered."""
    return f"{path.parent.name}/{path.stem}"


def row(path: Path) -> Json:
    """Import a file and return its row of the table."""
    content = path.read_bytes()
    seconds = []
    for _ in range(TIMINGS):
        started = time.process_time()
        found = read_motion(content, path.name)
        seconds.append(time.process_time() - started)
    return {
        "name": name_of(path),
        "frames": found.n_frames,
        "clean": found.n_clean,
        "runs": len(found.runs),
        "artifacts": _artifacts(found),
        "import_s": round(min(seconds), 3),
        "wrists_p50_p99_worst_mm": _spread(found.wrists, 2),
        "at_one_height_mm": _spread(found.wrists_at_fixed_height, 0),
        "pelvis_mm": _spread(found.pelvis, 0),
        "simulator_person_mm": _spread(found.fixed_body, 0),
    }


def _artifacts(found: ImportedMotion) -> str:
    if not found.artifacts:
        return "0"
    fastest = max(found.artifacts, key=lambda one: one.speed)
    return f"{len(found.artifacts)} (`{fastest.parts[0]}` {fastest.speed:.1f} m/s)"


def _spread(found: Spread, digits: int) -> str:
    shown = (f"{1e3 * value:.{digits}f}" for value in (found.p50, found.p99, found.worst))
    return ", ".join(shown)


def draw(found: ClipErrors) -> Figure:
    """Draw speeds, artefacts and errors along a file."""
    figure, axes = panels(3, 1, 6.6, sharex=True, height_ratios=(1.0, 1.1, 1.0))
    speed, error, rest = axes[:, 0]
    _draw_speeds(speed, found)
    for name, (_, colour) in WRISTS.items():
        error.plot(found.times, found.errors[name], color=colour, lw=1.0)
    wrists = np.nanmax([found.errors[name] for name in WRISTS])
    error.set(ylabel="error [mm]", ylim=(0.0, max(10.0, 1.1 * wrists)))
    elbows = np.nanmax(found.errors["elbows"])
    accuracy = "within 0.001 mm" if elbows < 1e-3 else f"within {elbows:.2g} mm"
    error.set_title(f"Distance of model wrists and recorded wrists; elbows {accuracy}")
    rest.plot(
        found.times,
        found.fixed,
        color=GREY,
        lw=1.2,
        label="wrists with constant pelvis height",
    )
    pelvis = found.errors["pelvis"]
    rest.plot(found.times, pelvis, color=GREEN, lw=1.2, label="pelvis")
    rest.set(
        xlim=(0.0, found.times[-1]),
        ylim=(0.0, 1.35 * np.nanmax([found.fixed, pelvis])),
        xlabel="time in the file [s]",
        ylabel="error [mm]",
    )
    rest.set_title("Pelvis, and wrists with constant pelvis height")
    rest.legend(loc="upper left", ncols=2, frameon=True, framealpha=1.0, edgecolor="none")
    for axis in (speed, error, rest):
        _shade(axis, found)
    return figure


def _draw_speeds(axis: Axes, found: ClipErrors) -> None:
    middles = 0.5 * (found.times[1:] + found.times[:-1])
    for name, (_, colour) in POINTS.items():
        axis.plot(middles, found.speeds[name], color=colour, lw=1.0, label=name)
    axis.axhline(MAX_SPEED, color=RED, lw=0.9, ls="--", label=f"{MAX_SPEED:g} m/s")
    axis.set(ylabel="recorded speed [m/s]", ylim=(0.0, None))
    axis.set_title(f"{found.name}: removed frames", pad=18)
    axis.legend(loc="upper right", ncols=4, bbox_to_anchor=(1.0, 1.36))
    _label_artifacts(axis, found)


def _shade(axis: Axes, found: ClipErrors) -> None:
    for first, last in found.dropped:
        axis.axvspan(first, last, color=RED, alpha=0.10, lw=0, zorder=0)
    for one in found.artifacts:
        first, last = found.times[one.first], found.times[one.last]
        axis.axvspan(first, last, color=RED, alpha=0.22, lw=0, zorder=0)


def _label_artifacts(axis: Axes, found: ClipErrors) -> None:
    """Label artefacts with point and speed; neighbours share a label."""
    groups: list[list[Artifact]] = []
    for one in found.artifacts:
        near = NEIGHBOURS * found.times[-1]
        if groups and found.times[one.first] - found.times[groups[-1][-1].last] < near:
            groups[-1].append(one)
        else:
            groups.append([one])
    for group in groups:
        axis.annotate(
            ", ".join(f"{LABELS[one.parts[0]]} {one.speed:.1f}" for one in group) + " m/s",
            (float(found.times[[group[0].first, group[-1].last]].mean()), 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(0, 3),
            textcoords="offset points",
            ha="center",
            fontsize=8,
            color=RED,
        )


def shown_of(found: list[ClipErrors]) -> ClipErrors:
    """Return the clip to draw: with artefacts, and with most clean frames."""
    return max(found, key=lambda one: (bool(one.artifacts), int(np.isfinite(one.fixed).sum())))


def main() -> None:
    """Measure, write and draw."""
    parser = argparse.ArgumentParser(description="Measure imports of recorded motion.")
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE.bvh")
    files = parser.parse_args().files
    result = {
        "command": "python -m tools.docs.recording_plots FILE ...",
        "results": [row(path) for path in files],
    }
    write_result(RESULT, result)
    save(draw, IMAGE, shown_of([clip_errors(path) for path in files]))


if __name__ == "__main__":
    main()
