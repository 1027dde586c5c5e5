"""Motion that was written at a higher rate than recorded, by repeating frames.

A recording at 30 Hz that is written at 120 Hz shows every frame four times: the speed between
two frames is then zero three times and four times too high once. Such frames are found by the
regular distance of the changes, which need not be a whole number (24 Hz at 60 Hz: 2, 3, 2, 3).
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from app.sim.mocap.bvh import Bvh, check_dt

MIN_CHANGES = 20
"""Fewest changes of the channels from which a rate is found."""
MIN_STEP = 1.15
"""Least distance of the changes [frames]; below, single frames repeat where a camera hung."""
MAX_STRAY = 0.05
"""Share of the changes that may lie off the regular distance."""
Frames = NDArray[np.signedinteger]


def without_repeats(bvh: Bvh) -> tuple[Bvh, str]:
    """Return a file at its real rate, and a sentence about it; empty where none repeats.

    Raises:
        BadRecording: The real rate is none of motion capture.
    """
    changes = np.flatnonzero((np.diff(bvh.values, axis=0) != 0.0).any(axis=1)) + 1
    if len(changes) < MIN_CHANGES:
        return bvh, ""
    found = _whole_step(changes, len(bvh.values)) or _fractional_step(changes)
    if found is None:
        return bvh, ""
    step, kept = found
    dt = check_dt(step * bvh.dt, "frames repeat, and the time between those that do not")
    note = (
        f"frames repeat, real rate {1.0 / dt:.4g} Hz (written at {1.0 / bvh.dt:.4g} Hz): "
        f"{len(bvh.values)} frames are read, and counted, as {len(kept)} at the real rate"
    )
    return replace(bvh, dt=dt, values=bvh.values[kept]), note


def _whole_step(changes: Frames, n: int) -> tuple[float, Frames] | None:
    """Return the distance of new frames and the new frames, where it is a whole number.

    A person who stands still repeats frames too, so the distance of the changes is a multiple.

    Args:
        changes: Frames that differ from the one before, rising.
        n: Frames of the file.
    """
    step = int(np.bincount(np.diff(changes)).argmax())
    first = int(changes[0])
    if step < 2 or ((changes - first) % step != 0).mean() > MAX_STRAY:
        return None
    start = first - step * -(-first // step)  # before the file where its first group is cut
    return float(step), np.arange(start, n, step).clip(min=0)


def _fractional_step(changes: Frames) -> tuple[float, Frames] | None:
    """Return the same where the distance is no whole number: changes lie along a line."""
    count = np.arange(len(changes))
    step, start = np.polyfit(count, changes, 1)
    if step < MIN_STEP or np.ptp(changes - start - step * count) > 1.1:
        return None
    return float(step), np.concatenate([[0], changes])
