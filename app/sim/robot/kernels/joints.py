"""Limits, states and trajectories of the robot's joints, as tuples that kernels take."""

from typing import NamedTuple

import numpy as np

from app.sim.core.arrays import Vec


class AxisLimits(NamedTuple):
    """Limits of one joint, and the control period."""

    q_min: float
    """Lower position limit [rad]."""
    q_max: float
    """Upper position limit [rad]."""
    qd_max: float
    """Speed limit [rad/s]."""
    qdd_max: float
    """Acceleration limit [rad/s^2]."""
    jerk_max: float
    """Jerk limit [rad/s^3]."""
    dt: float
    """Control period [s]."""


class AxisState(NamedTuple):
    """State of one joint."""

    q: float
    """Position [rad]."""
    qd: float
    """Speed [rad/s]."""
    qdd: float
    """Acceleration [rad/s^2]."""


class JointLimits(NamedTuple):
    """Limits of all joints, each of shape (6,)."""

    q_min: Vec
    """Lower position limits [rad]."""
    q_max: Vec
    """Upper position limits [rad]."""
    qd_max: Vec
    """Speed limits [rad/s]."""
    qdd_max: Vec
    """Acceleration limits [rad/s^2]."""
    jerk_max: Vec
    """Jerk limits [rad/s^3]."""

    def within_half_turn(self) -> tuple[Vec, Vec]:
        """Return position limits [rad] cut to half a turn either way, where that leaves any."""
        low, high = np.maximum(self.q_min, -np.pi), np.minimum(self.q_max, np.pi)
        left = low < high
        return np.where(left, low, self.q_min), np.where(left, high, self.q_max)


class JointState(NamedTuple):
    """State of all joints, each of shape (6,)."""

    q: Vec
    """Positions [rad]."""
    qd: Vec
    """Speeds [rad/s]."""
    qdd: Vec
    """Accelerations [rad/s^2]."""


class JointPath(NamedTuple):
    """Path ``q + qd s + c s^2 + d s^3`` of all joints, each array of shape (6,)."""

    q: Vec
    """Positions at its start [rad]."""
    qd: Vec
    """First coefficients: speeds at its start [rad/s]."""
    c: Vec
    """Second coefficients [rad/s^2]."""
    d: Vec
    """Third coefficients [rad/s^3]."""
