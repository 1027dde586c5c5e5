"""The reach scenario, batched: episodes, steps, ends and rewards (METHOD 2.1-2.3), compiled.

Every environment is a row of the arrays in :class:`ReachState`. An episode is fixed by (seed,
environment, episode): goal, people and their whole motion; stepping draws only from a walker's
own stream.
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
    people_clearance,
)
from app.sim.prediction.kernels.networks import Forecaster
from app.sim.reach.kernels.observation import ReachSight, new_reach_sight
from app.sim.reach.kernels.option_features import Ways, new_ways
from app.sim.reach.kernels.reward import ReachWeights, reward
from app.sim.robot.kernels.actions import MYOPIC, ActionRule
from app.sim.robot.kernels.arm import Arm, RobotPose, copy_capsules, new_robot_pose, place_robot
from app.sim.scenario.kernels.episode import (
    COLLISION,
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
NO_TARGET = -1
"""Number of a goal that is none of the targets."""


class ReachWorld(NamedTuple):
    """What all environments share."""

    targets: Vec
    """Goals to draw from [m], shape (n_targets, 3)."""
    low: Vec
    """Lower corner of the goal box [m], shape (3,)."""
    high: Vec
    """Upper corner of the goal box [m], shape (3,)."""
    arm: Arm
    """The robot in its cell."""
    people: People
    """The people in the cell."""


class ReachRules(NamedTuple):
    """How episodes start and end."""

    time_limit: float
    """Longest episode [s]."""
    start_clearance: float
    """Least distance of robot and people at the start [m]."""
    anywhere: bool
    """Whether goals are drawn from the whole box, not from the targets."""
    collision_ends: bool
    """Whether a collision ends the episode at once."""


class ReachState(NamedTuple):
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
    """Where the tcp shall be [m], shape (n_envs, 3)."""
    target: NDArray[np.int64]
    """Number of the goal among the targets, NO_TARGET where it is none, shape (n_envs,)."""
    time_left: Vec
    """Time left [s], shape (n_envs,)."""
    elapsed: Vec
    """Time since the start [s], shape (n_envs,)."""
    distance: Vec
    """tcp to goal [m], shape (n_envs,)."""
    touched: NDArray[np.int64]
    """Periods with a collision in the present episode, shape (n_envs,)."""
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
    sight: ReachSight
    """What an observation looks at."""
    ways: Ways
    """What comes of every way."""
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


def new_work(world: ReachWorld, state: ReachState, forecaster: Forecaster) -> Work:
    """Return work space for a batch."""
    people = state.people
    return Work(
        new_robot_pose(world.arm),
        new_people_geometry(world.people, people.q.shape[1], people.cylinders.shape[1]),
        new_reach_sight(world.arm),
        new_ways(world.arm, forecaster),
        np.zeros(6),
        np.zeros(6),
        np.zeros(6),
        np.zeros(6),
        np.zeros(6),
        np.zeros(1, dtype=np.uint64),
    )


@kernel()
def set_goal(world: ReachWorld, state: ReachState, e: int, goal: Vec, robot: RobotPose) -> None:
    """Give environment ``e`` a new goal [m], shape (3,); the way to it is measured anew."""
    for i in range(3):
        state.goal[e, i] = goal[i]
    state.target[e] = NO_TARGET
    place_robot(world.arm, state.q[e], robot)
    state.distance[e] = distance_to(goal, robot)


@kernel()
def _draw_goal(
    world: ReachWorld, rules: ReachRules, state: ReachState, e: int, rng: random.State
) -> None:
    if rules.anywhere:
        state.target[e] = NO_TARGET
        for i in range(3):
            side = world.high[i] - world.low[i]
            state.goal[e, i] = world.low[i] + side * random.uniform(rng)
    else:
        state.target[e] = random.below(rng, world.targets.shape[0])
        copy_values(world.targets[state.target[e]], state.goal[e])


@kernel(inline="always")
def reset_env(
    world: ReachWorld,
    rules: ReachRules,
    seed: int,
    first_env: int,
    state: ReachState,
    e: int,
    work: Work,
) -> None:
    """Start the next episode of environment ``e``: the robot at home, at rest."""
    rng, arm = work.rng, world.arm
    random.start_stream(seed, first_env + e, state.episode[e], rng)
    _draw_goal(world, rules, state, e, rng)
    for j in range(6):
        state.q[e, j], state.qd[e, j], state.qdd[e, j] = arm.home[j], 0.0, 0.0
    place_robot(arm, state.q[e], work.robot)
    for attempt in range(START_TRIES):
        start_people(world.people, state.people, e, rng, work.crowd)
        state.n_redrawn[e] = attempt
        clear = people_clearance(world.people, work.robot.columns, work.crowd)
        if clear >= rules.start_clearance:
            break
    found = clearances(arm, world.people, work.robot, work.crowd)
    state.clear[e, 0], state.clear[e, 1], state.clear[e, 2] = found
    state.distance[e] = distance_to(state.goal[e], work.robot)
    copy_capsules(work.robot.columns, state.robot[e])
    copy_capsules(work.crowd.columns, state.people.columns[e])
    state.time_left[e], state.elapsed[e] = rules.time_limit, 0.0
    state.touched[e], state.outcome[e] = 0, RUNNING


@kernel()
def outcome_of(
    collided: bool, touched: bool, near: bool, unfeasible: bool, time_left: float, ends: bool
) -> int:
    """Return how an episode stands after a period.

    Args:
        collided: Whether there was a collision in this period.
        touched: Whether there was one in the episode up to now; it is no success then.
        near: Whether the tcp is within ``SUCCESS_DISTANCE`` of the goal.
        unfeasible: Whether the one-step bounds left nothing to do.
        time_left: Time left [s].
        ends: Whether a collision ends the episode at once.
    """
    outcome = RUNNING
    if near and not collided:
        outcome = SUCCESS
    elif unfeasible:
        outcome = UNFEASIBLE
    elif time_left <= 1e-9:
        outcome = TIMEOUT
    if touched and (outcome != RUNNING or ends):
        return COLLISION
    return outcome


@kernel(inline="always")
def step_env(
    world: ReachWorld,
    rules: ReachRules,
    action: ActionRule,
    weights: ReachWeights,
    state: ReachState,
    e: int,
    act: NDArray[np.float32],
    work: Work,
) -> float:
    """Move environment ``e`` through one period, set its outcome, return the reward."""
    collided, unfeasible = move(world.arm, world.people, action, state, e, act, work)
    if collided:
        state.touched[e] += 1
        if not rules.collision_ends:
            clear = clearances(world.arm, world.people, work.robot, work.crowd)
            state.clear[e, 0], state.clear[e, 1], state.clear[e, 2] = clear
    d_old, d = state.distance[e], distance_to(state.goal[e], work.robot)
    state.distance[e] = d
    state.outcome[e] = outcome_of(
        collided,
        state.touched[e] > 0,
        d < SUCCESS_DISTANCE,
        unfeasible and action.bounds == MYOPIC,
        state.time_left[e],
        rules.collision_ends,
    )
    return reward(d_old, d, work.c, collided, state.outcome[e] == SUCCESS, weights)


@kernel(nogil=True)
def reset_rows(
    world: ReachWorld,
    rules: ReachRules,
    seed: int,
    first_env: int,
    state: ReachState,
    rows: Indices,
    work: Work,
) -> None:
    """Start an episode in some environments, shape (k,)."""
    for e in rows:
        reset_env(world, rules, seed, first_env, state, e, work)


@kernel(nogil=True)
def step_batch(
    world: ReachWorld,
    rules: ReachRules,
    action: ActionRule,
    weights: ReachWeights,
    state: ReachState,
    work: Work,
    act: NDArray[np.float32],
    rew: NDArray[np.float32],
    ended: NDArray[np.int64],
) -> None:
    """Step all environments; rows that have ended stay as they are.

    Args:
        world: Shared data.
        rules: Starts and ends.
        action: What actions mean.
        weights: Reward coefficients.
        state: Rows; changed.
        work: Work space.
        act: Actions in [-1, 1], shape (n_envs, 6).
        rew: Filled with rewards, shape (n_envs,).
        ended: Filled with the outcome of rows that ended now, RUNNING elsewhere.
    """
    for e in range(state.q.shape[0]):
        ended[e], rew[e] = RUNNING, 0.0
        if state.outcome[e] == RUNNING:
            rew[e] = step_env(world, rules, action, weights, state, e, act[e], work)
            ended[e] = state.outcome[e]
