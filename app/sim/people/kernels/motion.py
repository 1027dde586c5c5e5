"""Motion of the people in a cell (compiled).

A worker follows a script, of synthetic reaches (``primitives/kernels/script.py``) or of task
primitives (``primitives/kernels/primitives.py``), or a track: recorded or other sampled motion.
People do not react to the robot, so that the human motion of an episode is fixed at its start;
with yielding above 0 (docs/method.md 4) a worker slows and leans away near the arm
(``yielding.py``).
"""

from app.sim.core.arrays import Vec
from app.sim.core.jit import FAR, kernel
from app.sim.core.kernels import rng as random
from app.sim.geometry.capsules import copy_values
from app.sim.human.kernels import kinematics as body
from app.sim.people.kernels.pedestrian import R, X, Y, advance_pedestrian, start_pedestrian
from app.sim.people.kernels.people import (
    ABSENT,
    LIBRARY,
    REACHES,
    SCRIPTED,
    People,
    PeopleGeometry,
    PeopleState,
    place_people,
)
from app.sim.people.kernels.yielding import closeness, lean_away
from app.sim.primitives.kernels.primitives import (
    Segments,
    condition,
    draw_segments,
    follow,
    phase_profile,
)
from app.sim.primitives.kernels.script import Moves, draw_script, move_at

REST_AFTER = (-3.0, 5.0)
"""Range of the time at which a worker stands still [s]; below 0: from the start on."""
REST_S = (5.0, 20.0)
"""Range of the time for which a worker stands still [s]."""


@kernel(inline="always")
def _rests(rest: Vec, dt: float) -> bool:
    """Return whether a worker stands still in the period to come, and count its time down.

    Args:
        rest: Time until the worker stands still, and time left of that [s], shape (2,).
        dt: Period [s].
    """
    if rest[1] <= 0.0:
        return False
    if rest[0] > 0.0:
        rest[0] -= dt
        return False
    rest[1] -= dt
    return True


@kernel(inline="always")
def worker_at(
    people: People, state: PeopleState, e: int, w: int, when: float, rate: float, away: Vec
) -> None:
    """Write joints, joint speeds and pelvis height of one worker.

    Args:
        state: People of all environments; the worker's position in its script is updated too.
        e: Environment.
        w: Worker.
        when: Time in its script or track [s].
        rate: Script time per time; scales the speeds.
        away: Work space, shape (36,).
    """
    if state.track[e, w] == ABSENT:
        for j in range(18):
            state.q[e, w, j], state.qd[e, w, j] = people.no_person[j], 0.0
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
        move_at(when, start[move], duration[move], before, after, rate, q, qd)
        return
    segments, library = state.segments, people.primitive_library
    weights = segments.weights[e, w]
    if segments.ready[e, w] != move:
        sample = library.samples[segments.sample[e, w, move]]
        gain = library.gain[segments.primitive[e, w, move]]
        condition(sample, gain, before, after, away, weights)
        segments.ready[e, w] = move
    stop = segments.stop[e, w, move]
    phase, speed = phase_profile(when - start[move], duration[move], stop[0], stop[1])
    follow(weights, phase, rate * speed, people.limits[0], people.limits[1], q, qd)


@kernel(inline="always")
def _track_at(
    people: People, state: PeopleState, e: int, w: int, when: float, rate: float
) -> None:
    """Write a worker's state on its track, at rest after the end."""
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
        change = after[j] - before[j]
        state.q[e, w, j], state.qd[e, w, j] = before[j] + part * change, speed * change
    rise = before[18] + part * (after[18] - before[18])
    standing = people.bodies[state.body[e, w], body.PELVIS_Z]
    state.size[e, w, body.PELVIS_Z] = standing + rise


@kernel(inline="always")
def _draw_work(people: People, state: PeopleState, e: int, w: int, rng: random.State) -> None:
    """Draw the size and motion of one worker, and the time at which the episode enters it."""
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
    else:
        draw_script_of(people, state, e, w, who, -1, rng)
        varied = people.source == REACHES or people.primitive_library.varied
        state.clock[e, w] = 12.0 * random.uniform(rng) if varied else 0.0
    state.pace[e, w] = people.pace
    if people.pace_max > people.pace:
        state.pace[e, w] += random.uniform(rng) ** 2 * (people.pace_max - people.pace)
    state.rest[e, w, 0], state.rest[e, w, 1] = 0.0, 0.0
    if people.rest_share > 0.0 and random.uniform(rng) < people.rest_share:
        state.rest[e, w, 0] = REST_AFTER[0] + random.uniform(rng) * (
            REST_AFTER[1] - REST_AFTER[0]
        )
        state.rest[e, w, 1] = REST_S[0] + random.uniform(rng) * (REST_S[1] - REST_S[0])
    state.body[e, w], state.move[e, w], state.near[e, w] = who, 0, FAR
    copy_values(people.bodies[who], state.size[e, w])
    for i in range(4):
        state.lean[e, w, i] = 0.0


