"""People who cross between the robot and its goal: the episodes of ``reach-ssm``.

A crossing is determined by its seed and number. The robot starts at home; the goal is uniform
in the cell's goal box. In plan view the person's axis moves straight at constant speed, crosses
the segment from the tcp at home to the goal, stays there for a while, and continues straight
(docs/method.md 2.6):

=================  ==========================================================================
speed              uniform in SPEED [m/s], the range of docs/method.md 2.1
radius             uniform in RADIUS [m], the range of docs/method.md 2.1, constant
dwell              uniform in DWELL [s], at rest on the segment
arrival            uniform in ARRIVAL [s]: when the axis reaches the segment; an unobstructed
                   robot needs about 2 s to the goal
place              uniform in PLACE, as a fraction of the segment
direction          uniform within TILT [rad] of the normal to the segment, from either side
=================  ==========================================================================

Crossings in which the person would come nearer than CLEAR to the robot at home, or is nearer
than AT_START when the run begins, are drawn again, goal included: a robot that waits at home is
never touched, it can start at full speed, and no person stays between it and the goal. Near
goals are therefore rarer than in the box.

The second set uses recorded people: the key-points of each frame become the safety cylinder of
docs/method.md 2.8 (without flesh margin); a run is rotated and moved so that the person walks
across as above, and leaves after the recording ends. These cylinders have radii of 0.35 to
0.8 m, so their axis cannot pass between a robot at home and its goal: here the cylinder covers
part of the segment, and its axis may pass behind the goal.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.errors import InvalidInput
from app.sim.cells.cell import Cell
from app.sim.collision.checker import Checker, shapes_of
from app.sim.core.arrays import Vec
from app.sim.mocap.importer import Motion
from app.sim.perception.bounding_cylinder import safety_cylinder
from app.sim.perception.keypoints import keypoints_of
from app.sim.reach.batch import goal_region_of
from app.sim.robot.ur10 import Robot
from app.sim.scene.scene import arm_of

SEED = 4104
"""Seed of the evaluated crossings."""
N_CROSSINGS = 200
SPEED = (0.3, 1.0)
RADIUS = (0.2, 0.5)
DWELL = (0.0, 3.0)
ARRIVAL = (0.5, 3.0)
PLACE = (0.2, 0.9)
TILT = 0.25 * math.pi
CLEAR = 0.05
"""Least distance of any person to the robot at home [m]."""
AT_START = 0.8
"""Least distance of any person to the robot when the run begins [m]."""
FAR = 4.0
"""Distance from the segment at which a crossing ends [m]."""
HEIGHT = 2.0
"""Height of people above the floor [m], docs/method.md 2.1."""
TRIES = 10_000
"""Largest number of draws of a crossing."""
LEAVE_SPEED = 1.0
"""Speed at which recorded people walk away [m/s]."""
LONGEST_S = 8.0
"""Longest part of a recording in one crossing [s]."""
LEAST_STEP = 0.15
"""Least distance that recorded people walk in the second around their arrival [m]."""
BEHIND = (0.2, 3.0)
"""Place of a recorded person's axis, as a fraction of the segment."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CrossingSet:
    """Crossings of one cell as arrays."""

    goals: Vec
    """Goals of the tcp [m], shape (n, 3)."""
    tracks: Vec
    """People's x, y and radius at the ends of control periods [m], shape (n, n_cycles + 1, 3);
    the last row of a shorter track repeats."""


def tcp_at_home(cell: Cell) -> Vec:
    """Return the tcp of the robot at home [m], shape (3,)."""
    robot = Robot(cell.robot.tool_length)
    return np.asarray(robot.tcp_pose(np.array(cell.robot.home_q))[:3, 3])


