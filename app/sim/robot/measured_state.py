"""Validation of a measured robot state slightly or far outside its limits.

A drive commanded at 0.999997 of its speed limit is measured beyond it half of the time. Such a
state is accepted and flagged: policies observe it clamped to the limits, and the commanded
segment starts at the measured positions and speeds and returns inside at the acceleration
limits. Speed and separation monitoring uses the measured state, so that distances, stop times
and stop distances are correct. Accelerations are commanded, so a segment of a jerk-limited
policy starts at the clamped one.

A state far outside is rejected, with a hint at degrees or joints off by a whole turn.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from app.errors import InvalidInput, interval
from app.sim.core.arrays import Vec, as_kernel_array
from app.sim.core.kernels.bounds import are_inside
from app.sim.core.out_of_range import OutOfRangeValue
from app.sim.robot.kernels.arm import Arm
from app.sim.robot.kernels.joints import JointLimits
from app.sim.robot.kernels.override import stop_time
from app.sim.robot.ur10 import JOINT_NAMES

SLACK = 1e-6
"""Excess over a limit that counts as rounding and is not flagged [rad, rad/s, rad/s^2]."""
POSITION_TOLERANCE = 0.05
"""Tolerance of measured positions outside a limit [rad], besides the distance of a stop
from the speed limit: a joint that passes its limit while it brakes is still answered."""
LONGEST_OVERRUN = 0.2
"""Largest tolerance for the distance of this stop [rad]."""
RATE_TOLERANCE = 0.05
"""Share of a speed or acceleration limit by which a joint may be measured beyond it."""
LEAST_TOLERANCE = (0.01, 0.05)
"""Least of these tolerances: speed [rad/s] and acceleration [rad/s^2]."""
LARGEST = 1e6
"""Largest acceleration that is accepted where none is needed [rad/s^2]."""
FREE = 1e3
"""Stands for a position limit that does not bind [rad]."""
TURN = 2.0 * math.pi
PARTS = (("q", "rad"), ("qd", "rad/s"), ("qdd", "rad/s^2"))
"""The vectors of a state, and their units."""
_AT_REST = np.zeros(6)


class Joints(NamedTuple):
    """Positions, speeds and accelerations of the joints, base to wrist 3, shape (6,) each."""

    q: Vec
    """[rad]"""
    qd: Vec
    """[rad/s]"""
    qdd: Vec
    """[rad/s^2]"""


class MeasuredState(NamedTuple):
    """A state whose excess over the limits is within the tolerances."""

    measured: Joints
    """As given."""
    clamped: Joints
    """Inside the limits, as policies observe it; the same object where nothing is outside."""
    outside: tuple[OutOfRangeValue, ...]
    """Joints outside, with their limits."""


class StateLimits:
    """Validates measured states of one robot.

    Args:
        arm: From :func:`~app.sim.scene.scene.arm_of`.
        limits_jerk: Whether the policy limits jerk, and thus needs accelerations. Where it does
            not, they are clamped and flagged however far outside they are.
    """

    def __init__(self, arm: Arm, *, limits_jerk: bool) -> None:
        self._limits_jerk = limits_jerk
        stop_s = stop_time((1.0 + RATE_TOLERANCE) * arm.limits.qd_max, arm.limits.qdd_max)
        overrun = 0.5 * (1.0 + RATE_TOLERANCE) * arm.limits.qd_max * stop_s
        self._low = np.stack([arm.limits.q_min, -arm.limits.qd_max, -arm.limits.qdd_max])
        self._high = np.stack([arm.limits.q_max, arm.limits.qd_max, arm.limits.qdd_max])
        self._bounds = (self._low - SLACK).ravel(), (self._high + SLACK).ravel()
        self._tolerance = np.stack(
            [
                POSITION_TOLERANCE + np.minimum(overrun, LONGEST_OVERRUN),
                np.maximum(RATE_TOLERANCE * arm.limits.qd_max, LEAST_TOLERANCE[0]),
                np.maximum(RATE_TOLERANCE * arm.limits.qdd_max, LEAST_TOLERANCE[1]),
            ]
        )
        if not limits_jerk:
            self._tolerance[2] = LARGEST

    def take(self, q: Vec, qd: Vec, qdd: Vec | None = None) -> MeasuredState:
        """Return a measured state as given and as policies observe it.

        Args:
            q: Joint positions [rad], shape (6,).
            qd: Joint speeds [rad/s], shape (6,).
            qdd: Joint accelerations [rad/s^2], shape (6,); zeros where None, which only a
                policy takes that does not limit jerk.

        Raises:
            InvalidInput: Another number of joints, a number that is not finite, or one whose
                excess over its limits is above the tolerance; or no accelerations.
        """
        if qdd is None and self._limits_jerk:
            rule = "must be given: this policy limits jerk, which needs the accelerations"
            raise InvalidInput("robot.qdd", None, rule)
        given = (q, qd, _AT_REST if qdd is None else qdd)
        values = np.concatenate(
            [_six(name, one) for (name, _), one in zip(PARTS, given, strict=True)]
        )
        measured = Joints(values[:6], values[6:12], values[12:])
        if are_inside(values, *self._bounds):
            return MeasuredState(measured, measured, ())
        state = values.reshape(3, 6)
        inside = (self._low - SLACK <= state) & (state <= self._high + SLACK)
        self._require_near(state)
        outside = tuple(
            OutOfRangeValue(
                field=f"robot.{PARTS[part][0]}.{JOINT_NAMES[joint]}",
                value=float(state[part, joint]),
                low=float(self._low[part, joint]),
                high=float(self._high[part, joint]),
                of="limits",
            )
            for part, joint in np.argwhere(~inside).tolist()
        )
        return MeasuredState(measured, Joints(*np.clip(state, self._low, self._high)), outside)

    def _require_near(self, state: Vec) -> None:
        low, high = self._low - self._tolerance, self._high + self._tolerance
        # Written so that NaN is far, too.
        far = np.argwhere(~((low <= state) & (state <= high))).tolist()
        if not far:
            return
        part, joint = far[0]
        name, unit = PARTS[part]
        field, value = f"robot.{name}[{joint}]", float(state[part, joint])
        if not math.isfinite(value):
            raise InvalidInput(field, value, "must be finite")
        least, most = self._low[part, joint], self._high[part, joint]
        slack = self._tolerance[part, joint]
        rule = f"must lie in {interval(least, most)} {unit}, at most {slack:.2g} outside"
        hint = self._hint(part, joint, state[part])
        raise InvalidInput(field, value, rule + (f" ({hint})" if hint else ""))

    def _hint(self, part: int, joint: int, values: Vec) -> str:
        """Return a hint about one vector of a state; empty without one."""
        low = self._low[part] - self._tolerance[part]
        high = self._high[part] + self._tolerance[part]
        value, turned = float(values[joint]), np.radians(values)
        largest = float(np.abs(values).max())
        there = value - math.copysign(TURN, value)
        if part == 0 and largest <= 2.0 * TURN and low[joint] <= there <= high[joint]:
            return f"a whole turn away? {there:.4g} lies inside"
        beyond = TURN if part == 0 else 5.0 * float(self._high[part].max())
        if largest > beyond and ((low <= turned) & (turned <= high)).all():
            return f"degrees? in {PARTS[part][1]} that is {math.radians(value):.4g}"
        return ""


def _six(name: str, values: ArrayLike) -> Vec:
    vector = np.asarray(values, dtype=np.float64)
    if vector.shape != (6,):
        raise InvalidInput(f"robot.{name}", vector.tolist(), "must hold 6 numbers")
    return vector


def returning(arm: Arm, q: Vec, act: Vec) -> tuple[Vec, JointLimits]:
    """Return action and limits that lead joints outside their position limits back inside.

    Such a joint is given the whole action inward and no limit on the exceeded side: its speed
    turns inward as fast as its acceleration (and jerk) limits allow.

    Args:
        q: Joint positions [rad], shape (6,).
        act: Action in [-1, 1], shape (6,).

    Returns:
        Action, shape (6,), and limits; those of ``arm`` itself where no joint is outside.
    """
    limits = arm.limits
    if are_inside(q, limits.q_min, limits.q_max):
        return act, limits
    below, above = q < limits.q_min, q > limits.q_max
    inward = np.where(above, -1.0, np.where(below, 1.0, act))
    low, high = np.where(below, -FREE, limits.q_min), np.where(above, FREE, limits.q_max)
    return inward, limits._replace(q_min=low, q_max=high)


def admitting(arm: Arm, q: Vec, qd: Vec) -> Arm:
    """Return the robot with position and speed limits that its own straight stop keeps.

    Speed and separation monitoring admits only trajectories inside the limits and stops
    otherwise. A state whose straight stop leaves the limits would always be stopped, at any
    distance of people. Acceleration limits are kept: they determine the stop.

    Args:
        q: Joint positions as measured [rad], shape (6,).
        qd: Joint speeds as measured [rad/s], shape (6,).
    """
    rest = q + 0.5 * stop_time(qd, arm.limits.qdd_max) * qd
    low, high, fast = np.minimum(q, rest), np.maximum(q, rest), np.abs(qd)
    if (
        (arm.limits.q_min <= low).all()
        and (high <= arm.limits.q_max).all()
        and (fast <= arm.limits.qd_max).all()
    ):
        return arm
    wider = arm.limits._replace(
        q_min=as_kernel_array(np.minimum(arm.limits.q_min, low)),
        q_max=as_kernel_array(np.maximum(arm.limits.q_max, high)),
        qd_max=as_kernel_array(np.maximum(arm.limits.qd_max, fast)),
    )
    return arm._replace(limits=wider)
