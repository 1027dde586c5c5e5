"""State and collision geometry of the people in a cell (compiled).

A cell has up to four people: *workers*, bodies of 18 degrees of freedom with twelve capsules
each, and pedestrians, vertical cylinders (``pedestrian.py``). ``motion.py`` moves them.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import FAR, kernel
from app.sim.geometry.capsules import (
    capsule_clearances,
    copy_rows,
    copy_values,
    least,
)
from app.sim.geometry.cylinder import cylinder_clearance
from app.sim.human.kernels import kinematics as body
from app.sim.people.kernels.pedestrian import VX, VY, PedestrianRules, PedestrianState, X, Y
from app.sim.primitives.kernels.primitives import PrimitiveLibrary, SegmentState

REACHES, LIBRARY = range(2)
"""Sources of a worker's script."""
SCRIPTED, ABSENT = -1, -2
"""Values in place of a track's index: the worker follows a script; the worker is absent."""
MAX_PEOPLE = 4
"""Most people in a cell."""
DEEPEST = 32
"""Most bisections of a period in the contact test."""


class Tracks(NamedTuple):
    """Sampled motion of workers."""

    rows: Vec
    """Samples of all tracks, concatenated: joints [m, rad] and rise of the pelvis above
    standing [m], shape (n, 19)."""
    spans: NDArray[np.int64]
    """First sample, number of samples and body (-1: any) of each track, shape (n_tracks, 3)."""
    dt: float
    """Step between samples [s]."""
    needed: float
    """Desired length of a track after the start of an episode [s]."""


class People(NamedTuple):
    """Data of people that all environments share."""

    bodies: Vec
    """Sizes from which each worker's is drawn [m], shape (n_bodies, body.N_SIZE)."""
    floor_z: float
    """Height of the floor [m]."""
    top_z: float
    """Height of the tops of people's cylinders [m]."""
    capsules: Vec
    """Template of the workers' capsules, shape (9, n); see ``body.new_body_capsules``."""
    postures: Vec
    """Postures of the scripts [m, rad], shape (n_postures, 18)."""
    hands: Vec
    """Palm positions of each posture [m], shape (n_postures, 2, 3)."""
    of_station: NDArray[np.int64]
    """First posture and count of each body, place and hand, (n_bodies, n_places + 1, 2, 2)."""
    n_cubes: int
    """Number of cubes; they are the first places."""
    source: int
    """Source of the scripts: REACHES or LIBRARY."""
    primitive_library: PrimitiveLibrary
    """Movement primitives, for LIBRARY."""
    tracks: Tracks
    """Tracks of workers without a script."""
    track_share: float
    """Probability that a worker follows a track in an episode."""
    absent_share: float
    """Probability that a worker is absent in an episode."""
    rest_share: float
    """Probability that a worker stands still for a while in an episode."""
    limits: Vec
    """Lower and upper joint limits of a worker [m, rad], shape (2, 18)."""
    yielding: float
    """Degree of yielding to the arm, from 0 to 1."""
    pace: float
    """Least speed of the workers relative to their scripts."""
    pace_max: float
    """Greatest speed of the workers; each worker's is drawn per episode."""
    walkers: PedestrianRules
    """Rules of the pedestrians."""
    no_person: Vec
    """Posture of a person beyond any interaction, in place of no person [m, rad], (18,)."""


class PeopleState(NamedTuple):
    """State of the people of all environments; W workers, C pedestrians."""

    q: Vec
    """The workers' joints [m, rad], shape (n_envs, W, 18)."""
    qd: Vec
    """Speeds of the workers' joints [m/s, rad/s], shape (n_envs, W, 18)."""
    body: NDArray[np.int64]
    """Index of each worker's body, shape (n_envs, W)."""
    size: Vec
    """Sizes of the workers [m], shape (n_envs, W, body.N_SIZE)."""
    capsules: Vec
    """Capsules of the workers, shape (n_envs, 9, n)."""
    clock: Vec
    """Time in each worker's script or track [s], shape (n_envs, W)."""
    pace: Vec
    """Speed of each worker relative to its script, shape (n_envs, W)."""
    rest: Vec
    """Time until each worker stands still, and time left of that [s], (n_envs, W, 2)."""
    near: Vec
    """Clearance of each worker to the robot in the last contact test [m], (n_envs, W)."""
    lean: Vec
    """Lean of each worker, see ``yielding.lean_away`` [rad, rad/s], (n_envs, W, 4)."""
    track: NDArray[np.int64]
    """Track of each worker, SCRIPTED or ABSENT, shape (n_envs, W)."""
    segments: SegmentState
    """Segments of the scripts, for LIBRARY."""
    move: NDArray[np.int64]
    """Current move of each worker's script, shape (n_envs, W)."""
    n_moves: NDArray[np.int64]
    """Number of moves of each worker's script, shape (n_envs, W)."""
    start: Vec
    """Start of each move [s], shape (n_envs, W, MAX_MOVES)."""
    duration: Vec
    """Duration of each move [s], shape (n_envs, W, MAX_MOVES)."""
    chosen: NDArray[np.int64]
    """Postures of the scripts, shape (n_envs, W, MAX_MOVES + 1)."""
    walkers: PedestrianState
    """State of the pedestrians, of shape (n_envs, C, ...)."""
    cylinders: Vec
    """x, y and radius of the pedestrians [m], shape (n_envs, C, 3)."""