def covered(track: Vec, start: Vec, goal: Vec) -> NDArray[np.bool_]:
    """Return when a cylinder covers part of a segment in plan view, shape (n + 1,).

    Args:
        track: x, y, radius at the ends of control periods [m], shape (n + 1, 3).
        start: Start of the segment [m], shape (>= 2,).
        goal: Its end [m], shape (>= 2,).
    """
    segment = goal[:2] - start[:2]
    offset = track[:, :2] - start[:2]
    along = np.clip(offset @ segment / max(float(segment @ segment), 1e-12), 0.0, 1.0)
    away = np.linalg.norm(offset - along[:, None] * segment, axis=1)
    return np.asarray(away < track[:, 2])


def crossings(cell: Cell, n: int = N_CROSSINGS, seed: int = SEED) -> CrossingSet:
    """Return the first ``n`` crossings of a seed.

    Raises:
        InvalidInput: ``n`` is 0, or the cell has no goal region or no space for a person.
    """
    home = tcp_at_home(cell)
    return _set_of(lambda number: _walk(cell, home, seed, number), n)


def recorded_crossings(cell: Cell, motions: Sequence[Motion], n: int) -> CrossingSet:
    """Return crossings made from recorded people.

    Args:
        motions: Runs of recorded motion without artifacts.
        n: Number of crossings; each is determined by its number and the motions.

    Raises:
        InvalidInput: ``n`` is 0, there is no motion, or no motion crosses the segment.
    """
    if not motions:
        raise InvalidInput("motions", 0, "must hold at least one run of recorded motion")
    home, dt = tcp_at_home(cell), cell.robot.dt
    cylinders = [cylinder_track(motion, cell.floor_z, dt) for motion in motions]
    return _set_of(lambda number: _recorded(cell, home, motions, cylinders, number), n)


def cylinder_track(motion: Motion, floor_z: float, dt: float) -> Vec:
    """Return a recorded person as cylinders: x, y, radius [m], shape (n, 3).

    Source: docs/method.md 2.8.

    Args:
        motion: One run.
        floor_z: Height of the floor [m].
        dt: Time between cylinders [s].
    """
    size = motion.size.vector(floor_z)
    times = np.arange(0.0, float(motion.times[-1]) + 1e-9, dt)
    rows = []
    for t in times:
        q = motion.q[min(int(np.searchsorted(motion.times, t)), len(motion.q) - 1)]
        cylinder = safety_cylinder(keypoints_of(q, size, floor_z), flesh_margin=0.0)
        assert cylinder is not None
        rows.append((*cylinder.center, cylinder.radius))
    return np.array(rows)


def _set_of(draw: Callable[[int], tuple[Vec, Vec]], n: int) -> CrossingSet:
    if n < 1:
        raise InvalidInput("crossings", n, "must be at least 1")
    goals, tracks = zip(*map(draw, range(n)), strict=True)
    longest = max(map(len, tracks))
    padded = [np.pad(one, ((0, longest - len(one)), (0, 0)), "edge") for one in tracks]
    return CrossingSet(goals=np.stack(goals), tracks=np.stack(padded))


def _walk(cell: Cell, home: Vec, seed: int, number: int) -> tuple[Vec, Vec]:
    """Draw goal and track of a crossing that is clear of the robot at home."""
    rng = np.random.default_rng([seed, number])
    for _ in range(TRIES):
        goal = _goal(cell, rng)
        speed, radius = rng.uniform(*SPEED), rng.uniform(*RADIUS)
        dwell, arrival = rng.uniform(*DWELL), rng.uniform(*ARRIVAL)
        there, course = _across(home, goal, rng)
        dt = cell.robot.dt
        times = dt * np.arange(math.ceil((arrival + dwell + FAR / speed) / dt) + 1)
        signed = np.where(
            times < arrival, times - arrival, np.maximum(0.0, times - arrival - dwell)
        )
        track = _straight(there, speed * signed, course, radius)
        if _clear_of_home(cell, track):
            return goal, track
    raise InvalidInput(
        "cell", cell.name, "has no space for a person between the robot and its goals"
    )


