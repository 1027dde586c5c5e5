"""The pick scenario, batched: episodes, steps, ends and rewards (METHOD 3.2, 3.3), compiled.

Every environment is a row of the arrays in :class:`PickState`. An episode is fixed by (seed,
environment, episode): target, start, the person's script and its phase; stepping draws nothing.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from app.sim.kernels import kinematics, random, script
from app.sim.kernels.arm import (
    CONTROLLED,
    NO_CONTACT,
    Arm,
    Pose,
    human_clearance,
    new_pose,
    place,
    sweep,
)
from app.sim.kernels.features import N_COARSE, Obs, observe
from app.sim.kernels.polynomial import advance
from app.sim.kernels.reward import RewardWeights, reward
from app.sim.ports import Vec

RUNNING, SUCCESS, COLLISION, TIMEOUT = range(4)
SUCCESS_DISTANCE = 0.1
"""tcp to target [m], thesis 5.3.1."""
SUCCESS_TILT = 0.2
"""Tool axis to the vertical [rad], thesis 5.3.1."""
SUCCESS_SPEED = 0.1
"""tcp speed [m/s], thesis 5.3.1."""
MAX_CANDIDATES = 3
"""Most targets an episode offers (METHOD 3.6)."""
START_TRIES = 200
"""Starts drawn before the last one is taken whatever its clearance."""


class PickWorld(NamedTuple):
    """What all environments share."""

    stations: Vec
    """Positions of the stations, cubes first [m], shape (n_stations, 3)."""
    station_q: Vec
    """Vertical-tool postures at the stations [rad], shape (n_stations, 6)."""
    n_cubes: int
    """Number of cubes."""
    postures: Vec
    """The person's library [m, rad], shape (n_postures, 18)."""
    hands: Vec
    """Palms of each posture [m], shape (n_postures, 2, 3)."""
    of_station: NDArray[np.int64]
    """First posture and count of each place and hand, shape (n_stations + 1, 2, 2)."""


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
    human_pace: float
    """Speed of the person relative to the script."""


class PickState(NamedTuple):
    """Rows of all environments."""

    q: Vec
    """Joint positions [rad], shape (n_envs, 6)."""
    qd: Vec
    """Joint speeds [rad/s], shape (n_envs, 6)."""
    human_q: Vec
    """The person's joints [m, rad], shape (n_envs, 18)."""
    human_qd: Vec
    """The person's joint speeds [m/s, rad/s], shape (n_envs, 18)."""
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
    phase: Vec
    """Time in the person's script at the start [s], shape (n_envs,)."""
    n_moves: NDArray[np.int64]
    """Moves in the person's script, shape (n_envs,)."""
    start: Vec
    """Start of each move [s], shape (n_envs, MAX_MOVES)."""
    duration: Vec
    """Duration of each move [s], shape (n_envs, MAX_MOVES)."""
    chosen: NDArray[np.int64]
    """Postures of the script, shape (n_envs, MAX_MOVES + 1)."""
    episode: NDArray[np.int64]
    """Number of the present episode, shape (n_envs,)."""
    outcome: NDArray[np.int64]
    """How the present episode stands (RUNNING ...), shape (n_envs,)."""
    clearance: Vec
    """Distance to the person [m], shape (n_envs,)."""
    n_redrawn: NDArray[np.int64]
    """Starts rejected for want of clearance, shape (n_envs,)."""


@njit(cache=True)
def human_at(world: PickWorld, rules: PickRules, state: PickState, e: int, t: float) -> None:
    """Write the person's state of environment ``e`` at ``t`` [s] since its start."""
    n = state.n_moves[e]
    when = state.phase[e] + rules.human_pace * t
    move = 0
    while move + 1 < n and state.start[e, move + 1] <= when:
        move += 1
    pair = np.empty((2, 18))
    pair[0] = world.postures[state.chosen[e, move]]
    pair[1] = world.postures[state.chosen[e, move + 1]]
    script.script_at(
        when,
        1,
        state.start[e, move : move + 1],
        state.duration[e, move : move + 1],
        pair,
        state.human_q[e],
        state.human_qd[e],
    )
    state.human_qd[e] *= rules.human_pace


@njit(cache=True)
def set_goal(arm: Arm, state: PickState, e: int, goal: Vec) -> None:
    """Give environment ``e`` a new target [m], shape (3,)."""
    state.goal[e] = goal
    kinematics.ik_vertical(goal, arm.tool_length, arm.q_min, arm.q_max, state.q_goal[e])


@njit(cache=True)
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


