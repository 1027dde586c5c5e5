"""The raw state of (5.8) from the features that contain it.

Decisions observe features (``kernels/observation.py``); a policy of the raw state is given the
same robot, person and target.
"""

import math

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.pick.kernels.episode import N_PLAIN
from app.sim.pick.kernels.observation_layout import LAYOUT, PELVIS_Y
from app.sim.robot.kernels.arm import CONTROLLED

PELVIS_TURN = math.pi / 2.0
"""Added to the yaw of the pelvis in features [rad]."""


def raw_state(features: NDArray[np.float32], qd_max: Vec) -> NDArray[np.float32]:
    """Return raw states, shape (n, 51).

    The joint that is not controlled is 0, as in training. The yaw of the pelvis lies between
    -3/2 π and 1/2 π.

    Args:
        features: Observations that begin with the features of one person, shape (n, n_obs).
        qd_max: Largest joint speeds [rad/s], shape (6,).
    """
    state = np.zeros((len(features), N_PLAIN), dtype=np.float32)
    state[:, :CONTROLLED] = features[:, LAYOUT["q"]] * np.float32(math.pi)
    state[:, 6 : 6 + CONTROLLED] = features[:, LAYOUT["qd"]] * qd_max[:CONTROLLED]
    state[:, 12:30] = features[:, LAYOUT["human_q"]]
    state[:, 13] += PELVIS_Y
    state[:, 14] -= PELVIS_TURN
    state[:, 30:48] = 2.0 * features[:, LAYOUT["human_qd"]]
    away = 0.5 * features[:, LAYOUT["goal_minus_tcp"]]
    state[:, 48:] = features[:, LAYOUT["tcp"]] + away
    return state
