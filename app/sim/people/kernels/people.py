"""The people of a cell, compiled: where they are, how they move on, and as what shapes.

A cell holds up to four people: *workers*, 18-DoF bodies, and *walkers*, the vertical cylinders
of METHOD 2.1. Workers become twelve capsules each, in one set of columns; walkers stay
cylinders. A worker either follows a script, of synthetic reaches (``script.py``) or
task primitives (``primitives.py``), or a track: recorded motion, or any other given by samples.

People do not react to the robot, so that an episode's whole human motion is fixed when it
starts; unless they are yielding (METHOD 4): then a worker slows and leans away as the arm
comes close (``yielding.py``).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.core.kernels import rng as random
from app.sim.geometry.capsules import (
    capsule_clearances,
    copy_rows,
    copy_values,
    greatest_displacement,
    least,
)
from app.sim.geometry.cylinder import cylinder_clearance
from app.sim.geometry.segments import FAR
from app.sim.human.kernels import kinematics as body
from app.sim.people.kernels.pedestrian import (
    VX,
    VY,
    PedestrianRules,
    PedestrianState,
    R,
    X,
    Y,
    advance_pedestrian,
    start_pedestrian,
)
from app.sim.people.kernels.yielding import closeness, lean_away
from app.sim.primitives.kernels import script
from app.sim.primitives.kernels.primitives import (
    PrimitiveLibrary,
    SegmentState,
    condition,
    draw_segments,
    follow,
    law,
)

REACHES, LIBRARY = range(2)
"""What a worker's script is made of."""
SCRIPTED, ABSENT = -1, -2
"""In place of a track's number: a worker who follows a script, one who is not there."""
MAX_PEOPLE = 4
DEEPEST = 32
"""Halvings of a period in the contact test; enough for periods of hours."""


class Tracks(NamedTuple):
    """Motion of workers given by samples."""

    rows: Vec
    """Samples of all tracks, one after the other: joints [m, rad], and by how much the pelvis
    is higher than in standing [m], shape (n, 19)."""
    spans: NDArray[np.int64]
    """First sample, number of samples and body (-1: any) of each track, shape (n_tracks, 3)."""
    dt: float
    """Step between samples [s]."""
    needed: float
    """How long a track should go on after the start of an episode [s]."""


class People(NamedTuple):
    """What all environments share about their people."""

    bodies: Vec
    """Sizes of which each worker's is drawn [m], shape (n_bodies, body.N_SIZE)."""
    floor_z: float
    """Height of the floor [m]."""
    top_z: float
    """Height of the walkers' tops [m]."""
    columns: Vec
    """Template of the workers' capsules, shape (9, n); see ``body.capsule_columns``."""
    postures: Vec
    """The workers' library [m, rad], shape (n_postures, 18)."""
    hands: Vec
    """Palms of each posture [m], shape (n_postures, 2, 3)."""
    of_station: NDArray[np.int64]
    """First posture and count of each body, place and hand, (n_bodies, n_places + 1, 2, 2)."""
    n_cubes: int
    """Places that are cubes; they come first."""
    source: int
    """What the workers' scripts are made of: REACHES or LIBRARY."""
    primitive_library: PrimitiveLibrary
    """What they can do, for LIBRARY."""
    tracks: Tracks
    """What workers without a script do."""
    track_share: float
    """Chance that a worker follows a track in an episode."""
    absent_share: float
    """Chance that a worker is not there in an episode."""
    limits: Vec
    """Lower and upper joint limits of a worker [m, rad], shape (2, 18)."""
    yielding: float
    """How much the workers give way to the arm, from 0 to 1."""
    pace: float
    """Speed of the workers relative to their scripts."""
    walkers: PedestrianRules
    """How the walkers walk."""
    nobody: Vec
    """Posture of a person who stands too far away to matter [m, rad], shape (18,)."""


