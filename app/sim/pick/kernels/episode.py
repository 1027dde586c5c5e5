"""Episodes of the pick scenario: steps, ends, rewards and observations (compiled).

Source: docs/method.md 3.2, 3.3. Stepping draws no random numbers.
"""

import numpy as np
from numpy.typing import NDArray

from app.sim.core.jit import kernel
from app.sim.people.kernels.people import observe_people, place_people
from app.sim.pick.kernels.grasp import (
    DESCEND,
    GraspRules,
    ToolState,
    distance_left,
    next_phase,
    target_height,
)
from app.sim.pick.kernels.observation import observe
from app.sim.pick.kernels.observation_workspace import PickObservationWorkspace, PickQuery
from app.sim.pick.kernels.reward import reward
from app.sim.pick.kernels.starts import PickCell, PickTask, reset_env
from app.sim.robot.kernels.actions import MYOPIC
from app.sim.robot.kernels.arm import (
    place_robot,
    robot_tilt,
    tcp_speed,
)
from app.sim.scenario.kernels.episode import (
    COLLISION,
    PLAIN,
    RUNNING,
    SUCCESS,
    SUCCESS_DISTANCE,
    TIMEOUT,
    UNFEASIBLE,
    EpisodeState,
    Indices,
    StepWorkspace,
    distance_to,
    move,
)
from app.sim.scenario.kernels.person_observation import Obs

N_PLAIN = 51
"""Length of the raw state: q, qd, the person's q, qd, target (5.8)."""
SUCCESS_TILT = 0.2
"""Largest angle of the tool axis to the vertical [rad], thesis 5.3.1."""
SUCCESS_SPEED = 0.1
"""Largest tcp speed [m/s], thesis 5.3.1."""


@kernel()
def succeeded(distance: float, tilt: float, speed: float) -> bool:
    """Return whether the tool is at the target, vertical and at rest (thesis 5.3.1)."""
    return distance < SUCCESS_DISTANCE and tilt < SUCCESS_TILT and speed < SUCCESS_SPEED


@kernel(inline="always")
def step_env(
    world: PickCell,
    task: PickTask,
    state: EpisodeState,
    e: int,
    act: NDArray[np.float32],
    work: StepWorkspace,
) -> float:
    """Step environment ``e``, set its outcome and return the reward."""
    collided, unfeasible = move(world.arm, world.people, task.action, state, e, act, work)
    return conclude(world, task, state, e, collided, unfeasible, work)


@kernel(inline="always")
def conclude(
    world: PickCell,
    task: PickTask,
    state: EpisodeState,
    e: int,
    collided: bool,
    unfeasible: bool,
    work: StepWorkspace,
) -> float:
    """Set phase and outcome of environment ``e`` after a motion; return the reward.

    Args:
        task: Rules, action type and reward coefficients.
        state: Environments; changed.
        e: Environment.
        collided: Whether the motion ended in a collision.
        unfeasible: Whether a joint had no admissible coefficient.
        work: Holds the pose of the robot.
    """
    action, weights, robot = task.action, task.weights, work.robot
    grasp, goal, d_old, tilt_old = task.grasp, state.goal[e], state.distance[e], state.tilt[e]
    d, tilt = distance_to(goal, robot), robot_tilt(robot)
    near = max(SUCCESS_DISTANCE, weights.d_v)
    slow = d <= near or grasp.depth > 0.0  # the object may be farther away than this
    speed = tcp_speed(robot, state.qd[e]) if slow else 0.0
    if grasp.depth > 0.0:
        tool = ToolState(robot.tcp, tilt, speed, state.clear[e, 0])
        phase, closing, lifted = next_phase(
            grasp, state.phase[e], state.closing[e], goal, tool, world.arm.dt
        )
        state.phase[e], state.closing[e] = phase, closing
        success, d = not collided and lifted, distance_left(grasp, phase, goal, robot.tcp)
    else:
        success = not collided and succeeded(d, tilt, speed)
    state.distance[e], state.tilt[e] = d, tilt
    if collided:
        state.outcome[e] = COLLISION
    elif success:
        state.outcome[e] = SUCCESS
    elif unfeasible and action.bounds == MYOPIC:
        state.outcome[e] = UNFEASIBLE
    elif state.time_left[e] <= 1e-9:
        state.outcome[e] = TIMEOUT
    return reward(d_old, d, tilt_old, tilt, speed, collided, success, weights)


@kernel(nogil=True)
def observe_envs(
    world: PickCell,
    grasp: GraspRules,
    state: EpisodeState,
    envs: Indices,
    work: StepWorkspace,
    observation: PickObservationWorkspace,
    view: int,
    out: Obs,
) -> None:
    """Write the observations of some environments.

    The raw state and the views for one person observe the person nearest to the robot.

    Args:
        grasp: Phases of a pick.
        envs: Numbers of the environments, shape (k,).
        view: PLAIN (the state of (5.8), ``N_PLAIN`` numbers) or FEATURES.
        out: Filled, shape (k, F).
    """
    geometry, people = work.geometry, world.people
    n_people = max(1, state.people.q.shape[1] + state.people.cylinders.shape[1])
    human_q, human_qd = observation.human_q[:n_people], observation.human_qd[:n_people]
    size, point = observation.human_size[:n_people], observation.point
    for k in range(envs.shape[0]):
        e, row = envs[k], out[k]
        place_robot(world.arm, state.q[e], work.robot)
        place_people(people, state.people, e, geometry)
        observe_people(
            people, state.people, e, work.robot.capsules, geometry, human_q, human_qd, size
        )
        if view == PLAIN:
            for j in range(6):
                row[j], row[6 + j] = state.q[e, j], state.qd[e, j]
            for j in range(18):
                row[12 + j], row[30 + j] = human_q[0, j], human_qd[0, j]
            for i in range(3):
                row[48 + i] = state.goal[e, i]
            continue
        phase, goal = state.phase[e], state.goal[e]
        point[0], point[1] = goal[0], goal[1]
        point[2] = target_height(grasp, phase, goal)
        observed = PickQuery(
            state.q[e],
            state.qd[e],
            human_q,
            human_qd,
            size,
            point,
            state.q_grasp[e] if phase == DESCEND else state.q_goal[e],
            state.q_grasp[e],
            phase,
            state.closing[e] / grasp.close_s,
        )
        observe(
            world.arm,
            people.floor_z,
            observed,
            state.time_left[e],
            work.robot,
            observation,
            row,
        )


@kernel(nogil=True)
def reset_envs(
    world: PickCell,
    task: PickTask,
    seed: int,
    first_env: int,
    state: EpisodeState,
    envs: Indices,
    work: StepWorkspace,
) -> None:
    """Start an episode in some environments, shape (k,)."""
    for e in envs:
        reset_env(world, task, seed, first_env, state, e, work)


@kernel(nogil=True)
def step_batch(
    world: PickCell,
    task: PickTask,
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
        act: Actions in [-1, 1], shape (n_envs, 5).
        rew: Filled with rewards, shape (n_envs,).
        ended: Filled with the outcome of episodes that ended now, RUNNING elsewhere.
    """
    for e in range(state.q.shape[0]):
        ended[e], rew[e] = RUNNING, 0.0
        if state.outcome[e] == RUNNING:
            rew[e] = step_env(world, task, state, e, act[e], work)
            ended[e] = state.outcome[e]
