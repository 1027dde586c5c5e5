"""Motion of a control period under speed and separation monitoring (compiled).

All scenarios share it. The commanded segment passes through ``ssm.decide``, and the admitted
motion is executed. People move as without the layer, or along given tracks of cylinders.
Contacts with people between the ends of a period are found by conservative advancement along
the executed motion (``adversarial_trials.first_contact``), and the speed of the touching link
tells whether the robot was moving. Contact of the robot with its cell or itself is checked at
the ends of periods.

Source: docs/method.md 2.7.
"""

import math

import numpy as np
from numpy.typing import NDArray

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
from app.sim.people.kernels.people import (
    People,
    PeopleGeometry,
    place_people,
    store_clearances,
)
from app.sim.people.kernels.speeds import capsule_speeds
from app.sim.robot.kernels.actions import ActionRule, Coefficients, advance
from app.sim.robot.kernels.arm import Arm, copy_capsules, place_robot
from app.sim.robot.kernels.joints import JointPath, JointState
from app.sim.safety.kernels.adversarial_people import TrialWorkspace, people_speed
from app.sim.safety.kernels.adversarial_trials import MOVING, first_contact, touching_speed
from app.sim.safety.kernels.separation_check import (
    NOW,
    PeopleShapes,
    place_node,
)
from app.sim.safety.kernels.ssm import decide
from app.sim.scenario.kernels.episode import EpisodeState, Indices, StepWorkspace, measure
from app.sim.scenario.kernels.monitored_state import (
    ALLOWED,
    BELOW_HALF,
    CELL,
    CONTACT,
    FASTEST,
    JOINT_PATH,
    N_ACCOUNT,
    OVERRIDES,
    PERIODS,
    PERSON,
    SPEED,
    STANDSTILL,
    STANDSTILL_STOPPED,
    STOPPED,
    TOOL_PATH,
    TOUCHED_AT_REST,
    MonitoredState,
)

AT_REST = 1e-3
"""Largest joint speed of a robot at standstill [rad/s]."""


