"""Episodes of any scenario under speed and separation monitoring: settings, state, results.

``kernels/monitored_motion.py`` moves a robot for a control period; each scenario has a batch
that uses it.

Source: docs/method.md 2.7.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec, as_kernel_array
from app.sim.core.jit import FAR
from app.sim.people.kernels.people import new_people_geometry
from app.sim.safety.kernels.adversarial_people import new_trial_work
from app.sim.safety.kernels.adversarial_trials import MOVING
from app.sim.safety.kernels.separation_check import new_ssm_workspace
from app.sim.safety.layer import SafetySettings, separation_rule
from app.sim.scenario.batch import EnvBatch
from app.sim.scenario.kernels.episode import SUCCESS, EpisodeState
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
from app.sim.scene.scene import new_people_state


@dataclass(frozen=True, slots=True, kw_only=True)
class MonitoringSettings:
    """Settings of the episodes beyond the assumptions of the safety layer."""

    active: bool = True
    """Whether the safety layer acts."""
    rest_ends: bool = True
    """Whether a person who touches a robot at standstill ends the episode; contact with a
    moving link always does."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MonitoredEpisodes:
    """Results of n episodes under the safety layer; arrays of shape (n,)."""

    arrived: NDArray[np.bool_]
    """Whether the episode succeeded in time."""
    seconds: Vec
    """Duration [s]."""
    override: Vec
    """Mean override in [0, 1]."""
    stopped_s: Vec
    """Time with override 0 [s]."""
    below_half_s: Vec
    """Time with override below one half, including 0 [s]."""
    standstill_s: Vec
    """Time at standstill for any reason [s]."""
    standstill_stopped_s: Vec
    """Time at standstill with override 0 [s]; braking does not count."""
    joint_path: Vec
    """Path length in joint space [rad]."""
    tool_path: Vec
    """Path length of the tcp [m]."""
    touched_moving: NDArray[np.bool_]
    """Whether a person touched a moving link."""
    touched_at_rest: NDArray[np.bool_]
    """Whether a person walked into a link at standstill."""
    touched_cell: NDArray[np.bool_]
    """Whether the robot touched its cell or itself."""
    link_speed: Vec
    """Speed of the touching link [m/s]."""
    allowed_speed: Vec
    """Speed at which power and force limiting permits to touch that part [m/s]."""
    person_speed: Vec
    """Greatest speed of any point of the people [m/s]."""


def new_monitored_state(
    batch: EnvBatch,
    safety: SafetySettings,
    monitoring: MonitoringSettings,
    tracks: Vec | None = None,
    horizon_s: float = FAR,
) -> MonitoredState:
    """Return safety layer and accounts of the environments of a batch.

    Args:
        batch: Environments with a cell.
        safety: Assumptions of the safety layer.
        monitoring: Further settings.
        tracks: Cylinder of each environment's only person at the ends of control periods: x, y,
            radius [m], shape (n_envs, n + 1, 3); None for people who walk by themselves.
        horizon_s: Largest time left that policies observe [s].
    """
    arm, people, n_envs = batch.arm, batch.world.people, batch.n_envs
    n_workers, n_cylinders = (
        batch.state.people.q.shape[1],
        batch.state.people.cylinders.shape[1],
    )
    shape = (people.capsules.shape[1], n_cylinders)
    return MonitoredState(
        safety=separation_rule(safety, *shape, safety.use_measured_velocity),
        active=monitoring.active,
        rest_ends=monitoring.rest_ends,
        horizon=horizon_s,
        measured=safety.use_measured_velocity,
        tracks=np.zeros((0, 1, 3)) if tracks is None else as_kernel_array(tracks),
        period=np.zeros(n_envs, dtype=np.int64),
        trial=new_trial_work(
            arm,
            people,
            new_people_state(batch.cell, people, 1),
            new_people_geometry(people, n_workers, n_cylinders),
            (
                new_ssm_workspace(arm, *shape),
                new_ssm_workspace(arm, *shape),
            ),
            0,
        ),
        override=np.ones(n_envs),
        account=np.zeros((n_envs, N_ACCOUNT)),
        closed=np.zeros((n_envs, N_ACCOUNT)),
    )


def monitored_episodes(
    monitor: MonitoredState, state: EpisodeState, dt: float
) -> MonitoredEpisodes:
    """Return the results of all environments, once all episodes have ended.

    Args:
        monitor: Accounts of the environments.
        dt: Control period [s].
    """
    account = monitor.closed
    moving = (account[:, CONTACT] == PERSON) & (account[:, SPEED] > MOVING)
    periods = account[:, PERIODS]
    return MonitoredEpisodes(
        arrived=state.outcome == SUCCESS,
        seconds=dt * periods,
        override=account[:, OVERRIDES] / np.maximum(periods, 1.0),
        stopped_s=dt * account[:, STOPPED],
        below_half_s=dt * account[:, BELOW_HALF],
        standstill_s=dt * account[:, STANDSTILL],
        standstill_stopped_s=dt * account[:, STANDSTILL_STOPPED],
        joint_path=account[:, JOINT_PATH].copy(),
        tool_path=account[:, TOOL_PATH].copy(),
        touched_moving=moving,
        touched_at_rest=(account[:, TOUCHED_AT_REST] > 0.0) & ~moving,
        touched_cell=account[:, CONTACT] == CELL,
        link_speed=account[:, SPEED].copy(),
        allowed_speed=account[:, ALLOWED].copy(),
        person_speed=account[:, FASTEST].copy(),
    )


def joined(parts: Sequence[MonitoredEpisodes]) -> MonitoredEpisodes:
    """Return several sets of runs as one."""
    names = MonitoredEpisodes.__dataclass_fields__
    values: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts]) for name in names
    }
    return MonitoredEpisodes(**values)


def selected(runs: MonitoredEpisodes, which: NDArray[np.int64]) -> MonitoredEpisodes:
    """Return the runs with the given indices, shape (k,)."""
    names = MonitoredEpisodes.__dataclass_fields__
    values: dict[str, Any] = {name: getattr(runs, name)[which] for name in names}
    return MonitoredEpisodes(**values)
