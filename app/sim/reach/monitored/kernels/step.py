"""The reach scenario under speed and separation monitoring, batched and compiled.

One period is that of ``reach/kernels/episode.py`` with the safety layer between the command
and the
robot: the commanded piece goes through ``ssm.decide`` and what that admits is executed. People
move as they do without it, or along given tracks of cylinders. Contacts are found between the
ends of a period by conservative advancement along the motion that is really executed
(``safety_trial.first_contact``), and the speed of the links that touch tells whether the robot
was moving. Contact of the robot with its cell or itself is looked for at the ends of periods.

Source: METHOD 2.6 (last row) and 2.7.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.collision.kernels.contact import clearances
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
from app.sim.reach.kernels.episode import Indices, ReachRules, ReachState, ReachWorld, Work
from app.sim.reach.kernels.reward import ReachWeights, reward
from app.sim.robot.kernels.actions import ActionRule, Coefficients, advance
from app.sim.robot.kernels.arm import copy_capsules, place_robot
from app.sim.robot.kernels.joints import JointPath, JointState
from app.sim.safety.kernels.adversarial_people import TrialWorkspace, people_speed
from app.sim.safety.kernels.adversarial_trials import MOVING, first_contact, touching_speed
from app.sim.safety.kernels.separation_check import (
    NOW,
    PeopleShapes,
    SeparationRule,
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
)
from app.sim.scenario.kernels.episode import distance_to as tcp_distance

N_ACCOUNT = 11
(
    PERIODS,
    STOPPED,
    BELOW_HALF,
    SLOWED,
    STANDING,
    HELD,
    JOINT_WAY,
    TOOL_WAY,
    CONTACT,
    SPEED,
    FASTEST,
) = range(N_ACCOUNT)
"""Of an episode: periods; those with override 0, below one half and below 1; those at whose end
the robot stands, for whatever reason, and those of them with override 0; the way of the joints
[rad] and of the tcp [m]; NO_TOUCH, PERSON or CELL; speed of the touching link [m/s]; greatest
speed of any person [m/s]."""
NO_TOUCH, PERSON, CELL = range(3)
"""What touched the robot in an episode; at its end, where that ends it."""
AT_REST = 1e-3
"""Joints slower than this stand [rad/s]."""


class Guard(NamedTuple):
    """What a guarded batch has besides the rows of the scenario."""

    safety: SeparationRule
    """What the safety layer assumes."""
    guarded: bool
    """Whether the layer acts; without it, pieces are executed as commanded."""
    rest_ends: bool
    """Whether a person who walks into a robot at rest ends the episode; if not, that is noted,
    and the episode goes on."""
    horizon: float
    """Most time left that a policy is shown [s]."""
    measured: bool
    """Whether the layer is told how walkers go on."""
    tracks: Vec
    """Cylinder in place of each row's first walker, at the ends of periods: x, y, radius [m],
    shape (n_envs, n + 1, 3); no rows where people walk by themselves."""
    period: NDArray[np.int64]
    """Period of each row's track, shape (n_envs,)."""
    trial: TrialWorkspace
    """Work space of the contact search and the safety layer."""
    override: Vec
    """Override of the last period, shape (n_envs,)."""
    account: Vec
    """What happened in the present episode, shape (n_envs, N_ACCOUNT)."""
    closed: Vec
    """The same of each row's last episode that ended, shape (n_envs, N_ACCOUNT)."""


@kernel(inline="always")
def put_on_track(state: ReachState, e: int, guard: Guard, dt: float) -> None:
    """Write the walker of environment ``e`` as its track has it now, and its velocity.

    Past its end a track stands still.
    """
    track, k = guard.tracks[e], guard.period[e]
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
    world: ReachWorld, state: ReachState, e: int, guard: Guard, work: Work
) -> None:
    """Clear the account of environment ``e`` and put its person on the track, if any."""
    for k in range(N_ACCOUNT):
        guard.account[e, k] = 0.0
    guard.override[e], guard.period[e] = 1.0, 0
    if guard.tracks.shape[0] > 0:
        put_on_track(state, e, guard, world.arm.dt)
        place_robot(world.arm, state.q[e], work.robot)
        place_people(world.people, state.people, e, work.crowd)
        clear = clearances(world.arm, world.people, work.robot, work.crowd)
        state.clear[e, 0], state.clear[e, 1], state.clear[e, 2] = clear
    state.time_left[e] = min(guard.horizon, state.time_left[e])


@kernel(inline="always")
def _people_before(world: ReachWorld, state: ReachState, e: int, trial: TrialWorkspace) -> None:
    """Keep where people are when a period begins."""
    copy_rows(state.people.columns[e], trial.columns0)
    for k in range(trial.cylinders0.shape[0]):
        for i in range(3):
            trial.cylinders0[k, i] = state.people.cylinders[e, k, i]
        trial.cylinders0[k, 3] = world.people.top_z
        trial.cylinders[k, 3] = trial.cylinders1[k, 3] = world.people.top_z