@kernel(inline="always")
def follow_track(state: EpisodeState, e: int, monitor: MonitoredState, dt: float) -> None:
    """Move the pedestrian of environment ``e`` to the present place of its track.

    After the end of the track the pedestrian stands at its last point.
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


@kernel(nogil=True, error_model="numpy")
def begin_envs(
    arm: Arm,
    people: People,
    state: EpisodeState,
    envs: Indices,
    monitor: MonitoredState,
    work: StepWorkspace,
) -> None:
    """Start the episode statistics of environments, shape (k,), that were just reset.

    Their pedestrians move to the start of their tracks, if any.
    """
    for e in envs:
        for k in range(N_ACCOUNT):
            monitor.account[e, k] = 0.0
        monitor.override[e], monitor.period[e] = 1.0, 0
        if monitor.tracks.shape[0] > 0:
            follow_track(state, e, monitor, arm.dt)
            place_robot(arm, state.q[e], work.robot)
            place_people(people, state.people, e, work.geometry)
            measure(arm, people, state, e, work)
        state.time_left[e] = min(monitor.horizon, state.time_left[e])


@kernel(inline="always")
def _people_before(people: People, state: EpisodeState, e: int, trial: TrialWorkspace) -> None:
    """Store the people at the start of a control period."""
    copy_rows(state.people.capsules[e], trial.capsules0)
    for k in range(trial.cylinders0.shape[0]):
        for i in range(3):
            trial.cylinders0[k, i] = state.people.cylinders[e, k, i]
        trial.cylinders0[k, 3] = people.top_z
        trial.cylinders[k, 3] = trial.cylinders1[k, 3] = people.top_z


@kernel(inline="always")
def _people_after(
    arm: Arm,
    people: People,
    state: EpisodeState,
    e: int,
    monitor: MonitoredState,
    work: StepWorkspace,
) -> None:
    """Move the people through one control period and store them at its end."""
    trial = monitor.trial
    monitor.period[e] += 1
    if monitor.tracks.shape[0] > 0:
        follow_track(state, e, monitor, arm.dt)
    else:
        advance_people(people, state.people, e, state.robot[e], arm.dt, work.geometry.away)
    place_people(people, state.people, e, work.geometry)
    copy_rows(work.geometry.capsules, state.people.capsules[e])
    copy_rows(work.geometry.capsules, trial.capsules1)
    for k in range(trial.cylinders1.shape[0]):
        for i in range(3):
            trial.cylinders1[k, i] = state.people.cylinders[e, k, i]


@kernel(inline="always")
def _pass_speeds(
    people: People,
    state: EpisodeState,
    e: int,
    monitor: MonitoredState,
    geometry: PeopleGeometry,
) -> None:
    """Pass the observed speeds of the people of environment ``e`` to the layer.

    Pedestrians with measured velocities are extrapolated, the others count at their speeds.
    """
    humans, space = state.people, monitor.trial.ssm
    m = monitor.trial.capsules0.shape[1]
    copy_rows(humans.size[e], geometry.size)
    speeds = space.observed_speed[:m]
    capsule_speeds(people, humans.q[e], humans.qd[e], monitor.trial.capsules0, geometry, speeds)
    for k in range(space.velocity.shape[0]):
        row, going = humans.walkers.rows[e, k], space.velocity[k]
        speed = math.hypot(row[VX], row[VY]) + abs(row[GROWTH])
        if monitor.measured:
            going[0], going[1], going[2] = row[VX], row[VY], row[GROWTH]
            space.known_speed[m + k] = speed
        else:
            space.observed_speed[m + k] = speed


@kernel(inline="always")
def _execute(
    arm: Arm,
    people: People,
    state: EpisodeState,
    e: int,
    monitor: MonitoredState,
    work: StepWorkspace,
) -> None:
    """Apply the safety layer to the segment in ``work``; ``trial.ssm`` has the motion."""
    trial, account = monitor.trial, monitor.account[e]
    space, override = trial.ssm, 1.0
    for j in range(6):
        trial.q[j], trial.qd[j] = state.q[e, j], state.qd[e, j]
    if monitor.active:
        _pass_speeds(people, state, e, monitor, work.geometry)
        shapes = PeopleShapes(trial.capsules0, trial.cylinders0)
        path = JointPath(trial.q, trial.qd, work.c, work.d)
        override = decide(arm, monitor.safety, 0.0, shapes, path, space)
    else:
        end = space.end
        space.deceleration[0] = 0.0
        for j in range(6):
            space.c[j], space.d[j] = work.c[j], work.d[j]
            end.q[j], end.qd[j], end.qdd[j] = work.q[j], work.qd[j], work.qdd[j]
    monitor.override[e] = override
    account[PERIODS] += 1.0
    account[OVERRIDES] += override
    account[STOPPED] += 1.0 if override <= 0.0 else 0.0
    account[BELOW_HALF] += 1.0 if override < 0.5 else 0.0


@kernel(inline="always")
def _touch(arm: Arm, monitor: MonitoredState, e: int) -> bool:
    """Check for contact with people and account for it; return whether the episode ends."""
    trial, account = monitor.trial, monitor.account[e]
    account[FASTEST] = max(account[FASTEST], people_speed(trial, arm.dt))
    if trial.cylinders0.shape[0] + trial.capsules0.shape[1] == 0:
        return False
    people = PeopleShapes(trial.capsules0, trial.cylinders0)
    place_node(arm, people, trial.q, NOW, 0.0, trial.touch)
    when, part = first_contact(arm, trial)
    if when < 0.0:
        return False
    speed = touching_speed(arm, part, trial)
    account[CONTACT], account[SPEED] = PERSON, max(account[SPEED], speed)
    if speed <= MOVING:
        account[TOUCHED_AT_REST] += 1.0
        return monitor.rest_ends
    account[ALLOWED] = monitor.safety.contact_speed[part]
    return True


@kernel(inline="always")
def _arrive(
    arm: Arm,
    people: People,
    state: EpisodeState,
    e: int,
    monitor: MonitoredState,
    work: StepWorkspace,
) -> None:
    """Move the robot to the end of the control period."""
    end, account = monitor.trial.ssm.end, monitor.account[e]
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
    copy_capsules(work.robot.capsules, state.robot[e])
    measure(arm, people, state, e, work)
    if people.yielding > 0.0:
        store_clearances(state.people, e, work.geometry)


@kernel(inline="always")
def command_action(
    arm: Arm,
    action: ActionRule,
    state: EpisodeState,
    e: int,
    act: NDArray[np.float32],
    work: StepWorkspace,
) -> bool:
    """Write the segment that an action commands into the work space.

    Returns:
        Whether a joint had no admissible coefficient.
    """
    start = JointState(state.q[e], state.qd[e], state.qdd[e])
    segment, end = Coefficients(work.c, work.d), JointState(work.q, work.qd, work.qdd)
    return bool(advance(action, arm.limits, arm.dt, start, act, segment, end))


@kernel(error_model="numpy")
def move_monitored(
    arm: Arm,
    people: People,
    state: EpisodeState,
    e: int,
    monitor: MonitoredState,
    work: StepWorkspace,
) -> bool:
    """Move robot and people of environment ``e`` through one control period.

    Args:
        state: Environments; changed.
        e: Environment.
        monitor: Safety layer, tracks and episode statistics.
        work: ``c``, ``d`` are the command; ``q``, ``qd``, ``qdd`` its end. Afterwards ``robot``
            and ``geometry`` are the poses at that end.

    Returns:
        Whether there was a contact that ends the episode.
    """
    _people_before(people, state, e, monitor.trial)
    _execute(arm, people, state, e, monitor, work)
    _people_after(arm, people, state, e, monitor, work)
    touched = _touch(arm, monitor, e)
    _arrive(arm, people, state, e, monitor, work)
    state.elapsed[e] += arm.dt
    if not touched and min(state.clear[e, 1], state.clear[e, 2]) <= 0.0:
        touched, monitor.account[e, CONTACT] = True, CELL
    return bool(touched)


@kernel(inline="always")
def close_account(monitor: MonitoredState, e: int) -> None:
    """Store the statistics of environment ``e``, whose episode ended."""
    for i in range(N_ACCOUNT):
        monitor.closed[e, i] = monitor.account[e, i]
