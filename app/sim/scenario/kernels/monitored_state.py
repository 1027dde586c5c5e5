"""Safety layer and accounts of episodes under speed and separation monitoring."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.safety.kernels.adversarial_people import TrialWorkspace
from app.sim.safety.kernels.separation_check import SeparationRule

N_ACCOUNT = 13
(
    PERIODS,
    STOPPED,
    BELOW_HALF,
    STANDSTILL,
    STANDSTILL_STOPPED,
    JOINT_PATH,
    TOOL_PATH,
    CONTACT,
    SPEED,
    FASTEST,
    OVERRIDES,
    TOUCHED_AT_REST,
    ALLOWED,
) = range(N_ACCOUNT)
"""Statistics of an episode: control periods; periods with override 0 and below one half;
periods that end at standstill, and those of them with override 0; path length of the joints
[rad] and of the tcp [m]; NO_TOUCH, PERSON or CELL; speed of the touching link [m/s]; greatest
speed of any person [m/s]; sum of the overrides; periods in which a person touches the robot at
standstill; speed at which the part touched by a moving link may be touched [m/s]."""
NO_TOUCH, PERSON, CELL = range(3)
"""Contacts of an episode."""


class MonitoredState(NamedTuple):
    """Safety layer, tracks and episode statistics of the environments."""

    safety: SeparationRule
    """Assumptions of the safety layer."""
    active: bool
    """Whether the layer acts; otherwise segments are executed as commanded."""
    rest_ends: bool
    """Whether a person who touches a robot at standstill ends the episode."""
    horizon: float
    """Largest time left that a policy observes [s]."""
    measured: bool
    """Whether the layer uses the measured velocity of pedestrians."""
    tracks: Vec
    """Cylinder in place of each environment's first pedestrian at the ends of control periods:
    x, y, radius [m], shape (n_envs, n + 1, 3); no rows where people walk by themselves."""
    period: NDArray[np.int64]
    """Control period of each track, shape (n_envs,)."""
    trial: TrialWorkspace
    """Work space of the contact search and the safety layer."""
    override: Vec
    """Override of the last control period, shape (n_envs,)."""
    account: Vec
    """Account of the present episode, shape (n_envs, N_ACCOUNT)."""
    closed: Vec
    """Account of each environment's last completed episode, shape (n_envs, N_ACCOUNT)."""
