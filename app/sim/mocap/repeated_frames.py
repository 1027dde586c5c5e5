"""Removal of repeated frames from motion written at a higher rate than recorded.

A recording at 30 Hz written at 120 Hz repeats each frame four times, which makes speeds zero
three times and four times too high once. Repeated frames are found by the regular interval of
changes, which may be fractional (24 Hz at 60 Hz: 2, 3, 2, 3).
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from app.sim.mocap.bvh import Bvh, check_dt

MIN_CHANGES = 20
"""Least number of changes from which a rate is found."""
MIN_STEP = 1.15
"""Least interval of changes [frames]; lower ones are due to single dropped frames."""
MAX_IRREGULAR = 0.05
"""Largest share of changes off the regular interval."""
Frames = NDArray[np.signedinteger]


def without_repeats(bvh: Bvh) -> tuple[Bvh, str]:
    """Return a recording without repeated frames, and a note; as it is, and "", if none repeat.

    Raises:
        BadRecording: The real rate is outside the range of motion capture.
    """
    changes = np.flatnonzero((np.diff(bvh.values, axis=0) != 0.0).any(axis=1)) + 1
    if len(changes) < MIN_CHANGES:
        return bvh, ""
    n = len(bvh.values)
    found = _whole_step(changes, n) or _fractional_step(changes, n)
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
    """Return the interval between new frames and their numbers; None unless it is whole.

    Motionless people repeat frames too, so the interval of changes may be a multiple.

    Args:
        changes: Frames that differ from the previous one, increasing.
        n: Number of frames in the file.
    """
    step = int(np.bincount(np.diff(changes)).argmax())
    first = int(changes[0])
    if step < 2 or ((changes - first) % step != 0).mean() > MAX_IRREGULAR:
        return None
    start = first - step * -(-first // step)  # before the file where its first group is cut
    return float(step), np.arange(start, n, step).clip(min=0)


def _fractional_step(changes: Frames, n: int) -> tuple[float, Frames] | None:
    """Return the interval between new frames and their numbers, by a line through them.

    None where they are not evenly spaced, or hardly any repeat. People at rest repeat frames
    before, between and after the changes; these are kept at the same interval.

    Args:
        changes: Frames that differ from the previous one, increasing.
        n: Number of frames in the file.
    """
    gaps = np.diff(changes)
    moving = gaps <= 2.0 * np.median(gaps)
    passed = np.where(moving, 1, np.rint(gaps / gaps[moving].mean()).astype(np.int64))
    count = np.concatenate([[0], np.cumsum(passed)])
    step, start = np.polyfit(count, changes, 1)
    if step < MIN_STEP or np.ptp(changes - start - step * count) > 1.1:
        return None
    before, after = (
        1 + max(0, round((span - math.ceil(step)) / step))
        for span in (int(changes[0]), n - int(changes[-1]))
    )
    kept = np.rint(start + step * np.arange(-before, count[-1] + after)).astype(np.int64)
    kept[before + count] = changes
    return float(step), kept.clip(0, n - 1)
