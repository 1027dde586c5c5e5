"""Crossings lie between robot and goal, in the stated ranges, fixed by seed and number."""

import math

import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.cells.cell import load_cell
from app.sim.collision.checker import Checker, shapes_of
from app.sim.core.arrays import Vec
from app.sim.reach import crossings as crossing
from app.sim.reach.crossings import (
    covered,
    crossings,
    cylinder_track,
    recorded_crossings,
    tcp_at_home,
)
from app.sim.scene.scene import arm_of
from tests.sim.recorded_motion import recorded

CELL = load_cell("shared-workspace")
DT = CELL.robot.dt
HOME = tcp_at_home(CELL)


@pytest.fixture(scope="module")
def evaluated() -> crossing.CrossingSet:
    return crossings(CELL)


def clearances_at_home(track: np.ndarray) -> np.ndarray:
    arm, top = arm_of(CELL), CELL.floor_z + crossing.HEIGHT
    return np.array(
        [
            Checker(arm, shapes_of(CELL, None, np.array([[*row, top]])))
            .clearance(np.array(arm.home))
            .people_m
            for row in track
        ]
    )


def crossing_time(track: Vec, start: Vec, goal: Vec, dt: float) -> float:
    """Return when the axis first crosses a segment in plan view [s]; infinity if never.

    Args:
        track: x, y at the ends of control periods [m], shape (n + 1, >= 2).
        start: Start of the segment [m], shape (>= 2,).
        goal: Its end [m], shape (>= 2,).
        dt: Control period [s].
    """
    segment = goal[:2] - start[:2]
    square = float(segment @ segment)
    if square <= 0.0:
        return math.inf
    offset = track[:, :2] - start[:2]
    side = (segment[0] * offset[:, 1] - segment[1] * offset[:, 0]) / square
    side[np.abs(side) < 1e-9] = 0.0
    along = offset @ segment / square
    before, after = side[:-1], side[1:]
    for k in np.flatnonzero((before * after <= 0.0) & (before != after)):
        part = before[k] / (before[k] - after[k])
        if 0.0 < along[k] + part * (along[k + 1] - along[k]) < 1.0:
            return float((k + part) * dt)
    return math.inf


def steps_of(track: Vec) -> Vec:
    """Return the speeds of a track's periods until it ends [m/s]."""
    steps = np.linalg.norm(np.diff(track[:, :2], axis=0), axis=1) / DT
    return steps[: np.flatnonzero(steps)[-1] + 1]


def test_every_one_of_the_200_crosses_between_the_robot_and_its_goal(evaluated):
    assert len(evaluated.tracks) == len(evaluated.goals) == 200
    for track, goal in zip(evaluated.tracks, evaluated.goals, strict=True):
        arrival = crossing_time(track, HOME, goal, DT)
        assert crossing.ARRIVAL[0] - DT <= arrival <= crossing.ARRIVAL[1] + DT
        assert covered(track, HOME, goal)[round(arrival / DT)]


def test_they_keep_to_the_stated_ranges(evaluated):
    half = 0.5 * np.array(CELL.goal_region.size)
    assert (np.abs(evaluated.goals - CELL.goal_region.center) <= half).all()
    speeds, radii, dwells = [], [], []
    for track in evaluated.tracks:
        steps = steps_of(track)
        speeds.append(steps.max())
        radii.append(track[0, 2])
        dwells.append((steps < 1e-9).sum() * DT)
        moving = steps[(steps > 1e-9) & (steps < steps.max() - 1e-9)]
        assert len(moving) <= 2  # the periods in which the person stops and starts
    for found, (low, high), slack in (
        (speeds, crossing.SPEED, 1e-9),
        (radii, crossing.RADIUS, 0.0),
        (dwells, crossing.DWELL, 2 * DT),
    ):
        assert low - slack <= min(found) < low + 0.2 * (high - low)
        assert high - 0.2 * (high - low) < max(found) <= high + slack


def test_they_begin_away_from_home_and_never_touch_a_robot_that_waits_there(evaluated):
    for track in evaluated.tracks[::20]:
        found = clearances_at_home(track[::10])
        assert found[0] >= crossing.AT_START
        assert found.min() >= crossing.CLEAR - 0.01
        assert found[-1] > 2.0


def test_a_crossing_is_fixed_by_seed_and_number(evaluated):
    again = crossings(CELL, 3)
    n = again.tracks.shape[1]
    np.testing.assert_array_equal(again.tracks, evaluated.tracks[:3, :n])
    assert not np.array_equal(crossings(CELL, 3, seed=1).goals, again.goals)


def test_shorter_tracks_of_a_set_stay_where_they_end(evaluated):
    alone = crossings(CELL, 1).tracks[0]
    rest = evaluated.tracks[0, len(alone) :]
    assert len(rest) > 0
    assert (rest == alone[-1]).all()


def test_an_axis_that_passes_behind_the_goal_does_not_cross():
    goal = HOME + np.array([0.0, 0.5, 0.0])
    x = np.linspace(-1.0, 1.0, 101)
    for y, crosses in ((0.4, True), (0.6, False), (-0.1, False)):
        track = np.column_stack([HOME[0] + x, np.full(101, HOME[1] + y), np.full(101, 0.2)])
        assert math.isfinite(crossing_time(track, HOME, goal, DT)) == crosses
        assert covered(track, HOME, goal).any()
    assert not covered(track - np.array([0.0, 0.15, 0.0]), HOME, goal).any()


def test_recorded_people_become_cylinders_that_cover_the_segment():
    motion = recorded(4.0, walk=2.4, turn=0.0)
    run = cylinder_track(motion, CELL.floor_z, DT)
    assert np.linalg.norm(run[-1, :2] - run[0, :2]) == pytest.approx(2.4, abs=0.3)
    found = recorded_crossings(CELL, [motion], 4)
    for track, goal in zip(found.tracks, found.goals, strict=True):
        arrival = np.argmax(covered(track, HOME, goal)) * DT
        assert 0.0 < arrival <= crossing.ARRIVAL[1]
        behind = HOME + crossing.BEHIND[1] * (goal - HOME)
        k, half = round(crossing_time(track, HOME, behind, DT) / DT), round(0.5 / DT)
        step = np.linalg.norm(track[k + half, :2] - track[max(k - half, 0), :2])
        assert crossing.LEAST_STEP <= step <= 1.2
        assert clearances_at_home(track[::5]).min() >= crossing.CLEAR - 0.01


def test_recordings_of_people_who_stand_still_are_refused_by_name():
    with pytest.raises(InvalidInput, match="made-up"):
        recorded_crossings(CELL, [recorded(4.0, walk=0.0, turn=0.0)], 1)
    with pytest.raises(InvalidInput, match="motions"):
        recorded_crossings(CELL, [], 1)
    with pytest.raises(InvalidInput, match="crossings"):
        crossings(CELL, 0)
