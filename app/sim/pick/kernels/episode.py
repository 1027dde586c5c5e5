"""The pick scenario, batched: episodes, steps, ends and rewards (METHOD 3.2, 3.3), compiled.

Every environment is a row of the arrays in :class:`PickState`. An episode is fixed by (seed,
environment, episode): target, start, the person's script and its phase; stepping draws nothing.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.collision.kernels.contact import clearances
from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.core.kernels import rng as random
from app.sim.geometry.capsules import copy_values
from app.sim.people.kernels.motion import start_people
from app.sim.people.kernels.people import (
    People,
    PeopleGeometry,
    PeopleState,
    new_people_geometry,
    place_people,
    see_nearest,
)
from app.sim.pick.kernels.observation import Obs, Sight, new_sight, observe
from app.sim.pick.kernels.reward import RewardWeights, reward
from app.sim.robot.kernels import kinematics
from app.sim.robot.kernels.actions import MYOPIC, ActionRule
from app.sim.robot.kernels.arm import (
    CONTROLLED,
    Arm,
    RobotPose,
    copy_capsules,
    new_robot_pose,
    place_robot,
    robot_tilt,
    tcp_speed,
)
from app.sim.scenario.kernels.episode import (
    COLLISION,
    PLAIN,
    RUNNING,
    START_TRIES,
    SUCCESS,
    SUCCESS_DISTANCE,
    TIMEOUT,
    UNFEASIBLE,
    distance_to,
    move,
)

Indices = NDArray[np.int64]
N_PLAIN = 51
"""Length of the plain observation: q, qd, the person's q, qd, target (5.8)."""
SUCCESS_TILT = 0.2
"""Tool axis to the vertical [rad], thesis 5.3.1."""
SUCCESS_SPEED = 0.1
"""tcp speed [m/s], thesis 5.3.1."""
MAX_CANDIDATES = 3
"""Most targets an episode offers (METHOD 3.6)."""


class PickWorld(NamedTuple):
    """What all environments share."""

    stations: Vec
    """Positions of the stations, cubes first [m], shape (n_stations, 3)."""
    station_q: Vec
    """Vertical-tool postures at the stations [rad], shape (n_stations, 6)."""
    n_cubes: int
    """Number of cubes."""
    arm: Arm
    """The robot in its cell."""
    people: People
    """The people in the cell."""


class PickRules(NamedTuple):
    """How episodes start and end."""

    time_limit: float
    """Longest episode [s]."""
    short_limit: float
    """Time left at the start of the short episodes [s]."""
    short_share: float
    """Share of episodes that start with only ``short_limit`` left."""
    start_clearance: float
    """Least distance of robot and person at the start [m]."""
    target_jitter: float
    """Half width of the box around a station from which targets are drawn [m]."""
    way_share: float
    """Share of episodes that start part of the way to the target."""
    n_candidates_min: int
    """Fewest targets offered."""
    n_candidates_max: int
    """Most targets offered."""


class PickState(NamedTuple):
    """Rows of all environments."""

    q: Vec
    """Joint positions [rad], shape (n_envs, 6)."""
    qd: Vec
    """Joint speeds [rad/s], shape (n_envs, 6)."""
    qdd: Vec
    """Joint accelerations [rad/s^2], shape (n_envs, 6)."""
    robot: Vec
    """The robot's capsules at this moment, shape (n_envs, 9, n)."""
    people: PeopleState
    """Rows of the people."""
    goal: Vec
    """Target being pursued [m], shape (n_envs, 3)."""
    q_goal: Vec
    """Posture at the target [rad], shape (n_envs, 6)."""
    candidates: NDArray[np.int64]
    """Stations offered, -1 where there are fewer, shape (n_envs, MAX_CANDIDATES)."""
    time_left: Vec
    """Time left [s], shape (n_envs,)."""
    elapsed: Vec
    """Time since the start [s], shape (n_envs,)."""
    distance: Vec
    """tcp to target [m], shape (n_envs,)."""
    tilt: Vec
    """Tool axis to the vertical [rad], shape (n_envs,)."""
    episode: NDArray[np.int64]
    """Number of the present episode, shape (n_envs,)."""
    outcome: NDArray[np.int64]
    """How the present episode stands (RUNNING ...), shape (n_envs,)."""
    clear: Vec
    """Distances to people, cell and the robot itself [m], shape (n_envs, 3)."""
    n_redrawn: NDArray[np.int64]
    """Starts rejected for want of clearance, shape (n_envs,)."""