@kernel(inline="always")
def _people_after(
    world: ReachWorld, state: ReachState, e: int, guard: Guard, work: Work
) -> None:
    """Move the people on by one period."""
    arm, trial = world.arm, guard.trial
    guard.period[e] += 1
    if guard.tracks.shape[0] > 0:
        put_on_track(state, e, guard, arm.dt)
    else:
        advance_people(world.people, state.people, e, state.robot[e], arm.dt, work.crowd.away)
    place_people(world.people, state.people, e, work.crowd)
    copy_capsules(work.crowd.columns, state.people.columns[e])
    copy_rows(work.crowd.columns, trial.columns1)
    for k in range(trial.cylinders1.shape[0]):
        for i in range(3):
            trial.cylinders1[k, i] = state.people.cylinders[e, k, i]


@kernel(inline="always")
def _show_going(state: ReachState, e: int, space: SsmWorkspace) -> None:
    """Tell the layer how the walkers of environment ``e`` go on, as measured."""
    rows, m = state.people.walkers.rows, space.known_speed.shape[0] - space.velocity.shape[0]
    for k in range(space.velocity.shape[0]):
        row, going = rows[e, k], space.velocity[k]
        going[0], going[1], going[2] = row[VX], row[VY], row[GROWTH]
        space.known_speed[m + k] = math.hypot(row[VX], row[VY]) + abs(row[GROWTH])


@kernel(inline="always")
def _execute(world: ReachWorld, state: ReachState, e: int, guard: Guard, work: Work) -> None:
    """Ask the safety layer about the piece in ``work``; what is executed is in its watch."""
    trial, account = guard.trial, guard.account[e]
    watch, override = trial.ssm, 1.0
    for j in range(6):
        trial.q[j], trial.qd[j] = state.q[e, j], state.qd[e, j]
    if guard.measured:
        _show_going(state, e, watch)
    if guard.guarded:
        people = PeopleShapes(trial.columns0, trial.cylinders0)
        path = JointPath(trial.q, trial.qd, work.c, work.d)
        override = decide(world.arm, guard.safety, 0.0, people, path, watch)
    else:
        watch.deceleration[0] = 0.0
        for j in range(6):
            watch.c[j], watch.d[j] = work.c[j], work.d[j]
            watch.end.q[j], watch.end.qd[j], watch.end.qdd[j] = (
                work.q[j],
                work.qd[j],
                work.qdd[j],
            )
    guard.override[e] = override
    account[PERIODS] += 1.0
    account[STOPPED] += 1.0 if override <= 0.0 else 0.0
    account[BELOW_HALF] += 1.0 if override < 0.5 else 0.0
    account[SLOWED] += 1.0 if override < 1.0 else 0.0


@kernel(inline="always")
def _touch(world: ReachWorld, guard: Guard, e: int) -> bool:
    """Note whether people touch the robot, and how fast the link is; tell if it ends here."""
    arm, trial, account = world.arm, guard.trial, guard.account[e]
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
    return guard.rest_ends or speed > MOVING


@kernel(inline="always")
def _arrive(world: ReachWorld, state: ReachState, e: int, guard: Guard, work: Work) -> float:
    """Put the robot where the period ends and measure; return the distance to the goal [m]."""
    arm, watch, account = world.arm, guard.trial.ssm, guard.account[e]
    place_robot(arm, state.q[e], work.robot)
    x, y, z = work.robot.tcp[0], work.robot.tcp[1], work.robot.tcp[2]
    square, fastest = 0.0, 0.0
    for j in range(6):
        square += (watch.end.q[j] - state.q[e, j]) ** 2
        fastest = max(fastest, abs(watch.end.qd[j]))
        state.q[e, j], state.qd[e, j], state.qdd[e, j] = (
            watch.end.q[j],
            watch.end.qd[j],
            watch.end.qdd[j],
        )
    account[JOINT_WAY] += math.sqrt(square)
    if fastest < AT_REST:
        account[STANDING] += 1.0
        account[HELD] += 1.0 if guard.override[e] <= 0.0 else 0.0
    place_robot(arm, state.q[e], work.robot)
    tcp = work.robot.tcp
    account[TOOL_WAY] += math.sqrt((tcp[0] - x) ** 2 + (tcp[1] - y) ** 2 + (tcp[2] - z) ** 2)
    copy_capsules(work.robot.columns, state.robot[e])
    clear = clearances(arm, world.people, work.robot, work.crowd)
    state.clear[e, 0], state.clear[e, 1], state.clear[e, 2] = clear
    return float(tcp_distance(state.goal[e], work.robot))


