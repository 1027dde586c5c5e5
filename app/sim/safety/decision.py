"""Decision of the safety layer for one period, and the terms of the separation distance."""

from dataclasses import dataclass

import numpy as np

from app.sim.core.arrays import Vec, as_kernel_array
from app.sim.robot.kernels import override
from app.sim.robot.kernels.joints import JointPath


@dataclass(frozen=True, slots=True, kw_only=True)
class SafetyDecision:
    """Executed motion of one period, and its cause.

    The motion is ``q(s) = q + qd s + c s^2 + d s^3`` at ``s(t) = t - k t^2/2`` until rest, with
    the path deceleration ``k``.
    """

    override: float
    """Path speed at the end of the period, of the commanded 1; 0: the straight stop."""
    c: Vec
    """Second coefficients of the path [rad/s^2], shape (6,)."""
    d: Vec
    """Third coefficients of the path [rad/s^3], shape (6,)."""
    path_deceleration: float
    """Decrease of the path speed, k [1/s]."""
    q: Vec
    """Joint positions after the period [rad], shape (6,)."""
    qd: Vec
    """Joint speeds after the period [rad/s], shape (6,)."""
    qdd: Vec
    """Joint accelerations at its end [rad/s^2], shape (6,)."""
    person: int | None
    """Person that caused the override: workers first, then cylinders; None without any."""
    part: int | None
    """Capsule of the worker; None for a cylinder."""
    link: str | None
    """Link nearest to that part."""
    separation: float | None
    """Their observed distance [m]."""
    required: float | None
    """S_p for that link at its current speed, with the protective distance [m]."""
    lacking: float
    """Missing distance on the refused path [m]."""
    stop_time: float
    """Duration of a stop from now, T_s [s]."""
    stop_distance: float
    """Bound on the displacement of any point of the robot during it, B [m]."""

    def at(self, q: Vec, qd: Vec, t: float) -> tuple[Vec, Vec]:
        """Return joint positions [rad] and speeds [rad/s], shape (6,), in the period.

        Args:
            q: Joint positions at its start [rad], shape (6,).
            qd: Joint speeds at its start [rad/s], shape (6,).
            t: Time since its start [s].
        """
        there, speeds = np.empty(6), np.empty(6)
        path = JointPath(as_kernel_array(q), as_kernel_array(qd), self.c, self.d)
        override.motion_at(path, self.path_deceleration, t, there, speeds)
        return there, speeds


@dataclass(frozen=True, slots=True, kw_only=True)
class SeparationTerms:
    """Terms of S_p of the standard for one person and one link (docs/method.md 2.7).

    ``S_p = v_h (T_r + T_s) + v_r T_r + B + C + Z_d + Z_r`` plus the protective distance.
    """

    link: str
    """Name of the link."""
    separation: float
    """Observed distance [m]."""
    human_speed: float
    """v_h [m/s]."""
    robot_speed: float
    """v_r, bound on the link's speed at the current joint speeds [m/s]."""
    reaction_time: float
    """T_r, with the control period, the tracker's delay and the data's age [s]."""
    stop_time: float
    """T_s [s]."""
    braking: float
    """B, displacement of the link during the stop [m]."""
    intrusion: float
    """C [m]."""
    person_uncertainty: float
    """Z_d [m]."""
    robot_uncertainty: float
    """Z_r [m]."""
    protective_distance: float
    """Distance added to the standard's terms [m]."""

    @property
    def required(self) -> float:
        """S_p and the protective distance [m]."""
        terms = self.human_speed * (self.reaction_time + self.stop_time)
        terms += self.robot_speed * self.reaction_time + self.braking + self.intrusion
        uncertain = self.person_uncertainty + self.robot_uncertainty
        return terms + uncertain + self.protective_distance


def powers_of_time(decision: SafetyDecision, q: Vec, qd: Vec) -> Vec:
    """Return the executed motion as polynomials in time, ascending, shape (6, 7).

    ``q + qd s + c s^2 + d s^3`` at ``s = t - k t^2/2``, expanded in powers of ``t``: seven
    coefficients per joint, from ``t^0`` to ``t^6``. They hold until rest at ``t = 1/k``.

    Args:
        decision: Decision for the period.
        q: Joint positions at its start [rad], shape (6,).
        qd: Joint speeds at its start [rad/s], shape (6,).
    """
    k, c, d = decision.path_deceleration, decision.c, decision.d
    return np.stack(
        [
            q,
            qd,
            c - 0.5 * k * qd,
            d - k * c,
            0.25 * k**2 * c - 1.5 * k * d,
            0.75 * k**2 * d,
            -0.125 * k**3 * d,
        ],
        axis=1,
    )
