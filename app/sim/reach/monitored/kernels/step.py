"""Steps of the reach scenario under speed and separation monitoring (compiled).

A control period is that of ``reach/kernels/episode.py`` with the safety layer between command
and robot (``scenario/kernels/monitored_motion.py``).

Source: docs/method.md 2.6 (last row) and 2.7.
"""

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.reach.kernels.episode import ReachCell, ReachTask, outcome_of
from app.sim.reach.kernels.reward import reward
from app.sim.reach.monitored.kernels.state import Commands, StepResults
from app.sim.robot.kernels.actions import MYOPIC
from app.sim.scenario.kernels.episode import (
    RUNNING,
    SUCCESS,
    SUCCESS_DISTANCE,
    EpisodeState,
    Indices,
    StepWorkspace,
    distance_to,
)
from app.sim.scenario.kernels.monitored_motion import (
    close_account,
    command_action,
    move_monitored,
)
from app.sim.scenario.kernels.monitored_state import MonitoredState


@kernel(inline="always")
def monitored_cycle(
    world: ReachCell,
    task: ReachTask,
    state: EpisodeState,
    e: int,
    monitor: MonitoredState,
    unfeasible: bool,
    work: StepWorkspace,
) -> float:
    """Execute one control period of environment ``e``; return the reward.

    Args:
        task: Time limit and reward coefficients.
        state: Environments; changed.
        e: Environment.
        monitor: Safety layer, tracks and accounts.
        unfeasible: Whether the one-step bounds left no admissible coefficient.
        work: ``c``, ``d`` are the command; ``q``, ``qd``, ``qdd`` its end.
    """
    weights, before = task.weights, state.distance[e]
    touched = move_monitored(world.arm, world.people, state, e, monitor, work)
    left = task.rules.time_limit - state.elapsed[e]
    state.time_left[e] = min(monitor.horizon, left)
    d = distance_to(state.goal[e], work.robot)
    state.distance[e] = d
    if touched:
        state.touched[e] += 1
    near = d < SUCCESS_DISTANCE
    state.outcome[e] = outcome_of(touched, touched, near, unfeasible, left, True)
    stopped = weights.c_o if monitor.override[e] <= 0.0 else 0.0
    return reward(before, d, work.c, touched, state.outcome[e] == SUCCESS, weights) - stopped


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
def step_envs(
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

    One kernel for actions and segments, because two would compile the control period twice.

    Args:
        task: Rules, action type and reward coefficients.
        state: Environments; changed.
        monitor: Safety layer, tracks and accounts.
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
        unfeasible = False
        if commands.segments.shape[0] > 0:
            _command_segment(state, e, commands.segments[k], world.arm.dt, work)
        else:
            empty = command_action(world.arm, task.action, state, e, commands.act[e], work)
            unfeasible = empty and task.action.bounds == MYOPIC
        rew[e] = monitored_cycle(world, task, state, e, monitor, unfeasible, work)
        ended[e] = state.outcome[e]
        if ended[e] != RUNNING:
            close_account(monitor, e)