def _recorded(
    cell: Cell,
    home: Vec,
    motions: Sequence[Motion],
    cylinders: Sequence[Vec],
    number: int,
) -> tuple[Vec, Vec]:
    """Draw goal and track of a recorded crossing that is clear of the robot at home."""
    rng, dt = np.random.default_rng([SEED, number, 1]), cell.robot.dt
    for _ in range(TRIES):
        goal, which = _goal(cell, rng), int(rng.integers(len(motions)))
        lead = round(rng.uniform(*ARRIVAL) / dt)
        there, course = _across(home, goal, rng, BEHIND)
        if len(cylinders[which]) <= lead + 1:
            continue
        first = int(rng.integers(len(cylinders[which]) - lead))
        run = cylinders[which][first : first + round(LONGEST_S / dt)].copy()
        if _turn(run, lead, there, course, dt) < LEAST_STEP:
            continue
        steps = np.arange(1, math.ceil(FAR / LEAVE_SPEED / dt) + 1)
        leaving = _straight(run[-1, :2], LEAVE_SPEED * dt * steps, course, run[-1, 2])
        track = np.vstack([run, leaving])
        crossed = covered(track, home, goal)
        first_covered = float(np.argmax(crossed) * dt)
        in_time = crossed.any() and 0.0 < first_covered <= ARRIVAL[1]
        if in_time and _clear_of_home(cell, track):
            return goal, track
    names = sorted({motion.name for motion in motions})
    raise InvalidInput("motions", names, "must contain a person who walks across the segment")


def _turn(run: Vec, lead: int, there: Vec, course: Vec, dt: float) -> float:
    """Rotate and move a run onto a place and course; return the speed there [m/s]."""
    half = round(0.5 / dt)
    step = run[min(lead + half, len(run) - 1), :2] - run[max(lead - half, 0), :2]
    turn = math.atan2(course[1], course[0]) - math.atan2(step[1], step[0])
    c, s = math.cos(turn), math.sin(turn)
    run[:, :2] = there + (run[:, :2] - run[lead, :2]) @ np.array([[c, s], [-s, c]])
    return float(np.linalg.norm(step))


def _goal(cell: Cell, rng: np.random.Generator) -> Vec:
    return np.asarray(rng.uniform(*goal_region_of(cell).box()))


def _across(
    home: Vec, goal: Vec, rng: np.random.Generator, place: tuple[float, float] = PLACE
) -> tuple[Vec, Vec]:
    """Draw the crossing point [m], shape (2,), and the course, a unit vector."""
    segment = goal[:2] - home[:2]
    there = home[:2] + rng.uniform(*place) * segment
    side = 1.0 if rng.uniform() < 0.5 else -1.0
    course = (
        math.atan2(segment[1], segment[0]) + side * 0.5 * math.pi + rng.uniform(-TILT, TILT)
    )
    return there, np.array([math.cos(course), math.sin(course)])


def _straight(there: Vec, along: NDArray[np.floating], course: Vec, radius: float) -> Vec:
    """Return the track of a person at distances ``along`` a course [m], shape (n, 3)."""
    return np.column_stack([there + along[:, None] * course, np.full(len(along), radius)])


def _clear_of_home(cell: Cell, track: Vec) -> bool:
    """Return whether a track keeps CLEAR, and at its start AT_START, of the robot at home."""
    arm, top = arm_of(cell), cell.floor_z + HEIGHT
    home = np.array(arm.home)
    every = track[:: max(1, round(0.1 / cell.robot.dt))]
    rows = np.hstack([every, np.full((len(every), 1), top)])
    first = Checker(arm, shapes_of(cell, None, rows[:1])).clearance(home).people_m
    near = rows[np.hypot(rows[:, 0], rows[:, 1]) < 2.0]
    return (
        first >= AT_START
        and Checker(arm, shapes_of(cell, None, near)).clearance(home).people_m >= CLEAR
    )
