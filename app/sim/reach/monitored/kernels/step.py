"""Steps of the reach scenario under speed and separation monitoring (compiled).

A control cycle is that of ``reach/kernels/episode.py`` with the safety layer between command
and robot: the commanded segment passes through ``ssm.decide``, and the admitted motion is
executed. People move as without the layer, or along given tracks of cylinders. Contacts with
people between the ends of a cycle are found by conservative advancement along the executed
motion (``adversarial_trials.first_contact``), and the speed of the touching link tells whether
the robot was moving. Contact of the robot with its cell or itself is checked at the ends of
cycles.

Source: docs/method.md 2.6 (last row) and 2.7.
"""

import math

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.geometry.capsules import copy_rows
from app.sim.people.kernels.motion import advance_people
from app.sim.people.kernels.pedestrian import (
    GAIT,
    GROWTH,
    STAYING,
    TIME,
    VX,
    VY,
    R,
    X,
    Y,
    remember,
    remember_as_now,
)
from app.sim.people.kernels.people import place_people
from app.sim.reach.kernels.episode import ReachCell, ReachTask
from app.sim.reach.kernels.reward import reward
from app.sim.reach.monitored.kernels.state import (
    BELOW_HALF,
    CELL,
    CONTACT,
    FASTEST,
    JOINT_PATH,
    N_ACCOUNT,
    PERIODS,
    PERSON,
    SLOWED,
    SPEED,
    STANDSTILL,
    STANDSTILL_STOPPED,
    STOPPED,
    TOOL_PATH,
    Commands,
    MonitoredState,
    StepResults,
)
from app.sim.robot.kernels.actions import ActionRule, Coefficients, advance
from app.sim.robot.kernels.arm import copy_capsules, place_robot
from app.sim.robot.kernels.joints import JointPath, JointState
from app.sim.safety.kernels.adversarial_people import TrialWorkspace, people_speed
from app.sim.safety.kernels.adversarial_trials import MOVING, first_contact, touching_speed
from app.sim.safety.kernels.separation_check import (
    NOW,
    PeopleShapes,
    SsmWorkspace,
    place_node,
)
from app.sim.safety.kernels.ssm import decide
from app.sim.scenario.kernels.episode import (
    COLLISION,
    RUNNING,
    SUCCESS,
    SUCCESS_DISTANCE,
    TIMEOUT,
    EpisodeState,
    Indices,
    StepWorkspace,
    distance_to,
    measure,
)

AT_REST = 1e-3
"""Largest joint speed of a robot at standstill [rad/s]."""


@kernel(inline="always")
def follow_track(state: EpisodeState, e: int, monitor: MonitoredState, dt: float) -> None:
    """Move the pedestrian of environment ``e`` to the present place of its track.

    After its end a track stays where it is.
    """
    track, k = monitor.tracks[e], monitor.period[e]
    last = track.shape[0] - 1
    now, after = track[min(k, last)], track[min(k + 1, last)]
    row = state.people.walkers.rows[e, 0]
    row[X], row[Y] = now[0], now[1]
    row[VX], row[VY] = (after[0] - now[0]) / dt, (after[1] - now[1]) / dt
    row[GROWTH] = (now[2] - row[R]) / dt if k > 0 else 0.0
    row[R], row[GAIT], row[TIME] = now[2], STAYING, k * dt
    if k == 0:
        remember_as_now(state.people.walkers.rows, e, 0)
    else:
        remember(state.people.walkers.rows, e, 0, dt)
    for i in range(3):
        state.people.cylinders[e, 0, i] = now[i]


@kernel(inline="always")
def begin_episode(
    world: ReachCell, state: EpisodeState, e: int, monitor: MonitoredState, work: StepWorkspace
) -> None:
    """Clear the account of environment ``e`` and move its person onto the track, if any."""
    for k in range(N_ACCOUNT):
        monitor.account[e, k] = 0.0
    monitor.override[e], monitor.period[e] = 1.0, 0
    if monitor.tracks.shape[0] > 0:
        follow_track(state, e, monitor, world.arm.dt)
        place_robot(world.arm, state.q[e], work.robot)
        place_people(world.people, state.people, e, work.crowd)
        measure(world.arm, world.people, state, e, work)
    state.time_left[e] = min(monitor.horizon, state.time_left[e])


@kernel(inline="always")
def _people_before(
    world: ReachCell, state: EpisodeState, e: int, trial: TrialWorkspace
) -> None:
    """Store the people at the start of a control cycle."""
    copy_rows(state.people.columns[e], trial.columns0)
    for k in range(trial.cylinders0.shape[0]):
        for i in range(3):
            trial.cylinders0[k, i] = state.people.cylinders[e, k, i]
        trial.cylinders0[k, 3] = world.people.top_z
        trial.cylinders[k, 3] = trial.cylinders1[k, 3] = world.people.top_z