@kernel()
def draw_script_of(
    people: People, state: PeopleState, e: int, w: int, who: int, first: int, rng: random.State
) -> None:
    """Draw a script for one worker.

    Args:
        state: People of all environments; the script of the worker is written.
        e: Environment.
        w: Worker.
        who: Index of the worker's body.
        first: Initial posture, at home; -1 draws one.
    """
    moves = Moves(state.start[e, w], state.duration[e, w], state.chosen[e, w])
    of_station, n_cubes, stored = people.of_station[who], people.n_cubes, state.segments
    if people.source == LIBRARY:
        segments = Segments(stored.primitive[e, w], stored.sample[e, w], stored.stop[e, w])
        state.n_moves[e, w] = draw_segments(
            rng, people.primitive_library, of_station, n_cubes, first, moves, segments
        )
        stored.ready[e, w] = -1
    else:
        state.n_moves[e, w] = draw_script(rng, of_station, n_cubes, people.hands, first, moves)
    state.move[e, w] = 0


@kernel()
def start_people(
    people: People, state: PeopleState, e: int, rng: random.State, geometry: PeopleGeometry
) -> None:
    """Draw the human motion of an episode and place all people at its start."""
    for w in range(state.q.shape[1]):
        _draw_work(people, state, e, w, rng)
        worker_at(people, state, e, w, state.clock[e, w], state.pace[e, w], geometry.away)
    for k in range(state.cylinders.shape[1]):
        start_pedestrian(people.walkers, state.walkers, e, k, rng)
        _copy_cylinder(state, e, k)
    place_people(people, state, e, geometry)


@kernel(inline="always")
def advance_people(
    people: People, state: PeopleState, e: int, robot: Vec, dt: float, away: Vec
) -> None:
    """Advance the people of one environment by one control period.

    Args:
        state: People of all environments; joints and cylinders are written.
        e: Environment.
        robot: The robot's capsules at the start of the period, shape (9, n).
        dt: Period [s].
        away: Work space, shape (36,).
    """
    for w in range(state.q.shape[1]):
        strength = people.yielding * closeness(state.near[e, w])
        rate = 0.0 if _rests(state.rest[e, w], dt) else state.pace[e, w] * (1.0 - strength)
        state.clock[e, w] += rate * dt
        worker_at(people, state, e, w, state.clock[e, w], rate, away)
        if people.yielding > 0.0:
            lean = state.lean[e, w]
            lean_away(state.q[e, w], state.qd[e, w], lean, strength, robot, people.limits, dt)
    for k in range(state.cylinders.shape[1]):
        advance_pedestrian(people.walkers, state.walkers, e, k, dt)
        _copy_cylinder(state, e, k)


@kernel(inline="always")
def _copy_cylinder(state: PeopleState, e: int, k: int) -> None:
    rows = state.walkers.rows
    state.cylinders[e, k, 0], state.cylinders[e, k, 1] = rows[e, k, X], rows[e, k, Y]
    state.cylinders[e, k, 2] = rows[e, k, R]


@kernel()
def record_palms(
    people: People,
    state: PeopleState,
    rng: random.State,
    robot: Vec,
    dt: float,
    geometry: PeopleGeometry,
    palms: Vec,
) -> None:
    """Record the workers' palms over the start of an episode.

    Args:
        state: People of all environments; environment 0 is used.
        robot: The robot's capsules, shape (9, n).
        dt: Time between samples [s].
        geometry: Work space.
        palms: Filled with palm positions [m], shape (n_samples, W, 2, 3).
    """
    start_people(people, state, 0, rng, geometry)
    for k in range(palms.shape[0]):
        advance_people(people, state, 0, robot, dt, geometry.away)
        place_people(people, state, 0, geometry)
        for w in range(palms.shape[1]):
            for i in range(3):
                palms[k, w, 0, i] = geometry.points[w, body.HAND_R, i]
                palms[k, w, 1, i] = geometry.points[w, body.HAND_L, i]
