from dataclasses import replace

import numpy as np
import pytest

from app.errors import BadRecording
from app.sim.mocap.bvh import Bvh, read_bvh
from app.sim.mocap.importer import read_motion
from app.sim.mocap.repeated_frames import without_repeats
from tests.sim.recorded_person import bvh_text, working

CLIP = read_bvh(bvh_text(working(100, dt=1 / 30), dt=1 / 30))


def rewritten(rate_hz: float, first: int = 0, recorded: Bvh = CLIP) -> Bvh:
    """The clip at a higher rate: of each frame the newest of the recording."""
    n = round(len(recorded.values) * recorded.dt * rate_hz)
    newest = np.floor(np.arange(n) / (rate_hz * recorded.dt) + 1e-9).astype(int)
    return replace(recorded, dt=1.0 / rate_hz, values=recorded.values[newest[first:]])


@pytest.mark.parametrize("rate_hz", [60.0, 90.0, 120.0, 240.0, 75.0, 100.0, 50.0, 40.0])
def test_frames_that_repeat_are_read_at_the_real_rate(rate_hz: float) -> None:
    found, message = without_repeats(rewritten(rate_hz))
    assert 1.0 / found.dt == pytest.approx(30.0, rel=1e-2)
    np.testing.assert_array_equal(found.values, CLIP.values)
    assert message.startswith("frames repeat, real rate 30")
    assert f"written at {rate_hz:g} Hz" in message


@pytest.mark.parametrize("first", [1, 2, 3])
def test_file_may_begin_between_two_frames(first: int) -> None:
    found, _ = without_repeats(rewritten(120.0, first))
    assert found.dt == pytest.approx(1.0 / 30.0)
    np.testing.assert_array_equal(found.values, CLIP.values)


def test_person_who_stands_still_repeats_frames_too() -> None:
    values = CLIP.values.copy()
    values[20:35], values[60:63], values[:5] = values[20], values[60], values[5]
    still = replace(CLIP, values=values)
    found, _ = without_repeats(rewritten(120.0, recorded=still))
    np.testing.assert_array_equal(found.values, values)
    assert without_repeats(still) == (still, "")


@pytest.mark.parametrize("rate_hz", [50.0, 75.0, 100.0])
def test_person_at_rest_before_between_and_after_keeps_the_time(rate_hz: float) -> None:
    rest, pause = [0] * 60, [49] * 45
    frames = [*rest, *range(50), *pause, *range(50, 100), *[99] * 60]
    long = replace(CLIP, values=CLIP.values[frames])
    found, message = without_repeats(rewritten(rate_hz, recorded=long))
    assert 1.0 / found.dt == pytest.approx(30.0, rel=1e-2) and message
    assert abs(len(found.values) - len(long.values)) <= 3
    moved = np.flatnonzero((np.diff(found.values, axis=0) != 0.0).any(axis=1))
    assert len(moved) == 99


def test_camera_that_hung_now_and_then_is_no_other_rate() -> None:
    values = CLIP.values.copy()
    for k in (7, 8, 31, 50, 51, 77):
        values[k] = values[k - 1]
    hung = replace(CLIP, values=values)
    assert without_repeats(hung) == (hung, "")


def test_sound_recording_is_left_as_it_is() -> None:
    assert without_repeats(CLIP) == (CLIP, "")


def test_real_rate_that_is_no_rate_of_motion_capture_is_refused() -> None:
    slow = replace(CLIP, dt=0.2)
    with pytest.raises(BadRecording, match="frames repeat, and the time between those that do"):
        without_repeats(rewritten(60.0, recorded=slow))


def test_repeated_frames_are_no_artifacts_and_the_real_rate_is_reported() -> None:
    fast = working(100, dt=1 / 30)
    fast[:, 10] += 1.2 * np.sin(4.0 * np.arange(100) / 30.0)  # 1.7 m/s at the hand
    lines = bvh_text(fast, dt=1 / 120).splitlines()
    start = next(k for k, line in enumerate(lines) if line.startswith("Frame Time")) + 1
    rows = [line for line in lines[start:] for _ in range(4)]
    text = "\n".join([*lines[: start - 2], "Frames: 400", lines[start - 1], *rows])
    found = read_motion(text.encode(), "clip.bvh")
    assert (found.n_frames, len(found.artifacts), found.n_clean) == (100, 0, 100)
    assert found.duration == pytest.approx(3.3)
    assert found.reading.rate_hz == pytest.approx(30.0)
    assert "frames repeat, real rate 30 Hz" in found.reading.notes[0]
