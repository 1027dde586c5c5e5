"""Inverse kinematics for positions with any orientation: damped least squares on Pinocchio.

Source: Wampler, *Manipulator inverse kinematic solutions based on vector formulations and
damped least-squares methods* (1986). The closed form for a tool that points down is in
``kernels/kinematics.py``.
"""

import numpy as np

from app.sim.core.arrays import Vec
from app.sim.robot.ur10 import Robot

DAMPING = 0.05
"""Damping of the least squares [m/rad]: keeps steps short near singular configurations."""
LONGEST_STEP = 0.3
"""Longest step of a joint per iteration [rad]."""
ITERATIONS = 60
CLOSE = 1e-4
"""Distance of tcp and target at which the iteration ends [m]."""


def configuration_at(
    robot: Robot, point: Vec, start: Vec, limits: tuple[Vec, Vec], n_joints: int = 6
) -> Vec | None:
    """Return a configuration with the tcp at a point [rad], shape (6,); None if none is found.

    Args:
        point: Position of the tcp [m], shape (3,).
        start: Configuration from which the iteration starts [rad], shape (6,).
        limits: Lower and upper joint limits [rad], shape (6,) each.
        n_joints: Joints that move, from the base on; the others stay as they are.
    """
    q, moving = start.copy(), slice(0, n_joints)
    low, high = limits[0][moving], limits[1][moving]
    for _ in range(ITERATIONS):
        miss = point - robot.tcp_pose(q)[:3, 3]
        if float(np.linalg.norm(miss)) <= CLOSE:
            return q
        jacobian = robot.jacobian(q)[:3, moving]
        square = jacobian @ jacobian.T + DAMPING**2 * np.eye(3)
        step = jacobian.T @ np.linalg.solve(square, miss)
        step *= min(1.0, LONGEST_STEP / max(float(np.abs(step).max()), 1e-12))
        q[moving] = np.clip(q[moving] + step, low, high)
    return None