@kernel(inline="always")
def _people_after(
    world: ReachCell, state: EpisodeState, e: int, monitor: MonitoredState, work: StepWorkspace
) -> None:
    """Move the people through one control cycle and store them at its end."""
    arm, trial = world.arm, monitor.trial
    monitor.period[e] += 1
    if monitor.tracks.shape[0] > 0:
        follow_track(state, e, monitor, arm.dt)
    else:
        advance_people(world.people, state.people, e, state.robot[e], arm.dt, work.crowd.away)
    place_people(world.people, state.people, e, work.crowd)
    copy_capsules(work.crowd.columns, state.people.columns[e])
    copy_rows(work.crowd.columns, trial.columns1)
    for k in range(trial.cylinders1.shape[0]):
        for i in range(3):
            trial.cylinders1[k, i] = state.people.cylinders[e, k, i]


@kernel(inline="always")
def _pass_velocities(state: EpisodeState, e: int, space: SsmWorkspace) -> None:
    """Pass the measured velocities of the pedestrians of environment ``e`` to the layer."""
    rows, m = state.people.walkers.rows, space.known_speed.shape[0] - space.velocity.shape[0]
    for k in range(space.velocity.shape[0]):
        row, going = rows[e, k], space.velocity[k]
        going[0], going[1], going[2] = row[VX], row[VY], row[GROWTH]
        space.known_speed[m + k] = math.hypot(row[VX], row[VY]) + abs(row[GROWTH])


@kernel(inline="always")
def _execute(
    world: ReachCell, state: EpisodeState, e: int, monitor: MonitoredState, work: StepWorkspace
) -> None:
    """Apply the safety layer to the segment in ``work``; ``trial.ssm`` has the motion."""
    trial, account = monitor.trial, monitor.account[e]
    space, override = trial.ssm, 1.0
    for j in range(6):
        trial.q[j], trial.qd[j] = state.q[e, j], state.qd[e, j]
    if monitor.measured:
        _pass_velocities(state, e, space)
    if monitor.active:
        people = PeopleShapes(trial.columns0, trial.cylinders0)
        path = JointPath(trial.q, trial.qd, work.c, work.d)
        override = decide(world.arm, monitor.safety, 0.0, people, path, space)
    else:
        end = space.end
        space.deceleration[0] = 0.0
        for j in range(6):
            space.c[j], space.d[j] = work.c[j], work.d[j]
            end.q[j], end.qd[j], end.qdd[j] = work.q[j], work.qd[j], work.qdd[j]
    monitor.override[e] = override
    account[PERIODS] += 1.0
    account[STOPPED] += 1.0 if override <= 0.0 else 0.0
    account[BELOW_HALF] += 1.0 if override < 0.5 else 0.0
    account[SLOWED] += 1.0 if override < 1.0 else 0.0


@kernel(inline="always")
def _touch(world: ReachCell, monitor: MonitoredState, e: int) -> bool:
    """Check for contact with people and account for it; return whether the episode ends."""
    arm, trial, account = world.arm, monitor.trial, monitor.account[e]
    account[FASTEST] = max(account[FASTEST], people_speed(trial, arm.dt))
    if trial.cylinders0.shape[0] + trial.columns0.shape[1] == 0:
        return False
    people = PeopleShapes(trial.columns0, trial.cylinders0)
    place_node(arm, people, trial.q, NOW, 0.0, trial.touch)
    when, part = first_contact(arm, trial)
    if when < 0.0:
        return False
    speed = touching_speed(arm, part, trial)
    account[CONTACT], account[SPEED] = PERSON, max(account[SPEED], speed)
    return monitor.rest_ends or speed > MOVING


@kernel(inline="always")
def _arrive(
    world: ReachCell, state: EpisodeState, e: int, monitor: MonitoredState, work: StepWorkspace
) -> float:
    """Move the robot to the end of the cycle; return the distance to the goal [m]."""
    arm, end, account = world.arm, monitor.trial.ssm.end, monitor.account[e]
    place_robot(arm, state.q[e], work.robot)
    x, y, z = work.robot.tcp[0], work.robot.tcp[1], work.robot.tcp[2]
    square, fastest = 0.0, 0.0
    for j in range(6):
        square += (end.q[j] - state.q[e, j]) ** 2
        fastest = max(fastest, abs(end.qd[j]))
        state.q[e, j], state.qd[e, j], state.qdd[e, j] = end.q[j], end.qd[j], end.qdd[j]
    account[JOINT_PATH] += math.sqrt(square)
    if fastest < AT_REST:
        account[STANDSTILL] += 1.0
        account[STANDSTILL_STOPPED] += 1.0 if monitor.override[e] <= 0.0 else 0.0
    place_robot(arm, state.q[e], work.robot)
    tcp = work.robot.tcp
    account[TOOL_PATH] += math.sqrt((tcp[0] - x) ** 2 + (tcp[1] - y) ** 2 + (tcp[2] - z) ** 2)
    copy_capsules(work.robot.columns, state.robot[e])
    measure(arm, world.people, state, e, work)
    return float(distance_to(state.goal[e], work.robot))


