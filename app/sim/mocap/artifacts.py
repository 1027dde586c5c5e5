"""Detection of motion-capture artefacts by speed, and the clean runs between them.

A marker that is lost and found, or confused with another, jumps. Hips, forearms and hands of
people at work stay below 3 m/s (clean hands of the TUM clips reach 2.7 m/s): faster motion
between two frames is an artefact, and so is a gap in the time column.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.mocap.joint_centres import TRACK_NAMES

MAX_SPEED = 3.0
"""Largest credible speed of hips, forearms and hands [m/s]."""
JUMP_SPEED = 10.0
"""Speed from which an artefact is called a jump [m/s]."""
MARGIN = 0.05
"""Time removed on either side of an artefact [s], where markers degrade."""
MIN_RUN = 1.0
"""Shortest clean run [s]."""
MAX_GAP = 0.1
"""Longest time between two frames [s], or three times the usual one where that is longer."""

WATCHED = ("pelvis", "elbow_r", "wrist_r", "elbow_l", "wrist_l")
"""Points whose speed is checked: hips, forearms and hands."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Artifact:
    """A removed span of frames and its reason."""

    first: int
    """First frame, counted from 0."""
    last: int
    """Last frame."""
    parts: tuple[str, ...]
    """Points that are too fast, the fastest first; ``("time",)`` for a gap; columns without a
    value."""
    speed: float
    """Highest speed [m/s]; 0 for gaps and missing values."""
    reason: str
    """Text such as ``"wrist_r at 41.2 m/s: jumps"``."""


def find_artifacts(times: Vec, points: Vec) -> tuple[Artifact, ...]:
    """Return all artefacts in order of time; those closer than two margins are merged.

    Args:
        times: Increasing times [s], shape (n,).
        points: Joint centres [m], shape (n, 8, 3), order of TRACK_NAMES.
    """
    dt = np.diff(times)
    watched = points[:, [TRACK_NAMES.index(name) for name in WATCHED]]
    speeds = np.linalg.norm(np.diff(watched, axis=0), axis=2) / dt[:, None]
    holes = dt > max(MAX_GAP, 3.0 * float(np.median(dt)))
    bad = np.flatnonzero((speeds > MAX_SPEED).any(axis=1) | holes)
    if not bad.size:
        return ()
    split_at = np.flatnonzero(np.diff(times[bad]) > 2.0 * MARGIN) + 1
    return tuple(_artifact(group, speeds, holes, dt) for group in np.split(bad, split_at))


def clean_runs(times: Vec, artifacts: Sequence[Artifact]) -> tuple[tuple[int, int], ...]:
    """Return first and last frame of each run without artefacts of at least MIN_RUN.

    Args:
        times: Increasing times [s], shape (n,).
        artifacts: From :func:`find_artifacts`.
    """
    good = np.ones(len(times), dtype=bool)
    margin = MARGIN + 0.5e-9  # with a tolerance that makes the result independent of rounding
    firsts = times[[one.first for one in artifacts]] - margin
    lasts = times[[one.last for one in artifacts]] + margin
    begins, ends = np.searchsorted(times, firsts), np.searchsorted(times, lasts, side="right")
    for begin, end in zip(begins, ends, strict=True):
        good[begin:end] = False
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(int)))
    runs = edges.reshape(-1, 2) - np.array([0, 1])
    return tuple((int(a), int(b)) for a, b in runs if times[b] - times[a] >= MIN_RUN)


def merged(
    found: Sequence[Artifact], missing: Sequence[Artifact], frames: NDArray[np.int64]
) -> tuple[Artifact, ...]:
    """Return all artefacts in order, with frame numbers of the file.

    Args:
        found: From :func:`find_artifacts`, on the complete rows.
        missing: Frames without a value; they replace the gaps that they cause.
        frames: Frame number in the file of each row, shape (n,).
    """
    in_file = [
        replace(one, first=int(frames[one.first]), last=int(frames[one.last])) for one in found
    ]
    firsts = np.sort([one.first for one in missing])
    begins = np.searchsorted(firsts, [one.first for one in in_file], side="right")
    ends = np.searchsorted(firsts, [one.last for one in in_file])
    kept = [
        one
        for one, begin, end in zip(in_file, begins, ends, strict=True)
        if one.parts != ("time",) or begin >= end
    ]
    return tuple(sorted([*kept, *missing], key=lambda one: (one.first, one.last)))


def _artifact(
    steps: NDArray[np.signedinteger], speeds: Vec, holes: NDArray[np.bool_], dt: Vec
) -> Artifact:
    first, last = int(steps[0]), int(steps[-1]) + 1
    peaks = speeds[steps].max(axis=0)
    order = [int(k) for k in np.argsort(-peaks) if peaks[k] > MAX_SPEED]
    if not order:
        gap = float(dt[steps][holes[steps]].max())
        reason = f"{gap:.2f} s without a frame"
        return Artifact(first=first, last=last, parts=("time",), speed=0.0, reason=reason)
    speed = float(peaks[order[0]])
    what = "jumps" if speed > JUMP_SPEED else f"faster than {MAX_SPEED:g} m/s"
    parts = tuple(WATCHED[k] for k in order)
    reason = f"{parts[0]} at {speed:.1f} m/s: {what}"
    return Artifact(first=first, last=last, parts=parts, speed=speed, reason=reason)