class PeopleGeometry(NamedTuple):
    """Collision geometry and work space of the people of one environment."""

    q: Vec
    """Joints of the workers [m, rad], shape (W, 18)."""
    size: Vec
    """Sizes of the workers [m], shape (W, body.N_SIZE)."""
    pelvis_z: Vec
    """Heights of the pelvis at the start and end of the period [m], shape (2, W)."""
    points: Vec
    """The workers' points [m], shape (W, N_POINTS, 3)."""
    frames: Vec
    """The workers' orientations, shape (W, N_FRAMES, 3, 3)."""
    trig: Vec
    """Sines and cosines of the joints, and work space (``human/kernels``), shape (3, 16)."""
    capsules: Vec
    """The workers' capsules, shape (9, n)."""
    clearance: Vec
    """Clearance of the robot to each capsule of the workers [m], shape (n,)."""
    cylinders: Vec
    """The pedestrians' x, y and radius [m], shape (C, 3)."""
    q0: Vec
    """The workers' joints at the start of the period [m, rad], shape (W, 18)."""
    cylinders0: Vec
    """The pedestrians at the start of the period [m], shape (C, 3)."""
    robot_q: Vec
    """The robot's joints within the period [rad], shape (6,)."""
    away: Vec
    """Distances of a segment's sample from its two ends [m, rad], shape (36,)."""
    stack_end: Vec
    """Ends of the pending intervals of the contact test [s], shape (DEEPEST,)."""
    stack_clear: Vec
    """Clearances at these times [m], shape (DEEPEST, 3)."""


def new_people_geometry(people: People, n_workers: int, n_pedestrians: int) -> PeopleGeometry:
    """Return uninitialised geometry for a number of workers and pedestrians."""
    return PeopleGeometry(
        np.empty((n_workers, 18)),
        np.tile(people.bodies[0], (n_workers, 1)),
        np.zeros((2, n_workers)),
        np.empty((n_workers, body.N_POINTS, 3)),
        np.empty((n_workers, body.N_FRAMES, 3, 3)),
        np.empty((3, 16)),
        people.capsules.copy(),
        np.empty(people.capsules.shape[1]),
        np.empty((n_pedestrians, 3)),
        np.empty((n_workers, 18)),
        np.empty((n_pedestrians, 3)),
        np.empty(6),
        np.empty(36),
        np.empty(DEEPEST),
        np.empty((DEEPEST, 3)),
    )


@kernel(inline="always")
def place_workers(people: People, q: Vec, geometry: PeopleGeometry) -> None:
    """Compute the workers' capsules from joints [m, rad], shape (W, 18), and their sizes."""
    for w in range(q.shape[0]):
        points, frames, size = geometry.points[w], geometry.frames[w], geometry.size[w]
        body.points_and_frames(q[w], size, geometry.trig, points, frames)
        first = w * body.N_CAPSULES
        body.capsules(points, frames, size, people.floor_z, first, geometry.capsules)


@kernel(inline="always")
def people_clearance(people: People, robot: Vec, geometry: PeopleGeometry) -> float:
    """Return the clearance between robot and nearest person [m]; FAR without people.

    Args:
        robot: The robot's capsules as columns, shape (9, n).
        geometry: Placed; ``clearance`` is filled.
    """
    best = FAR
    if geometry.capsules.shape[1] > 0:
        capsule_clearances(robot, geometry.capsules, geometry.clearance)
        best, _ = least(geometry.clearance)
    for k in range(geometry.cylinders.shape[0]):
        x, y, r = geometry.cylinders[k, 0], geometry.cylinders[k, 1], geometry.cylinders[k, 2]
        d, _ = cylinder_clearance(robot, 0, x, y, r, people.top_z)
        best = min(best, d)
    return best


@kernel(inline="always")
def store_clearances(state: PeopleState, e: int, geometry: PeopleGeometry) -> None:
    """Store the clearance of each worker to the robot from ``geometry.clearance``."""
    for w in range(state.q.shape[1]):
        part = geometry.clearance[w * body.N_CAPSULES : (w + 1) * body.N_CAPSULES]
        state.near[e, w], _ = least(part)