@kernel(inline="always")
def guarded_period(
    world: ReachWorld, rules: ReachRules, weights: ReachWeights, state: ReachState, e: int,
    guard: Guard, work: Work,
) -> float:  # fmt: skip
    """Run one period of environment ``e`` with the commanded piece in ``work.c, work.d``.

    Args:
        world: Shared data.
        rules: Time limit and ends.
        weights: Reward coefficients.
        state: Rows; changed.
        e: Environment.
        guard: Safety layer, tracks and accounts.
        work: ``c``, ``d`` are the command; ``q``, ``qd``, ``qdd`` its end.

    Returns:
        The reward of the period.
    """
    _people_before(world, state, e, guard.trial)
    _execute(world, state, e, guard, work)
    _people_after(world, state, e, guard, work)
    touched = _touch(world, guard, e)
    before = state.distance[e]
    d = _arrive(world, state, e, guard, work)
    state.distance[e] = d
    state.elapsed[e] += world.arm.dt
    left = rules.time_limit - state.elapsed[e]
    state.time_left[e] = min(guard.horizon, left)
    if not touched and min(state.clear[e, 1], state.clear[e, 2]) <= 0.0:
        touched, guard.account[e, CONTACT] = True, CELL
    if touched:
        state.touched[e] += 1
        state.outcome[e] = COLLISION
    elif d < SUCCESS_DISTANCE:
        state.outcome[e] = SUCCESS
    elif left <= 1e-9:
        state.outcome[e] = TIMEOUT
    stopped = weights.c_o if guard.override[e] <= 0.0 else 0.0
    return reward(before, d, work.c, touched, state.outcome[e] == SUCCESS, weights) - stopped


@kernel(inline="always")
def command(
    world: ReachWorld, action: ActionRule, state: ReachState, e: int, act: NDArray[np.float32],
    work: Work,
) -> None:  # fmt: skip
    """Write the piece that an action commands into the work space."""
    arm = world.arm
    start = JointState(state.q[e], state.qd[e], state.qdd[e])
    segment, end = Coefficients(work.c, work.d), JointState(work.q, work.qd, work.qdd)
    advance(action, arm.limits, arm.dt, start, act, segment, end)


@kernel(nogil=True, error_model="numpy")
def begin_rows(
    world: ReachWorld, state: ReachState, rows: Indices, guard: Guard, work: Work
) -> None:
    """Begin the episodes of some environments, shape (k,), that were just reset."""
    for e in rows:
        begin_episode(world, state, e, guard, work)


@kernel(inline="always")
def take_piece(state: ReachState, e: int, c: Vec, dt: float, work: Work) -> None:
    """Write a given piece of degree 2, by its second coefficients, into the work space."""
    for j in range(6):
        work.c[j], work.d[j], work.qdd[j] = c[j], 0.0, 2.0 * c[j]
        work.q[j] = state.q[e, j] + dt * (state.qd[e, j] + dt * c[j])
        work.qd[j] = state.qd[e, j] + 2.0 * dt * c[j]


@kernel(nogil=True, error_model="numpy")
def step_rows(
    world: ReachWorld,
    rules: ReachRules,
    action: ActionRule,
    weights: ReachWeights,
    state: ReachState,
    guard: Guard,
    work: Work,
    rows: Indices,
    act: NDArray[np.float32],
    pieces: Vec,
    rew: NDArray[np.float32],
    ended: NDArray[np.int64],
) -> None:
    """Step some environments under the safety layer, by actions or given pieces.

    Both in one kernel: the period would be compiled twice in two.

    Args:
        world: Shared data.
        rules: Time limit and ends.
        action: How actions are read.
        weights: Reward coefficients.
        state: Rows; changed.
        guard: Safety layer, tracks and accounts.
        work: Work space.
        rows: Which environments, shape (k,).
        act: Actions of all environments, shape (n_envs, 6).
        pieces: In place of actions the second coefficients of pieces of degree 2 [rad/s^2],
            shape (k, 6); none for actions.
        rew: Filled for those environments, shape (n_envs,).
        ended: Filled with how their episodes ended, or RUNNING, shape (n_envs,).
    """
    for k in range(rows.shape[0]):
        e = rows[k]
        ended[e], rew[e] = RUNNING, 0.0
        if state.outcome[e] != RUNNING:
            continue
        if pieces.shape[0] > 0:
            take_piece(state, e, pieces[k], world.arm.dt, work)
        else:
            command(world, action, state, e, act[e], work)
        rew[e] = guarded_period(world, rules, weights, state, e, guard, work)
        ended[e] = state.outcome[e]
        if ended[e] != RUNNING:
            for i in range(N_ACCOUNT):
                guard.closed[e, i] = guard.account[e, i]