class Work(NamedTuple):
    """Work space of one thread; made once per batch, used row after row."""

    robot: RobotPose
    """A pose of the robot."""
    crowd: PeopleGeometry
    """A pose of the people."""
    sight: Sight
    """What an observation looks at."""
    c: Vec
    """Second coefficients of a period [rad/s^2], shape (6,)."""
    d: Vec
    """Third coefficients of a period [rad/s^3], shape (6,)."""
    q: Vec
    """Joints at the end of a period [rad], shape (6,)."""
    qd: Vec
    """Joint speeds at the end of a period [rad/s], shape (6,)."""
    qdd: Vec
    """Joint accelerations at the end of a period [rad/s^2], shape (6,)."""
    rng: random.State
    """Random stream of the episode that starts, shape (1,)."""


def new_work(world: PickWorld, state: PickState) -> Work:
    """Return work space for a batch."""
    people = state.people
    return Work(
        new_robot_pose(world.arm),
        new_people_geometry(world.people, people.q.shape[1], people.cylinders.shape[1]),
        new_sight(),
        np.zeros(6),
        np.zeros(6),
        np.zeros(6),
        np.zeros(6),
        np.zeros(6),
        np.zeros(1, dtype=np.uint64),
    )


@kernel()
def set_goal(world: PickWorld, state: PickState, e: int, goal: Vec, robot: RobotPose) -> None:
    """Give environment ``e`` a new target [m], shape (3,); the way to it is measured anew."""
    arm = world.arm
    for i in range(3):
        state.goal[e, i] = goal[i]
    kinematics.ik_vertical(arm.lengths, arm.limits, goal, state.q_goal[e])
    place_robot(arm, state.q[e], robot)
    state.distance[e] = distance_to(goal, robot)


@kernel()
def _draw_candidates(
    world: PickWorld, rules: PickRules, state: PickState, e: int, rng: random.State
) -> None:
    n_stations = world.stations.shape[0]
    spread = rules.n_candidates_max - rules.n_candidates_min + 1
    n = rules.n_candidates_min + random.below(rng, spread)
    for i in range(MAX_CANDIDATES):
        state.candidates[e, i] = -1
    for i in range(n):
        while True:
            station = random.below(rng, n_stations)
            fresh = True
            for k in range(i):
                fresh = fresh and state.candidates[e, k] != station
            if fresh:
                break
        state.candidates[e, i] = station


@kernel()
def _draw_start(
    world: PickWorld, rules: PickRules, state: PickState, e: int, rng: random.State
) -> None:
    """Draw the robot's start: home, a cube or a dock in equal shares, never a candidate."""
    n_stations = world.stations.shape[0]
    while True:
        kind = random.below(rng, 3)
        if kind == 0:
            copy_values(world.arm.home, state.q[e])
            break
        station = random.below(rng, world.n_cubes)
        if kind == 2:
            station = world.n_cubes + random.below(rng, n_stations - world.n_cubes)
        offered = False
        for i in range(MAX_CANDIDATES):
            offered = offered or state.candidates[e, i] == station
        if not offered:
            copy_values(world.station_q[station], state.q[e])
            break
    if random.uniform(rng) < rules.way_share:
        u = random.uniform(rng)
        for j in range(CONTROLLED):
            state.q[e, j] += u * (state.q_goal[e, j] - state.q[e, j])
    for j in range(6):
        state.qd[e, j], state.qdd[e, j] = 0.0, 0.0


@kernel(inline="always")
def reset_env(
    world: PickWorld,
    rules: PickRules,
    seed: int,
    first_env: int,
    state: PickState,
    e: int,
    work: Work,
) -> None:
    """Start the next episode of environment ``e``."""
    rng = work.rng
    random.start_stream(seed, first_env + e, state.episode[e], rng)
    _draw_candidates(world, rules, state, e, rng)
    goal = state.goal[e]
    copy_values(world.stations[state.candidates[e, 0]], goal)
    for i in range(3):
        goal[i] += rules.target_jitter * (2.0 * random.uniform(rng) - 1.0)
    arm = world.arm
    kinematics.ik_vertical(arm.lengths, arm.limits, goal, state.q_goal[e])
    short = random.uniform(rng) < rules.short_share
    state.time_left[e] = rules.short_limit if short else rules.time_limit
    for attempt in range(START_TRIES):
        _draw_start(world, rules, state, e, rng)
        place_robot(arm, state.q[e], work.robot)
        start_people(world.people, state.people, e, rng, work.crowd)
        clear = clearances(arm, world.people, work.robot, work.crowd)
        state.clear[e, 0], state.clear[e, 1], state.clear[e, 2] = clear
        state.n_redrawn[e] = attempt
        if clear[0] >= rules.start_clearance and min(clear[1], clear[2]) > 0.0:
            break
    state.distance[e] = distance_to(goal, work.robot)
    state.tilt[e] = robot_tilt(work.robot)
    copy_capsules(work.robot.columns, state.robot[e])
    copy_capsules(work.crowd.columns, state.people.columns[e])
    state.elapsed[e] = 0.0
    state.outcome[e] = RUNNING