@njit(cache=True)
def _draw_start(
    world: PickWorld, rules: PickRules, arm: Arm, state: PickState, e: int, rng: random.State
) -> None:
    """Draw the robot's start: home, a cube or a dock in equal shares, never a candidate."""
    n_stations = world.stations.shape[0]
    while True:
        kind = random.below(rng, 3)
        if kind == 0:
            state.q[e] = arm.home
            break
        station = random.below(rng, world.n_cubes)
        if kind == 2:
            station = world.n_cubes + random.below(rng, n_stations - world.n_cubes)
        offered = False
        for i in range(MAX_CANDIDATES):
            offered = offered or state.candidates[e, i] == station
        if not offered:
            state.q[e] = world.station_q[station]
            break
    if random.uniform(rng) < rules.way_share:
        u = random.uniform(rng)
        for j in range(CONTROLLED):
            state.q[e, j] += u * (state.q_goal[e, j] - state.q[e, j])
    state.qd[e] = 0.0


@njit(cache=True)
def reset_env(
    world: PickWorld,
    rules: PickRules,
    arm: Arm,
    seed: int,
    state: PickState,
    e: int,
    pose: Pose,
) -> None:
    """Start the next episode of environment ``e``."""
    rng = np.zeros(1, dtype=np.uint64)
    random.start_stream(seed, e, state.episode[e], rng)
    _draw_candidates(world, rules, state, e, rng)
    goal = world.stations[state.candidates[e, 0]].copy()
    for i in range(3):
        goal[i] += rules.target_jitter * (2.0 * random.uniform(rng) - 1.0)
    set_goal(arm, state, e, goal)
    short = random.uniform(rng) < rules.short_share
    state.time_left[e] = rules.short_limit if short else rules.time_limit
    for attempt in range(START_TRIES):
        _draw_start(world, rules, arm, state, e, rng)
        state.n_moves[e] = script.draw_script(
            rng,
            world.of_station,
            world.stations.shape[0],
            world.n_cubes,
            world.hands,
            -1,
            state.start[e],
            state.duration[e],
            state.chosen[e],
        )
        state.phase[e] = 12.0 * random.uniform(rng)
        human_at(world, rules, state, e, 0.0)
        place(arm, state.q[e], state.human_q[e], pose)
        state.clearance[e] = human_clearance(arm, pose)[0]
        state.n_redrawn[e] = attempt
        if state.clearance[e] >= rules.start_clearance:
            break
    state.elapsed[e] = 0.0
    state.outcome[e] = RUNNING


@njit(cache=True)
def tool_state(arm: Arm, qd: Vec, goal: Vec, pose: Pose) -> tuple[float, float, float]:
    """Return distance to the target [m], tilt [rad] and tcp speed [m/s] of a placed pose."""
    tcp, jacobian = np.empty(3), np.empty((3, 6))
    kinematics.tcp_point(pose.rot, pose.pos, arm.tool_length, tcp)
    kinematics.tcp_jacobian(pose.rot, pose.pos, tcp, jacobian)
    distance2, speed2 = 0.0, 0.0
    for i in range(3):
        distance2 += (goal[i] - tcp[i]) ** 2
        v = 0.0
        for j in range(6):
            v += jacobian[i, j] * qd[j]
        speed2 += v * v
    tilt = math.acos(min(1.0, max(-1.0, -pose.rot[6, 2, 1])))
    return math.sqrt(distance2), tilt, math.sqrt(speed2)


@njit(cache=True)
def succeeded(distance: float, tilt: float, speed: float) -> bool:
    """Whether the tool is where it should be, upright and at rest (thesis 5.3.1)."""
    return distance < SUCCESS_DISTANCE and tilt < SUCCESS_TILT and speed < SUCCESS_SPEED


@njit(cache=True)
def drive(arm: Arm, q: Vec, qd: Vec, act: Vec, c: Vec, q_out: Vec, qd_out: Vec) -> None:
    """Move the robot through one period by an action in [-1, 1] (wanted joint speeds).

    Joint six is steered to rest at 0. The caller tests the period for contact.
    """
    target = np.zeros(6)
    for j in range(CONTROLLED):
        target[j] = min(1.0, max(-1.0, act[j])) * arm.qd_max[j]
    target[5] = min(arm.qd_max[5], max(-arm.qd_max[5], -2.0 * q[5]))
    advance(
        q, qd, target, arm.q_min, arm.q_max, arm.qd_max, arm.qdd_max, arm.dt, c, q_out, qd_out
    )