class PeopleState(NamedTuple):
    """Rows of the people of all environments; W workers, C walkers."""

    q: Vec
    """The workers' joints [m, rad], shape (n_envs, W, 18)."""
    qd: Vec
    """Their speeds [m/s, rad/s], shape (n_envs, W, 18)."""
    body: NDArray[np.int64]
    """Which of the bodies each worker has, shape (n_envs, W)."""
    size: Vec
    """Their sizes [m], shape (n_envs, W, body.N_SIZE)."""
    columns: Vec
    """Their capsules at this moment, shape (n_envs, 9, n)."""
    clock: Vec
    """Time in each worker's script or track [s], shape (n_envs, W)."""
    near: Vec
    """Each worker's distance to the robot as the contact test last saw it [m], (n_envs, W)."""
    lean: Vec
    """How far each worker leans away, ``yielding.lean_away`` [rad, rad/s], (n_envs, W, 4)."""
    track: NDArray[np.int64]
    """Track of each worker, SCRIPTED or ABSENT, shape (n_envs, W)."""
    legs: SegmentState
    """The legs of their scripts, for LIBRARY."""
    move: NDArray[np.int64]
    """The move of the script each worker is in, shape (n_envs, W)."""
    n_moves: NDArray[np.int64]
    """Moves in each worker's script, shape (n_envs, W)."""
    start: Vec
    """Start of each move [s], shape (n_envs, W, MAX_MOVES)."""
    duration: Vec
    """Duration of each move [s], shape (n_envs, W, MAX_MOVES)."""
    chosen: NDArray[np.int64]
    """Postures of the scripts, shape (n_envs, W, MAX_MOVES + 1)."""
    walkers: PedestrianState
    """The walkers, rows (n_envs, C)."""
    cylinders: Vec
    """The walkers' x, y and radius at this moment [m], shape (n_envs, C, 3)."""


class PeopleGeometry(NamedTuple):
    """Work space of one pose of all people; made once, filled again and again."""

    q: Vec
    """Joints of the workers [m, rad], shape (W, 18)."""
    size: Vec
    """Their sizes [m], shape (W, body.N_SIZE)."""
    pelvis_z: Vec
    """Heights of their pelvis when the period began and when it ends [m], shape (2, W)."""
    points: Vec
    """The workers' points [m], shape (W, N_POINTS, 3)."""
    frames: Vec
    """The workers' orientations, shape (W, N_FRAMES, 3, 3)."""
    trig: Vec
    """Sines, cosines and more, shape (3, 16)."""
    columns: Vec
    """The workers' capsules, shape (9, n)."""
    gap: Vec
    """Distance of each capsule to the robot [m], shape (n,)."""
    cylinders: Vec
    """The walkers' x, y and radius [m], shape (C, 3)."""
    q0: Vec
    """The workers' joints when the period began [m, rad], shape (W, 18)."""
    cylinders0: Vec
    """The walkers when the period began [m], shape (C, 3)."""
    robot_q: Vec
    """The robot's joints between the ends of the period [rad], shape (6,)."""
    away: Vec
    """How far a leg's sample is from its two ends [m, rad], shape (36,)."""
    seen_q: Vec
    """Joints of the person a policy looks at [m, rad], shape (18,)."""
    seen_qd: Vec
    """Their speeds [m/s, rad/s], shape (18,)."""
    seen_size: Vec
    """That person's size [m], shape (body.N_SIZE,)."""
    stack_end: Vec
    """Ends of the intervals the contact test has before it [s], shape (DEEPEST,)."""
    stack_clear: Vec
    """Clearances there [m], shape (DEEPEST, 3)."""