@kernel(inline="always")
def place_people(people: People, state: PeopleState, e: int, geometry: PeopleGeometry) -> None:
    """Fill ``geometry`` with the current people of environment ``e``."""
    copy_rows(state.size[e], geometry.size)
    place_workers(people, state.q[e], geometry)
    copy_rows(state.cylinders[e], geometry.cylinders)


@kernel()
def person_clearance(people: People, robot: Vec, geometry: PeopleGeometry, who: int) -> float:
    """Return the clearance between robot and one person [m].

    Args:
        robot: The robot's capsules as columns, shape (9, n).
        geometry: The people, placed; for a worker ``clearance`` must be filled.
        who: Index of the person: workers first, then pedestrians.
    """
    k = who - geometry.q.shape[0]
    if k < 0:
        part = geometry.clearance[who * body.N_CAPSULES : (who + 1) * body.N_CAPSULES]
        return float(least(part)[0])
    x, y, r = geometry.cylinders[k, 0], geometry.cylinders[k, 1], geometry.cylinders[k, 2]
    return float(cylinder_clearance(robot, 0, x, y, r, people.top_z)[0])


@kernel()
def nearest_person(people: People, robot: Vec, geometry: PeopleGeometry) -> int:
    """Return the index of the person nearest to the robot (-1: none), workers first.

    Args:
        robot: The robot's capsules as columns, shape (9, n).
        geometry: The people, placed.
    """
    n_workers, n_pedestrians = geometry.q.shape[0], geometry.cylinders.shape[0]
    if n_workers + n_pedestrians < 2:
        return int(n_workers + n_pedestrians - 1)
    best, nearest = FAR, 0
    if n_workers > 0:
        capsule_clearances(robot, geometry.capsules, geometry.clearance)
    for who in range(n_workers + n_pedestrians):
        d = person_clearance(people, robot, geometry, who)
        if d < best:
            best, nearest = d, who
    return nearest


@kernel(inline="always")
def observe_people(
    people: People,
    state: PeopleState,
    e: int,
    robot: Vec,
    geometry: PeopleGeometry,
    q: Vec,
    qd: Vec,
    size: Vec,
) -> None:
    """Write the people of an environment, the one nearest to the robot first.

    A pedestrian is observed as a person standing in the cylinder and facing the robot's base;
    no person, as a person beyond any interaction. A policy for 18-DoF people thereby works
    with any people.

    Args:
        state: People of all environments.
        e: Environment.
        robot: The robot's capsules as columns, shape (9, n).
        geometry: The people, placed as they are now.
        q: Filled with joints [m, rad], shape (P, 18); P is the number of people, at least 1.
        qd: Filled with joint speeds [m/s, rad/s], shape (P, 18).
        size: Filled with the sizes [m], shape (P, body.N_SIZE).
    """
    first = max(0, nearest_person(people, robot, geometry))
    for place in range(q.shape[0]):
        who = first if place == 0 else (place - 1 if place - 1 < first else place)
        _write_person(people, state, e, who, q[place], qd[place], size[place])


@kernel(inline="always")
def _write_person(
    people: People, state: PeopleState, e: int, who: int, q: Vec, qd: Vec, size: Vec
) -> None:
    """Write one person, workers first; a pedestrian as a person who faces the robot's base."""
    n_workers = state.q.shape[1]
    if who < n_workers:
        for j in range(18):
            q[j], qd[j] = state.q[e, who, j], state.qd[e, who, j]
        copy_values(state.size[e, who], size)
        return
    copy_values(people.bodies[0], size)
    for j in range(18):
        q[j], qd[j] = people.no_person[j], 0.0
    k = who - n_workers
    if k < state.cylinders.shape[1]:
        rows = state.walkers.rows
        x, y = rows[e, k, X], rows[e, k, Y]
        q[0], q[1], q[2] = x, y, math.atan2(-y, -x)
        qd[0], qd[1] = rows[e, k, VX], rows[e, k, VY]


@kernel()
def observe_people_of_envs(
    people: People,
    state: PeopleState,
    robots: Vec,
    envs: NDArray[np.int64],
    geometry: PeopleGeometry,
    q: Vec,
    qd: Vec,
    size: Vec,
) -> None:
    """Write the people of some environments (:func:`observe_people`).

    Args:
        robots: The robots' capsules, shape (n_envs, 9, n).
        envs: Indices of the environments, shape (k,).
        geometry: Work space.
        q: Filled with joints [m, rad], shape (k, P, 18).
        qd: Filled with joint speeds [m/s, rad/s], shape (k, P, 18).
        size: Filled with the sizes [m], shape (k, P, body.N_SIZE).
    """
    for k in range(envs.shape[0]):
        e = envs[k]
        place_people(people, state, e, geometry)
        observe_people(people, state, e, robots[e], geometry, q[k], qd[k], size[k])
