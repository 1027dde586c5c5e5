"""Artifacts of motion capture: found by speed, cut out, the clean runs between them kept.

A marker that is lost and found again, or taken for another, leaps. Hands, forearms and hips of
people at work stay below 3 m/s (clean hands of the TUM clips reach 2.7 m/s): whatever is faster
between two frames is an artifact, and so is a hole in the time column.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.mocap.joint_centres import TRACK_NAMES

MAX_SPEED = 3.0
"""Fastest that hips, forearms and hands move [m/s]."""
JUMP_SPEED = 10.0
"""A point faster than this has jumped [m/s]: no hand at work does that."""
MARGIN = 0.05
"""Cut away on either side of an artifact [s]: markers are bad before they are lost."""
MIN_RUN = 1.0
"""Shortest run that is kept [s]."""
MAX_GAP = 0.1
"""Longest time between two frames [s]."""

WATCHED = ("pelvis", "elbow_r", "wrist_r", "elbow_l", "wrist_l")
"""The points whose speed is watched: hips, forearms and hands."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Artifact:
    """Frames that are cut out, and why."""

    first: int
    """First frame of the fault, counted from 0."""
    last: int
    """Last frame of the fault."""
    parts: tuple[str, ...]
    """Points that were too fast, the fastest first; ``("time",)`` for a hole in the times;
    columns that lack a value."""
    speed: float
    """Highest speed [m/s]; 0 for a hole in the times and for missing values."""
    reason: str
    """One sentence part: ``"wrist_r at 41.2 m/s: jumps"``."""


def find_artifacts(times: Vec, points: Vec) -> tuple[Artifact, ...]:
    """Return all artifacts in the order of time; those closer than two margins are one.

    Args:
        times: Rising [s], shape (n,).
        points: Joint centres [m], shape (n, 8, 3), order of TRACK_NAMES.
    """
    dt = np.diff(times)
    watched = points[:, [TRACK_NAMES.index(name) for name in WATCHED]]
    speeds = np.linalg.norm(np.diff(watched, axis=0), axis=2) / dt[:, None]
    holes = dt > max(MAX_GAP, 3.0 * float(np.median(dt)))
    bad = np.flatnonzero((speeds > MAX_SPEED).any(axis=1) | holes)
    if not bad.size:
        return ()
    parted = np.flatnonzero(np.diff(times[bad]) > 2.0 * MARGIN) + 1
    return tuple(_artifact(group, speeds, holes, dt) for group in np.split(bad, parted))


def clean_runs(times: Vec, artifacts: Sequence[Artifact]) -> tuple[tuple[int, int], ...]:
    """Return first and last frame of every run without artifacts, at least MIN_RUN long.

    Args:
        times: Rising [s], shape (n,).
        artifacts: From :func:`find_artifacts`.
    """
    good = np.ones(len(times), dtype=bool)
    for one in artifacts:
        after, before = times - times[one.first], times[one.last] - times
        # Half a nanosecond more, so that rounding does not decide about a frame.
        good[(np.minimum(after, before)) >= -(MARGIN + 0.5e-9)] = False
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(int)))
    runs = edges.reshape(-1, 2) - np.array([0, 1])
    return tuple((int(a), int(b)) for a, b in runs if times[b] - times[a] >= MIN_RUN)


def merged(
    found: Sequence[Artifact], missing: Sequence[Artifact], frames: NDArray[np.int64]
) -> tuple[Artifact, ...]:
    """Return all artifacts in frames of the file, in their order.

    Args:
        found: From :func:`find_artifacts`, in rows that have all values.
        missing: Frames that lack a value; the holes that they leave are told by them.
        frames: Frame of the file that each row is, shape (n,).
    """
    in_file = [
        replace(one, first=int(frames[one.first]), last=int(frames[one.last])) for one in found
    ]
    firsts = np.array([one.first for one in missing])
    told = [
        one
        for one in in_file
        if one.parts != ("time",) or not ((one.first < firsts) & (firsts < one.last)).any()
    ]
    return tuple(sorted([*told, *missing], key=lambda one: (one.first, one.last)))


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