def new_people_geometry(people: People, n_workers: int, n_pedestrians: int) -> PeopleGeometry:
    """Return work space, not placed yet."""
    return PeopleGeometry(
        np.empty((n_workers, 18)),
        np.tile(people.bodies[0], (n_workers, 1)),
        np.zeros((2, n_workers)),
        np.empty((n_workers, body.N_POINTS, 3)),
        np.empty((n_workers, body.N_FRAMES, 3, 3)),
        np.empty((3, 16)),
        people.columns.copy(),
        np.empty(people.columns.shape[1]),
        np.empty((n_pedestrians, 3)),
        np.empty((n_workers, 18)),
        np.empty((n_pedestrians, 3)),
        np.empty(6),
        np.empty(36),
        np.empty(18),
        np.empty(18),
        people.bodies[0].copy(),
        np.empty(DEEPEST),
        np.empty((DEEPEST, 3)),
    )


@kernel(inline="always")
def place_workers(people: People, q: Vec, crowd: PeopleGeometry) -> None:
    """Fill the capsules of ``crowd`` for the workers' joints [m, rad], shape (W, 18).

    Their sizes are those of ``crowd.size``.
    """
    for w in range(q.shape[0]):
        points, frames, size = crowd.points[w], crowd.frames[w], crowd.size[w]
        body.points_and_frames(q[w], size, crowd.trig, points, frames)
        first = w * body.N_CAPSULES
        body.capsules(points, frames, size, people.floor_z, first, crowd.columns)


@kernel(inline="always")
def people_clearance(people: People, robot: Vec, crowd: PeopleGeometry) -> float:
    """Return the distance of robot and nearest person [m]; FAR where there is nobody.

    Args:
        people: Shared data.
        robot: The robot's capsules as columns, shape (9, n).
        crowd: Placed; ``gap`` is filled.
    """
    best = FAR
    if crowd.columns.shape[1] > 0:
        capsule_clearances(robot, crowd.columns, crowd.gap)
        best, _ = least(crowd.gap)
    for k in range(crowd.cylinders.shape[0]):
        x, y, r = crowd.cylinders[k, 0], crowd.cylinders[k, 1], crowd.cylinders[k, 2]
        d, _ = cylinder_clearance(robot, 0, x, y, r, people.top_z)
        best = min(best, d)
    return best


@kernel()
def people_speed_bound(before: Vec, after: Vec, start: Vec, end: Vec, dt: float) -> float:
    """Return a bound on the speed of any point of the people in a period [m/s].

    Workers: from the chords of the capsules' ends, with 5 % for the arc: enough for turns up to
    one radian per period. Walkers: walking and growing.

    Args:
        before: The workers' capsules at the start, shape (9, n).
        after: Their capsules at the end, shape (9, n).
        start: The walkers' x, y, radius at the start [m], shape (C, 3).
        end: The same at the end [m], shape (C, 3).
        dt: Period [s].
    """
    longest = 1.05 * greatest_displacement(before, after)
    for k in range(start.shape[0]):
        way = math.hypot(end[k, 0] - start[k, 0], end[k, 1] - start[k, 1])
        longest = max(longest, way + abs(end[k, 2] - start[k, 2]))
    return longest / dt


@kernel(inline="always")
def worker_at(
    people: People, state: PeopleState, e: int, w: int, when: float, rate: float, away: Vec
) -> None:
    """Write joints, speeds and height of worker ``w`` of environment ``e``.

    Args:
        people: Shared data.
        state: Rows; what the worker's place in the script needs is kept there too.
        e: Environment.
        w: Worker.
        when: Time in its script or track [s].
        rate: Script's seconds per second; scales the speeds.
        away: Work space, shape (36,).
    """
    if state.track[e, w] == ABSENT:
        for j in range(18):
            state.q[e, w, j], state.qd[e, w, j] = people.nobody[j], 0.0
        return
    if state.track[e, w] >= 0:
        _track_at(people, state, e, w, when, rate)
        return
    start, duration = state.start[e, w], state.duration[e, w]
    move, n = state.move[e, w], state.n_moves[e, w]
    while move + 1 < n and start[move + 1] <= when:
        move += 1
    state.move[e, w] = move
    chosen, q, qd = state.chosen[e, w], state.q[e, w], state.qd[e, w]
    before, after = people.postures[chosen[move]], people.postures[chosen[move + 1]]
    if people.source == REACHES:
        script.move_at(when, start[move], duration[move], before, after, rate, q, qd)
        return
    legs, shared = state.legs, people.primitive_library
    weights = legs.weights[e, w]
    if legs.ready[e, w] != move:
        sample, gain = legs.sample[e, w, move], shared.gain[legs.primitive[e, w, move]]
        condition(shared.samples[sample], gain, before, after, away, weights)
        legs.ready[e, w] = move
    stop = legs.stop[e, w, move]
    phase, speed = law(when - start[move], duration[move], stop[0], stop[1])
    follow(weights, phase, rate * speed, people.limits[0], people.limits[1], q, qd)


