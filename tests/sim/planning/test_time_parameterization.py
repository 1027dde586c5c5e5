"""Timed paths keep the limits to rounding, in exact segments, and stay near their path."""

import itertools

import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.cells.cell import load_cell
from app.sim.collision.checker import Checker, capsule_shapes, no_people
from app.sim.core.arrays import Vec
from app.sim.planning.ompl_planners import planning_limits
from app.sim.planning.time_parameterization import (
    TimedPath,
    stop_periods,
    stopping_point,
    time_free_path,
    time_path,
)
from app.sim.robot.kernels.acceleration_bounds import coefficient_interval
from app.sim.robot.kernels.joints import AxisLimits
from app.sim.robot.ur10 import Robot
from app.sim.scene.scene import arm_of
from tests.sim.configurations import vertical_configuration

CELL = load_cell()
ARM = arm_of(CELL)
SLUGGISH = ARM._replace(limits=ARM.limits._replace(qdd_max=0.1 * ARM.limits.qdd_max))
"""With a tenth of the acceleration corners are rounded widely enough to touch something."""


def some_paths(n: int, seed: int = 0) -> list[tuple[Vec, Vec, Vec, frozenset[int]]]:
    """Start, speeds, path and stops, of many scales, half of them in motion."""
    rng, out = np.random.default_rng(seed), []
    for trial in range(n):
        corners = rng.integers(1, 8)
        path = np.cumsum(rng.normal(size=(corners, 6)) * 10 ** rng.uniform(-4, 0.3), axis=0)
        q0, qd0 = path[0].copy(), np.zeros(6)
        if trial % 2:
            qd0 = rng.uniform(-1.0, 1.0, 6) * ARM.limits.qd_max
            path[0] = stopping_point(q0, qd0, ARM)
        stops = frozenset(int(k) for k in range(corners) if rng.random() < 0.2)
        out.append((q0, qd0, path, stops))
    return out


def distance_to_path(q: Vec, path: Vec) -> float:
    """Greatest joint difference of a position and the nearest point of a path [rad]."""
    best = float(np.abs(q - path[0]).max())
    for a, b in zip(path[:-1], path[1:], strict=True):
        points = a + np.linspace(0.0, 1.0, 800)[:, None] * (b - a)
        best = min(best, float(np.abs(points - q).max(axis=1).min()))
    return best


def n_stops(timed: TimedPath) -> int:
    """Number of knots at rest between the ends."""
    return int((timed.qd[1:-1] == 0.0).all(axis=1).sum())


def test_speeds_and_accelerations_stay_inside_the_limits() -> None:
    for _, qd0, path, stops in some_paths(600):
        timed = time_path(path, ARM, qd0, stops)
        assert np.all(np.abs(timed.qd) <= ARM.limits.qd_max + 1e-12)
        assert np.all(np.abs(np.diff(timed.qd, axis=0)) <= ARM.limits.qdd_max * ARM.dt + 1e-12)


def test_periods_are_polynomials_of_degree_two_that_join() -> None:
    for _, qd0, path, stops in some_paths(300):
        timed = time_path(path, ARM, qd0, stops)
        mean = 0.5 * (timed.qd[:-1] + timed.qd[1:])
        np.testing.assert_allclose(np.diff(timed.q, axis=0), mean * ARM.dt, atol=1e-12)


def test_motions_begin_at_the_state_and_rest_at_the_end() -> None:
    for q0, qd0, path, stops in some_paths(300):
        timed = time_path(path, ARM, qd0, stops)
        np.testing.assert_allclose(timed.q[0], q0, atol=1e-12)
        np.testing.assert_array_equal(timed.qd[0], qd0)
        np.testing.assert_array_equal(timed.q[-1], path[-1])
        np.testing.assert_array_equal(timed.qd[-1], np.zeros(6))


def test_motions_leave_their_path_by_no_more_than_they_say() -> None:
    for _, qd0, path, stops in some_paths(24):
        if not qd0.any() and len(path) > 1:
            timed = time_path(path, ARM, qd0, stops)
            step = np.abs(np.diff(path, axis=0)).max() / 800
            for q in timed.q:
                assert distance_to_path(q, path) <= timed.corner_rad + step


def test_stops_rest_at_their_corners() -> None:
    path = np.cumsum(np.random.default_rng(3).normal(size=(5, 6)), axis=0)
    timed = time_path(path, ARM, None, frozenset({2}))
    at = np.flatnonzero(np.abs(timed.q - path[2]).max(axis=1) < 1e-12)
    assert n_stops(timed) == 1 and len(at) == 1
    np.testing.assert_array_equal(timed.qd[at[0]], np.zeros(6))


def test_a_single_joint_move_takes_the_time_of_the_formula() -> None:
    # v / A = 1/6 s is 4 periods of 0.05 s; 0.5 rad then cruise 0.5 / 0.5 s - 4 periods = 16.
    timed = time_path(np.array([np.zeros(6), 0.5 * np.eye(6)[0]]), ARM)
    assert timed.n_periods == 4 + 16 + 4


def test_timing_costs_little_beside_the_speed_limits() -> None:
    rng, spent, least = np.random.default_rng(5), 0.0, 0.0
    for _ in range(100):
        path = np.cumsum(rng.normal(size=(4, 6)) * 0.5, axis=0)
        spent += time_path(path, ARM).duration
        least += (np.abs(np.diff(path, axis=0)) / ARM.limits.qd_max).max(axis=1).sum()
    assert least <= spent < 1.2 * least