@kernel(inline="always")
def monitored_cycle(
    world: ReachCell,
    task: ReachTask,
    state: EpisodeState,
    e: int,
    monitor: MonitoredState,
    work: StepWorkspace,
) -> float:
    """Execute one control cycle of environment ``e``; return the reward.

    Args:
        world: Shared data.
        task: Time limit and reward coefficients.
        state: Environments; changed.
        e: Environment.
        monitor: Safety layer, tracks and accounts.
        work: ``c``, ``d`` are the command; ``q``, ``qd``, ``qdd`` its end.
    """
    weights = task.weights
    _people_before(world, state, e, monitor.trial)
    _execute(world, state, e, monitor, work)
    _people_after(world, state, e, monitor, work)
    touched = _touch(world, monitor, e)
    before = state.distance[e]
    d = _arrive(world, state, e, monitor, work)
    state.distance[e] = d
    state.elapsed[e] += world.arm.dt
    left = task.rules.time_limit - state.elapsed[e]
    state.time_left[e] = min(monitor.horizon, left)
    if not touched and min(state.clear[e, 1], state.clear[e, 2]) <= 0.0:
        touched, monitor.account[e, CONTACT] = True, CELL
    if touched:
        state.touched[e] += 1
        state.outcome[e] = COLLISION
    elif d < SUCCESS_DISTANCE:
        state.outcome[e] = SUCCESS
    elif left <= 1e-9:
        state.outcome[e] = TIMEOUT
    stopped = weights.c_o if monitor.override[e] <= 0.0 else 0.0
    return reward(before, d, work.c, touched, state.outcome[e] == SUCCESS, weights) - stopped


@kernel(inline="always")
def _command_action(
    world: ReachCell,
    action: ActionRule,
    state: EpisodeState,
    e: int,
    act: NDArray[np.float32],
    work: StepWorkspace,
) -> None:
    """Write the segment that an action commands into the work space."""
    arm = world.arm
    start = JointState(state.q[e], state.qd[e], state.qdd[e])
    segment, end = Coefficients(work.c, work.d), JointState(work.q, work.qd, work.qdd)
    advance(action, arm.limits, arm.dt, start, act, segment, end)


@kernel(inline="always")
def _command_segment(
    state: EpisodeState, e: int, c: Vec, dt: float, work: StepWorkspace
) -> None:
    """Write a segment of degree 2, by its second coefficients, into the work space."""
    for j in range(6):
        work.c[j], work.d[j], work.qdd[j] = c[j], 0.0, 2.0 * c[j]
        work.q[j] = state.q[e, j] + dt * (state.qd[e, j] + dt * c[j])
        work.qd[j] = state.qd[e, j] + 2.0 * dt * c[j]


@kernel(nogil=True, error_model="numpy")
def begin_rows(
    world: ReachCell,
    state: EpisodeState,
    envs: Indices,
    monitor: MonitoredState,
    work: StepWorkspace,
) -> None:
    """Begin the episodes of some environments, shape (k,), that were just reset."""
    for e in envs:
        begin_episode(world, state, e, monitor, work)


@kernel(nogil=True, error_model="numpy")
def step_rows(
    world: ReachCell,
    task: ReachTask,
    state: EpisodeState,
    monitor: MonitoredState,
    work: StepWorkspace,
    envs: Indices,
    commands: Commands,
    results: StepResults,
) -> None:
    """Step some environments under the safety layer.

    One kernel for actions and segments, because two would compile the control cycle twice.

    Args:
        world: Shared data.
        task: Rules, action type and reward coefficients.
        state: Environments; changed.
        monitor: Safety layer, tracks and accounts.
        work: Work space.
        envs: Numbers of the environments, shape (k,).
        commands: Actions or segments.
        results: Filled for these environments.
    """
    rew, ended = results.rew, results.ended
    for k in range(envs.shape[0]):
        e = envs[k]
        ended[e], rew[e] = RUNNING, 0.0
        if state.outcome[e] != RUNNING:
            continue
        if commands.segments.shape[0] > 0:
            _command_segment(state, e, commands.segments[k], world.arm.dt, work)
        else:
            _command_action(world, task.action, state, e, commands.act[e], work)
        rew[e] = monitored_cycle(world, task, state, e, monitor, work)
        ended[e] = state.outcome[e]
        if ended[e] != RUNNING:
            for i in range(N_ACCOUNT):
                monitor.closed[e, i] = monitor.account[e, i]