@kernel(inline="always")
def _track_at(
    people: People, state: PeopleState, e: int, w: int, when: float, rate: float
) -> None:
    """Write a worker's state on its track; past the end it stands still."""
    tracks, span = people.tracks, people.tracks.spans[state.track[e, w]]
    last = float(span[1] - 1)
    at = max(0.0, when / tracks.dt)
    moving = at < last
    at = min(at, last)
    k = min(int(at), max(span[1] - 2, 0))
    part, first = at - k, span[0] + k
    after = tracks.rows[first + 1 if span[1] > 1 else first]
    before, speed = tracks.rows[first], rate / tracks.dt if moving else 0.0
    for j in range(18):
        way = after[j] - before[j]
        state.q[e, w, j], state.qd[e, w, j] = before[j] + part * way, speed * way
    rise = before[18] + part * (after[18] - before[18])
    standing = people.bodies[state.body[e, w], body.PELVIS_Z]
    state.size[e, w, body.PELVIS_Z] = standing + rise


@kernel(inline="always")
def _draw_work(people: People, state: PeopleState, e: int, w: int, rng: random.State) -> None:
    """Draw what worker ``w`` of environment ``e`` does, and where in it the episode begins."""
    who = random.below(rng, people.bodies.shape[0]) if people.bodies.shape[0] > 1 else 0
    state.track[e, w] = SCRIPTED
    if people.absent_share > 0.0 and random.uniform(rng) < people.absent_share:
        state.track[e, w] = ABSENT
    elif people.track_share > 0.0 and random.uniform(rng) < people.track_share:
        track = random.below(rng, people.tracks.spans.shape[0])
        state.track[e, w], span = track, people.tracks.spans[track]
        spare = people.tracks.dt * (span[1] - 1) - people.tracks.needed
        state.clock[e, w] = max(0.0, spare) * random.uniform(rng)
        who = span[2] if span[2] >= 0 else who
    elif people.source == LIBRARY:
        legs = state.legs
        state.n_moves[e, w] = draw_segments(
            rng, people.primitive_library, people.of_station[who], people.n_cubes, -1,
            state.start[e, w], state.duration[e, w], state.chosen[e, w],
            legs.primitive[e, w], legs.sample[e, w], legs.stop[e, w],
        )  # fmt: skip
        state.clock[e, w] = (
            12.0 * random.uniform(rng) if people.primitive_library.varied else 0.0
        )
        legs.ready[e, w] = -1
    else:
        state.n_moves[e, w] = script.draw_script(
            rng, people.of_station[who], people.of_station.shape[1] - 1, people.n_cubes,
            people.hands, -1, state.start[e, w], state.duration[e, w], state.chosen[e, w],
        )  # fmt: skip
        state.clock[e, w] = 12.0 * random.uniform(rng)
    state.body[e, w], state.move[e, w], state.near[e, w] = who, 0, FAR
    copy_values(people.bodies[who], state.size[e, w])
    for i in range(4):
        state.lean[e, w, i] = 0.0


