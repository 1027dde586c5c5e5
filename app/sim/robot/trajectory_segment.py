"""The robot's motion in one control period."""

from dataclasses import dataclass

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
