"""Episodes of the reach scenario: starts, steps, ends and rewards (compiled).

Source: docs/method.md 2.1-2.3. Stepping draws random numbers only from a pedestrian's own
stream.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.core.kernels import rng as random
from app.sim.geometry.capsules import copy_values
from app.sim.people.kernels.motion import start_people
from app.sim.people.kernels.people import People, people_clearance
from app.sim.reach.kernels.reward import ReachWeights, reward
from app.sim.robot.kernels.actions import MYOPIC, ActionRule
from app.sim.robot.kernels.arm import Arm, RobotPose, place_robot
from app.sim.scenario.kernels.episode import (
    COLLISION,
    NO_TARGET,
    RUNNING,
    START_TRIES,
    SUCCESS,
    SUCCESS_DISTANCE,
    TIMEOUT,
    UNFEASIBLE,
    EpisodeState,
    Indices,
    StepWorkspace,
    begin,
    distance_to,
    measure,
    move,
)


class ReachCell(NamedTuple):
    """Data that all environments of the reach scenario share."""

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
    """Rules by which episodes start and end."""

    time_limit: float
    """Longest episode [s]."""
    start_clearance: float
    """Least clearance of robot and people at the start [m]."""
    anywhere: bool
    """Whether goals are drawn from the whole box instead of the targets."""
    collision_ends: bool
    """Whether a collision ends the episode at once."""


class ReachTask(NamedTuple):
    """Rules of the episodes, action type and reward coefficients."""

    rules: ReachRules
    """Starts and ends."""
    action: ActionRule
    """Action type and bounds."""
    weights: ReachWeights
    """Reward coefficients."""


@kernel()
def set_goal(
    world: ReachCell, state: EpisodeState, e: int, goal: Vec, robot: RobotPose
) -> None:
    """Set a new goal [m], shape (3,), in environment ``e`` and measure the distance to it."""
    for i in range(3):
        state.goal[e, i] = goal[i]
    state.target[e] = NO_TARGET
    place_robot(world.arm, state.q[e], robot)
    state.distance[e] = distance_to(goal, robot)


@kernel()
def _draw_goal(
    world: ReachCell, rules: ReachRules, state: EpisodeState, e: int, rng: random.State
) -> None:
    """Draw the goal of an episode, one of the targets or a point of the goal box."""
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
    world: ReachCell,
    rules: ReachRules,
    seed: int,
    first_env: int,
    state: EpisodeState,
    e: int,
    work: StepWorkspace,
) -> None:
    """Start the next episode of environment ``e``: the robot at home, at rest."""
    rng, arm = work.rng, world.arm
    random.start_stream(seed, first_env + e, state.episode[e], rng)
    _draw_goal(world, rules, state, e, rng)
    for j in range(6):
        state.q[e, j], state.qd[e, j], state.qdd[e, j] = arm.home[j], 0.0, 0.0
    place_robot(arm, state.q[e], work.robot)
    for attempt in range(START_TRIES):
        start_people(world.people, state.people, e, rng, work.geometry)
        state.n_redrawn[e] = attempt
        clear = people_clearance(world.people, work.robot.capsules, work.geometry)
        if clear >= rules.start_clearance:
            break
    measure(arm, world.people, state, e, work)
    begin(state, e, rules.time_limit, work)


@kernel()
def outcome_of(
    collided: bool, touched: bool, near: bool, unfeasible: bool, time_left: float, ends: bool
) -> int:
    """Return the outcome of an episode after a control period.

    Args:
        collided: Whether there was a collision in this control period.
        touched: Whether there was a collision in the episode so far, which excludes success.
        near: Whether the tcp is within ``SUCCESS_DISTANCE`` of the goal.
        unfeasible: Whether the one-step bounds left no admissible coefficient.
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
    world: ReachCell,
    task: ReachTask,
    state: EpisodeState,
    e: int,
    act: NDArray[np.float32],
    work: StepWorkspace,
) -> float:
    """Step environment ``e``, set its outcome and return the reward."""
    arm, action, ends = world.arm, task.action, task.rules.collision_ends
    collided, unfeasible = move(arm, world.people, action, state, e, act, work)
    if collided:
        state.touched[e] += 1
        if not ends:
            measure(arm, world.people, state, e, work)
    d_old, d = state.distance[e], distance_to(state.goal[e], work.robot)
    state.distance[e] = d
    state.outcome[e] = outcome_of(
        collided,
        state.touched[e] > 0,
        d < SUCCESS_DISTANCE,
        unfeasible and action.bounds == MYOPIC,
        state.time_left[e],
        ends,
    )
    return reward(d_old, d, work.c, collided, state.outcome[e] == SUCCESS, task.weights)


@kernel(nogil=True)
def reset_envs(
    world: ReachCell,
    task: ReachTask,
    seed: int,
    first_env: int,
    state: EpisodeState,
    envs: Indices,
    work: StepWorkspace,
) -> None:
    """Start an episode in some environments, shape (k,)."""
    for e in envs:
        reset_env(world, task.rules, seed, first_env, state, e, work)


@kernel(nogil=True)
def step_batch(
    world: ReachCell,
    task: ReachTask,
    state: EpisodeState,
    work: StepWorkspace,
    act: NDArray[np.float32],
    rew: NDArray[np.float32],
    ended: Indices,
) -> None:
    """Step all environments; environments whose episode has ended do not change.

    Args:
        task: Rules, action type and reward coefficients.
        state: Environments; changed.
        act: Actions in [-1, 1], shape (n_envs, 6).
        rew: Filled with rewards, shape (n_envs,).
        ended: Filled with the outcome of episodes that ended now, RUNNING elsewhere.
    """
    for e in range(state.q.shape[0]):
        ended[e], rew[e] = RUNNING, 0.0
        if state.outcome[e] == RUNNING:
            rew[e] = step_env(world, task, state, e, act[e], work)
            ended[e] = state.outcome[e]