@kernel()
def start_people(
    people: People, state: PeopleState, e: int, rng: random.State, crowd: PeopleGeometry
) -> None:
    """Draw an episode of all people of environment ``e`` and place them."""
    for w in range(state.q.shape[1]):
        _draw_work(people, state, e, w, rng)
        worker_at(people, state, e, w, state.clock[e, w], people.pace, crowd.away)
    for k in range(state.cylinders.shape[1]):
        start_pedestrian(people.walkers, state.walkers, e, k, rng)
        _keep_cylinder(state, e, k)
    place_people(people, state, e, crowd)


@kernel(inline="always")
def advance_people(
    people: People, state: PeopleState, e: int, robot: Vec, dt: float, away: Vec
) -> None:
    """Move the people of environment ``e`` on by one period.

    Args:
        people: Shared data.
        state: Rows; the joints and cylinders of row ``e`` are written.
        e: Environment.
        robot: The robot's capsules when the period begins, shape (9, n).
        dt: Period [s].
        away: Work space, shape (36,).
    """
    for w in range(state.q.shape[1]):
        strength = people.yielding * closeness(state.near[e, w])
        rate = people.pace * (1.0 - strength)
        state.clock[e, w] += rate * dt
        worker_at(people, state, e, w, state.clock[e, w], rate, away)
        if people.yielding > 0.0:
            lean_away(
                state.q[e, w], state.qd[e, w], state.lean[e, w], strength, robot,
                people.limits[0], people.limits[1], dt,
            )  # fmt: skip
    for k in range(state.cylinders.shape[1]):
        advance_pedestrian(people.walkers, state.walkers, e, k, dt)
        _keep_cylinder(state, e, k)


@kernel(inline="always")
def keep_distances(state: PeopleState, e: int, crowd: PeopleGeometry) -> None:
    """Remember how near each worker of environment ``e`` came, from ``crowd.gap``."""
    for w in range(state.q.shape[1]):
        part = crowd.gap[w * body.N_CAPSULES : (w + 1) * body.N_CAPSULES]
        state.near[e, w], _ = least(part)


@kernel(inline="always")
def _keep_cylinder(state: PeopleState, e: int, k: int) -> None:
    rows = state.walkers.rows
    state.cylinders[e, k, 0], state.cylinders[e, k, 1] = rows[e, k, X], rows[e, k, Y]
    state.cylinders[e, k, 2] = rows[e, k, R]


@kernel(inline="always")
def place_people(people: People, state: PeopleState, e: int, crowd: PeopleGeometry) -> None:
    """Fill ``crowd`` with the people of environment ``e`` as they are now."""
    copy_rows(state.size[e], crowd.size)
    place_workers(people, state.q[e], crowd)
    copy_rows(state.cylinders[e], crowd.cylinders)


@kernel()
def person_clearance(people: People, robot: Vec, crowd: PeopleGeometry, who: int) -> float:
    """Return the distance of robot and one person [m]: workers first, then walkers.

    Args:
        people: Shared data.
        robot: The robot's capsules as columns, shape (9, n).
        crowd: The people, placed; for a worker ``gap`` is filled already.
        who: The person.
    """
    k = who - crowd.q.shape[0]
    if k < 0:
        part = crowd.gap[who * body.N_CAPSULES : (who + 1) * body.N_CAPSULES]
        return float(least(part)[0])
    x, y, r = crowd.cylinders[k, 0], crowd.cylinders[k, 1], crowd.cylinders[k, 2]
    return float(cylinder_clearance(robot, 0, x, y, r, people.top_z)[0])


@kernel()
def nearest_person(people: People, robot: Vec, crowd: PeopleGeometry) -> int:
    """Return the person nearest to the robot: workers first, then walkers; -1 for nobody.

    Args:
        people: Shared data.
        robot: The robot's capsules as columns, shape (9, n).
        crowd: The people, placed.
    """
    n_workers, n_pedestrians = crowd.q.shape[0], crowd.cylinders.shape[0]
    if n_workers + n_pedestrians < 2:
        return int(n_workers + n_pedestrians - 1)
    best, nearest = FAR, 0
    if n_workers > 0:
        capsule_clearances(robot, crowd.columns, crowd.gap)
    for who in range(n_workers + n_pedestrians):
        d = person_clearance(people, robot, crowd, who)
        if d < best:
            best, nearest = d, who
    return nearest