@kernel()
def succeeded(distance: float, tilt: float, speed: float) -> bool:
    """Whether the tool is where it should be, upright and at rest (thesis 5.3.1)."""
    return distance < SUCCESS_DISTANCE and tilt < SUCCESS_TILT and speed < SUCCESS_SPEED


@kernel(inline="always")
def step_env(
    world: PickWorld,
    action: ActionRule,
    weights: RewardWeights,
    state: PickState,
    e: int,
    act: NDArray[np.float32],
    work: Work,
) -> float:
    """Move environment ``e`` through one period, set its outcome, return the reward."""
    collided, unfeasible = move(world.arm, world.people, action, state, e, act, work)
    robot = work.robot
    d_old, tilt_old = state.distance[e], state.tilt[e]
    d, tilt = distance_to(state.goal[e], robot), robot_tilt(robot)
    state.distance[e], state.tilt[e] = d, tilt
    near = max(SUCCESS_DISTANCE, weights.d_v)
    speed = tcp_speed(robot, work.qd) if d <= near else 0.0
    success = not collided and succeeded(d, tilt, speed)
    if collided:
        state.outcome[e] = COLLISION
    elif success:
        state.outcome[e] = SUCCESS
    elif unfeasible and action.bounds == MYOPIC:
        state.outcome[e] = UNFEASIBLE
    elif state.time_left[e] <= 1e-9:
        state.outcome[e] = TIMEOUT
    return reward(d_old, d, tilt_old, tilt, speed, collided, success, weights)


@kernel(inline="always")
def _write_obs(
    world: PickWorld, state: PickState, e: int, work: Work, view: int, out: Obs
) -> None:
    """Write the observation of environment ``e``.

    With several people the nearest one is described.

    Args:
        world: Shared data.
        state: Rows.
        e: Environment.
        work: Robot and people are placed in it as they are now.
        view: PLAIN (the state of (5.8), ``N_PLAIN`` numbers) or FEATURES.
        out: Filled, shape (N_PLAIN,) or (N_FEATURES,).
    """
    crowd = work.crowd
    see_nearest(world.people, state.people, e, work.robot.columns, crowd)
    if view == PLAIN:
        for j in range(6):
            out[j], out[6 + j] = state.q[e, j], state.qd[e, j]
        for j in range(18):
            out[12 + j], out[30 + j] = crowd.seen_q[j], crowd.seen_qd[j]
        for i in range(3):
            out[48 + i] = state.goal[e, i]
        return
    observe(
        world.arm,
        world.people.floor_z,
        state.q[e],
        state.qd[e],
        crowd.seen_q,
        crowd.seen_qd,
        crowd.seen_size,
        state.goal[e],
        state.q_goal[e],
        state.time_left[e],
        work.robot,
        work.sight,
        out,
    )


@kernel(nogil=True)
def observe_rows(
    world: PickWorld, state: PickState, rows: Indices, work: Work, view: int, out: Obs
) -> None:
    """Write the observations of some environments.

    Args:
        world: Shared data.
        state: Rows.
        rows: Which environments, shape (k,).
        work: Work space.
        view: PLAIN or FEATURES.
        out: Filled, shape (k, F).
    """
    for k in range(rows.shape[0]):
        place_robot(world.arm, state.q[rows[k]], work.robot)
        place_people(world.people, state.people, rows[k], work.crowd)
        _write_obs(world, state, rows[k], work, view, out[k])


@kernel(nogil=True)
def reset_rows(
    world: PickWorld,
    rules: PickRules,
    seed: int,
    first_env: int,
    state: PickState,
    rows: Indices,
    work: Work,
) -> None:
    """Start an episode in some environments, shape (k,)."""
    for e in rows:
        reset_env(world, rules, seed, first_env, state, e, work)


@kernel(nogil=True)
def step_batch(
    world: PickWorld,
    rules: PickRules,  # noqa: ARG001 - the reach scenario's needs them
    action: ActionRule,
    weights: RewardWeights,
    state: PickState,
    work: Work,
    act: NDArray[np.float32],
    rew: NDArray[np.float32],
    ended: NDArray[np.int64],
) -> None:
    """Step all environments; rows that have ended stay as they are.

    Args:
        world: Shared data.
        rules: Not read; the kernels of both scenarios take the same arguments.
        action: What actions mean.
        weights: Reward coefficients.
        state: Rows; changed.
        work: Work space.
        act: Actions in [-1, 1], shape (n_envs, 5).
        rew: Filled with rewards, shape (n_envs,).
        ended: Filled with the outcome of rows that ended now, RUNNING elsewhere.
    """
    for e in range(state.q.shape[0]):
        ended[e], rew[e] = RUNNING, 0.0
        if state.outcome[e] == RUNNING:
            rew[e] = step_env(world, action, weights, state, e, act[e], work)
            ended[e] = state.outcome[e]
