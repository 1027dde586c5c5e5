"""The robot's motion in one control period."""

from dataclasses import dataclass

import numpy as np

from app.sim.core.arrays import Vec


@dataclass(frozen=True, slots=True, kw_only=True)
class TrajectorySegment:
    """One control period of the robot: ``q(x) = q + qd x + c x^2 + d x^3``."""

    c: Vec
    """Second coefficients [rad/s^2], shape (6,)."""
    d: Vec
    """Third coefficients [rad/s^3], shape (6,)."""
    q: Vec
    """Joint positions at the end [rad], shape (6,)."""
    qd: Vec
    """Joint speeds at the end [rad/s], shape (6,)."""
    qdd: Vec
    """Joint accelerations at the end [rad/s^2], shape (6,)."""


def executed_coefficients(
    degree: int, dt: float, qd: tuple[Vec, Vec], qdd: tuple[Vec, Vec]
) -> tuple[Vec, Vec]:
    """Return coefficients ``c`` and ``d`` of executed segments from the states at their ends.

    Args:
        degree: Degree of the actions, 2 or 3.
        dt: Control period [s].
        qd: Joint speeds at the start and at the end [rad/s], shape (..., 6) each.
        qdd: Joint accelerations there [rad/s^2], same shapes; only degree 3 reads them.
    """
    if degree == 3:
        return 0.5 * qdd[0], (qdd[1] - qdd[0]) / (6.0 * dt)
    c: Vec = (qd[1] - qd[0]) / (2.0 * dt)
    return c, np.zeros_like(c)