@njit(cache=True)
def step_env(
    world: PickWorld,
    rules: PickRules,
    arm: Arm,
    weights: RewardWeights,
    state: PickState,
    e: int,
    act: Vec,
    before: Pose,
    pose: Pose,
) -> float:
    """Move environment ``e`` through one period, set its outcome, return the reward."""
    c, q1, qd1 = np.empty(6), np.empty(6), np.empty(6)
    human_q0 = state.human_q[e].copy()
    drive(arm, state.q[e], state.qd[e], act, c, q1, qd1)
    state.elapsed[e] += arm.dt
    state.time_left[e] -= arm.dt
    human_at(world, rules, state, e, state.elapsed[e])
    kind, _, _, clearance = sweep(
        arm, state.q[e], state.qd[e], c, human_q0, state.human_q[e], before, pose
    )
    d_old, tilt_old, _ = tool_state(arm, state.qd[e], state.goal[e], before)
    state.q[e], state.qd[e], state.clearance[e] = q1, qd1, clearance
    if kind != NO_CONTACT:
        place(arm, q1, state.human_q[e], pose)
    d, tilt, speed = tool_state(arm, qd1, state.goal[e], pose)
    collided = kind != NO_CONTACT
    success = not collided and succeeded(d, tilt, speed)
    if collided:
        state.outcome[e] = COLLISION
    elif success:
        state.outcome[e] = SUCCESS
    elif state.time_left[e] <= 1e-9:
        state.outcome[e] = TIMEOUT
    return reward(d_old, d, tilt_old, tilt, speed, collided, success, weights)


@njit(cache=True)
def observe_env(
    arm: Arm, state: PickState, e: int, pose: Pose, later: Pose, coarse: Vec, out: Obs
) -> None:
    """Write the observation of environment ``e``, shape (N_FEATURES,)."""
    observe(
        arm,
        state.q[e],
        state.qd[e],
        state.human_q[e],
        state.human_qd[e],
        state.goal[e],
        state.q_goal[e],
        state.time_left[e],
        pose,
        later,
        coarse,
        out,
    )


@njit(cache=True)
def reset_batch(
    world: PickWorld, rules: PickRules, arm: Arm, seed: int, state: PickState, obs: Obs
) -> None:
    """Start an episode in every environment and write the observations."""
    n_robot = arm.link.shape[0]
    pose, later = new_pose(n_robot), new_pose(n_robot)
    coarse = np.empty((N_COARSE, 2, 3))
    for e in range(state.q.shape[0]):
        reset_env(world, rules, arm, seed, state, e, pose)
        observe_env(arm, state, e, pose, later, coarse, obs[e])


@njit(cache=True)
def step_batch(
    world: PickWorld,
    rules: PickRules,
    arm: Arm,
    weights: RewardWeights,
    seed: int,
    state: PickState,
    act: NDArray[np.float32],
    auto_reset: bool,
    features: bool,
    obs: Obs,
    last_obs: Obs,
    rew: NDArray[np.float32],
    ended: NDArray[np.int64],
) -> None:
    """Step all environments.

    Args:
        world: Shared data.
        rules: Starts and ends.
        arm: Robot in its cell.
        weights: Reward coefficients.
        seed: Seed of the batch.
        state: Rows; changed.
        act: Actions in [-1, 1], shape (n_envs, 5).
        auto_reset: Start the next episode at once; otherwise ended rows stay as they are.
        features: Whether to write observations.
        obs: Filled with the observations after the step (and reset), shape (n_envs, F).
        last_obs: Filled with the final observation of rows that ended, shape (n_envs, F).
        rew: Filled with rewards, shape (n_envs,).
        ended: Filled with the outcome of rows that ended now, RUNNING elsewhere.
    """
    n_robot = arm.link.shape[0]
    pose, later = new_pose(n_robot), new_pose(n_robot)
    coarse, wanted = np.empty((N_COARSE, 2, 3)), np.empty(CONTROLLED)
    for e in range(state.q.shape[0]):
        ended[e], rew[e] = RUNNING, 0.0
        if state.outcome[e] != RUNNING:
            continue
        for j in range(CONTROLLED):
            wanted[j] = act[e, j]
        rew[e] = step_env(world, rules, arm, weights, state, e, wanted, later, pose)
        ended[e] = state.outcome[e]
        if features:
            observe_env(arm, state, e, pose, later, coarse, obs[e])
        if ended[e] != RUNNING and auto_reset:
            if features:
                last_obs[e] = obs[e]
            state.episode[e] += 1
            reset_env(world, rules, arm, seed, state, e, pose)
            if features:
                observe_env(arm, state, e, pose, later, coarse, obs[e])
