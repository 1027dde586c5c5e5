"""Steps of the pick scenario under speed and separation monitoring (compiled).

A control period is that of ``pick/kernels/episode.py`` with the safety layer between command
and robot (``scenario/kernels/monitored_motion.py``).

Source: docs/method.md 2.7.
"""

import numpy as np
from numpy.typing import NDArray

from app.sim.core.jit import kernel
from app.sim.pick.kernels.episode import conclude
from app.sim.pick.kernels.starts import PickCell, PickTask
from app.sim.scenario.kernels.episode import RUNNING, EpisodeState, Indices, StepWorkspace
from app.sim.scenario.kernels.monitored_motion import (
    close_account,
    command_action,
    move_monitored,
)
from app.sim.scenario.kernels.monitored_state import MonitoredState


@kernel(nogil=True, error_model="numpy")
def step_monitored(
    world: PickCell,
    task: PickTask,
    state: EpisodeState,
    monitor: MonitoredState,
    work: StepWorkspace,
    act: NDArray[np.float32],
    rew: NDArray[np.float32],
    ended: Indices,
) -> None:
    """Step all environments under the safety layer; see ``pick.kernels.episode.step_batch``.

    Args:
        task: Rules, action type and reward coefficients.
        state: Environments; changed.
        monitor: Safety layer and accounts.
        act: Actions in [-1, 1], shape (n_envs, 5).
        rew: Filled with rewards, shape (n_envs,).
        ended: Filled with the outcome of episodes that ended now, RUNNING elsewhere.
    """
    for e in range(state.q.shape[0]):
        ended[e], rew[e] = RUNNING, 0.0
        if state.outcome[e] != RUNNING:
            continue
        unfeasible = command_action(world.arm, task.action, state, e, act[e], work)
        touched = move_monitored(world.arm, world.people, state, e, monitor, work)
        state.time_left[e] -= world.arm.dt
        rew[e] = conclude(world, task, state, e, touched, unfeasible, work)
        ended[e] = state.outcome[e]
        if ended[e] != RUNNING:
            close_account(monitor, e)
