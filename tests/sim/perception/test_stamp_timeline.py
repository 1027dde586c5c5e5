"""Stamps of a tracker on one timeline: late frames, wild stamps, clocks that change."""

import numpy as np
import pytest

from app.errors import ClockJump
from app.sim.perception.stamp_timeline import AHEAD_S, N_RESYNC, StampTimeline

DT = 1.0 / 30.0


def take(timeline: StampTimeline, stamp: float, now: float) -> float:
    time = timeline.offer(stamp, now)
    timeline.accept(stamp, time, now)
    return time


def running(n: int = 10, start: float = 1000.0) -> StampTimeline:
    """A timeline after ``n`` frames at 30 Hz; the service's clock began at 50 s."""
    timeline = StampTimeline(50.0)
    for k in range(n):
        take(timeline, start + k * DT, 50.0 + k * DT)
    return timeline


def test_frames_of_a_steady_clock_keep_their_stamps() -> None:
    timeline = running()
    assert timeline.time == timeline.stamp == 1000.0 + 9 * DT
    assert not timeline.out_of_step and not timeline.jumped


def test_a_moment_is_as_far_ahead_as_the_arrival_is_past() -> None:
    timeline = running()
    assert timeline.ahead(50.0 + 9 * DT + 3.0) == pytest.approx(3.0)


@pytest.mark.parametrize("claimed", [-1e9, -0.5, 0.0, 0.01])
def test_a_time_from_the_caller_makes_nothing_younger(claimed: float) -> None:
    timeline = running()
    assert timeline.stamp is not None
    now = timeline.arrived + 0.2
    assert timeline.ahead(now, timeline.stamp + claimed) == pytest.approx(0.2)
    assert timeline.ahead(now, timeline.stamp + 0.7) == pytest.approx(0.7)


@pytest.mark.parametrize(
    "wild", [1000.0 + 86400.0, 0.0, -1e9, 1000.0 + 9 * DT, 1000.0 + 9 * DT + AHEAD_S + 0.1]
)
def test_one_wild_stamp_is_not_taken_and_the_next_frame_is(wild: float) -> None:
    timeline = running()
    with pytest.raises(ClockJump, match="number 1"):
        timeline.offer(wild, 50.0 + 9.5 * DT)
    assert timeline.out_of_step
    assert take(timeline, 1000.0 + 10 * DT, 50.0 + 10 * DT) == pytest.approx(1000.0 + 10 * DT)
    assert not timeline.out_of_step and not timeline.jumped


@pytest.mark.parametrize("change", [-2.0, -1000.3, 86400.0, -1e9, 3.0])
def test_a_changed_clock_is_taken_after_a_few_consistent_frames(change: float) -> None:
    timeline = running()
    for k in range(10, 9 + N_RESYNC):
        with pytest.raises(ClockJump):
            timeline.offer(1000.0 + k * DT + change, 50.0 + k * DT)
    k = 9 + N_RESYNC
    time = take(timeline, 1000.0 + k * DT + change, 50.0 + k * DT)
    assert time == pytest.approx(1000.0 + k * DT)  # by the arrivals
    assert timeline.jumped and not timeline.out_of_step
    assert take(timeline, 1000.0 + (k + 1) * DT + change, 50.0 + (k + 1) * DT) > time
    assert not timeline.jumped


def test_wild_stamps_that_do_not_continue_each_other_are_never_taken() -> None:
    timeline, rng = running(), np.random.default_rng(3)
    for k in range(100):
        stamp = float(rng.choice([-1.0, 1.0]) * 1e6 * (k + 1))
        with pytest.raises(ClockJump, match="number 1"):
            timeline.offer(stamp, 51.0 + k * DT)
    assert timeline.time == 1000.0 + 9 * DT


def test_a_frame_that_was_delivered_late_is_left_out() -> None:
    timeline = running()
    with pytest.raises(ClockJump):
        timeline.offer(1000.0 + 8.5 * DT, 50.0 + 9 * DT)
    assert take(timeline, 1000.0 + 10 * DT, 50.0 + 10 * DT) == pytest.approx(1000.0 + 10 * DT)


def test_a_pause_of_the_camera_is_no_jump() -> None:
    timeline = running()
    time = take(timeline, 1600.0, 650.0)
    assert time == 1600.0 and not timeline.jumped


def test_time_rises_for_any_stamps_and_never_runs_ahead_of_the_arrivals() -> None:
    rng = np.random.default_rng(11)
    for _ in range(200):
        timeline, now, stamp = StampTimeline(0.0), 0.0, float(rng.normal(0.0, 1e6))
        times: list[float] = []
        for _ in range(60):
            now += float(rng.exponential(0.05))
            stamp += float(rng.choice([0.03, 0.0, -1.0, 100.0], p=[0.85, 0.05, 0.05, 0.05]))
            try:
                times.append(take(timeline, stamp, now))
            except ClockJump:
                assert timeline.out_of_step
        assert all(a < b for a, b in zip(times, times[1:], strict=False))
        assert times[-1] - times[0] <= now + AHEAD_S * len(times)