@kernel(inline="always")
def see_nearest(
    people: People, state: PeopleState, e: int, robot: Vec, crowd: PeopleGeometry
) -> None:
    """Write the nearest person of environment ``e`` into ``crowd.seen_q``, ``_qd``, ``_size``.

    A walker is seen as a person who stands in the cylinder, facing the robot's base; nobody, as
    one who stands too far away to matter. So a policy for one 18-DoF person works beside any.

    Args:
        people: Shared data.
        state: Rows of the people.
        e: Environment.
        robot: The robot's capsules as columns, shape (9, n).
        crowd: The people, placed as they are now.
    """
    who, n_workers = nearest_person(people, robot, crowd), state.q.shape[1]
    if 0 <= who < n_workers:
        for j in range(18):
            crowd.seen_q[j], crowd.seen_qd[j] = state.q[e, who, j], state.qd[e, who, j]
        copy_values(state.size[e, who], crowd.seen_size)
        return
    copy_values(people.bodies[0], crowd.seen_size)
    for j in range(18):
        crowd.seen_q[j], crowd.seen_qd[j] = people.nobody[j], 0.0
    if who >= 0:
        rows, k = state.walkers.rows, who - n_workers
        x, y = rows[e, k, X], rows[e, k, Y]
        crowd.seen_q[0], crowd.seen_q[1], crowd.seen_q[2] = x, y, math.atan2(-y, -x)
        crowd.seen_qd[0], crowd.seen_qd[1] = rows[e, k, VX], rows[e, k, VY]


@kernel()
def see_rows(
    people: People,
    state: PeopleState,
    robots: Vec,
    rows: NDArray[np.int64],
    crowd: PeopleGeometry,
    q: Vec,
    qd: Vec,
    size: Vec,
) -> None:
    """Apply :func:`see_nearest` to some environments.

    Args:
        people: Shared data.
        state: Rows of the people.
        robots: The robots' capsules, shape (n_envs, 9, n).
        rows: Which environments, shape (k,).
        crowd: Work space.
        q: Filled with the joints of the person seen [m, rad], shape (k, 18).
        qd: Filled with the speeds [m/s, rad/s], shape (k, 18).
        size: Filled with the sizes [m], shape (k, body.N_SIZE).
    """
    for k in range(rows.shape[0]):
        e = rows[k]
        place_people(people, state, e, crowd)
        see_nearest(people, state, e, robots[e], crowd)
        copy_values(crowd.seen_q, q[k])
        copy_values(crowd.seen_qd, qd[k])
        copy_values(crowd.seen_size, size[k])


@kernel()
def record_palms(
    people: People,
    state: PeopleState,
    seed: int,
    script_number: int,
    rng: random.State,
    robot: Vec,
    dt: float,
    crowd: PeopleGeometry,
    palms: Vec,
) -> None:
    """Write where the workers' palms are over a time that begins like an episode.

    Args:
        people: Shared data.
        state: Rows; row 0 is used.
        seed: Seed of the stream.
        script_number: Number of the stream.
        rng: Work space for it, shape (1,).
        robot: The robot's capsules, shape (9, n), for people who mind it.
        dt: Time between samples [s].
        crowd: Work space.
        palms: Filled [m], shape (n_samples, W, 2, 3).
    """
    random.start_stream(seed, 1 << 20, script_number, rng)
    start_people(people, state, 0, rng, crowd)
    for k in range(palms.shape[0]):
        advance_people(people, state, 0, robot, dt, crowd.away)
        place_people(people, state, 0, crowd)
        for w in range(palms.shape[1]):
            for i in range(3):
                palms[k, w, 0, i] = crowd.points[w, body.HAND_R, i]
                palms[k, w, 1, i] = crowd.points[w, body.HAND_L, i]