def test_every_segment_lies_in_the_interval_of_the_bounded_actions() -> None:
    rng = np.random.default_rng(6)
    low, high = planning_limits(Checker(ARM, no_people()), ARM.home)
    for _ in range(60):
        path = rng.uniform(low, high, size=(5, 6))
        path[1, :3], path[3, 3:] = low[:3], high[3:]  # touch the limits of the plans
        timed = time_path(path, ARM)
        for k in range(timed.n_periods):
            c = (timed.qd[k + 1] - timed.qd[k]) / (2.0 * ARM.dt)
            for j in range(6):
                axis = AxisLimits(*(limit[j] for limit in ARM.limits), ARM.dt)
                c_min, c_max = coefficient_interval(timed.q[k, j], timed.qd[k, j], axis)
                assert c_min - 1e-9 <= c[j] <= c_max + 1e-9


def test_at_interpolates_the_segments_and_holds_the_ends() -> None:
    timed = time_path(np.array([np.zeros(6), np.full(6, 0.4)]), ARM)
    q, qd = timed.at(2.5 * ARM.dt)
    c = (timed.qd[3] - timed.qd[2]) / (2.0 * ARM.dt)
    x = 0.5 * ARM.dt
    np.testing.assert_allclose(q, timed.q[2] + timed.qd[2] * x + c * x * x, atol=1e-15)
    np.testing.assert_allclose(qd, timed.qd[2] + 2.0 * c * x, atol=1e-15)
    np.testing.assert_array_equal(timed.at(99.0)[0], timed.q[-1])
    np.testing.assert_array_equal(timed.at(-1.0)[0], timed.q[0])


@pytest.mark.parametrize("dt", [0.02, 0.05])
def test_at_takes_every_time_before_the_end(dt: float) -> None:
    for n in range(1, 300):
        q = np.linspace(np.zeros(6), np.ones(6), n + 1)
        timed = TimedPath(dt=dt, q=q, qd=np.zeros((n + 1, 6)), corner_rad=0.0)
        last = timed.at(np.nextafter(timed.duration, 0.0))[0]
        np.testing.assert_allclose(last, q[-2], atol=1e-9)


def test_a_stop_takes_the_time_of_the_slowest_joint() -> None:
    qd = np.array([0.3, -0.1, 0.0, 0.0, 0.0, 0.0])
    assert stop_periods(qd, ARM) == 2
    np.testing.assert_allclose(stopping_point(np.zeros(6), qd, ARM), 0.05 * qd)


def corner_beside_a_ball() -> tuple[Checker, Vec]:
    """A path and a ball that its rounded corner comes nearer to than the path itself."""
    (corner,) = vertical_configuration(ARM, np.array(CELL.station("cube2").position))
    path = np.stack([corner] * 3)
    path[0, 0] -= 0.6
    path[2, 1] -= 0.5
    rounded = time_path(path, SLUGGISH).q
    sharp = np.vstack([np.linspace(a, b, 200) for a, b in itertools.pairwise(path)])
    tcp = Robot(ARM.lengths.tool).tcp_pose(corner)[:3, 3]
    rng = np.random.default_rng(0)
    for _ in range(100):
        offset = rng.normal(size=3)
        ball = tcp + 0.15 * offset / np.linalg.norm(offset)
        people = capsule_shapes(np.array([[ball, ball]]), np.array([0.03]))
        checker = Checker(SLUGGISH, people, 0.0, 0.0)
        near = min(checker.clearance(q).people_m for q in rounded)
        far = min(checker.clearance(q).people_m for q in sharp)
        if near < far - 0.002:
            return Checker(SLUGGISH, people, 0.5 * (near + far), 0.0), path
    raise AssertionError("no such ball")


def test_a_corner_that_would_touch_is_taken_with_a_stop() -> None:
    checker, path = corner_beside_a_ball()
    assert checker.path_free(path)
    rounded = time_path(path, SLUGGISH)
    assert checker.first_blocked(rounded.q, rounded.qd) < rounded.n_periods
    timed = time_free_path(checker, path)
    assert isinstance(timed, TimedPath) and n_stops(timed) == 1
    assert checker.first_blocked(timed.q, timed.qd) == timed.n_periods


def test_a_start_in_motion_turns_at_once_where_that_is_shorter() -> None:
    checker = Checker(ARM, no_people())
    qd0 = np.array([0.4, 0.0, 0.0, 0.0, 0.0, 0.0])
    stop = stopping_point(ARM.home, qd0, ARM)
    path = np.stack([stop, stop - np.array([0.5, 0, 0, 0, 0, 0])])
    timed = time_free_path(checker, path, qd0)
    assert timed is not None
    assert timed.n_periods <= time_path(path, ARM, qd0).n_periods
    assert timed.n_periods <= time_path(path, ARM, qd0, frozenset({0})).n_periods
    np.testing.assert_array_equal(timed.qd[0], qd0)


@pytest.mark.parametrize("share", [0.5, 0.99, 1.0])
def test_a_reversal_that_the_deceleration_leaves_no_room_for_begins_with_a_stop(
    share: float,
) -> None:
    qd0 = np.zeros(6)
    qd0[0] = share * ARM.limits.qdd_max[0] * ARM.dt  # the stop takes that share of a period
    stop = stopping_point(ARM.home, qd0, ARM)
    path = np.stack([stop, stop - np.array([0.5, 0, 0, 0, 0, 0])])
    timed = time_path(path, ARM, qd0)
    assert n_stops(timed) == 1
    assert timed.n_periods == time_path(path, ARM, qd0, frozenset({0})).n_periods


def test_bad_paths_are_named() -> None:
    with pytest.raises(InvalidInput, match="path"):
        time_path(np.zeros((0, 6)), ARM)
    with pytest.raises(InvalidInput, match="finite"):
        time_path(np.full((2, 6), np.nan), ARM)
