"""Yielding of a person to the robot arm (compiled).

With clearance ``d`` between person and robot, closeness is ``u = (D_SLOW - d) / (D_SLOW -
D_STOP)`` in [0, 1]. A person of yielding ``k`` works at ``1 - k u`` of its pace and leans its
trunk away from the tool by ``k u LEAN`` with a first-order lag of ``LAG``. A person of
yielding 0 does not react, as in the thesis; one of yielding 1 stops at ``D_STOP``.

Source: docs/method.md 4 (reacting people), future work in the thesis; form and constants are
ours. LAG lies between a simple visual reaction (0.15 to 0.25 s) and the motion time of a trunk.
"""

import math

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.geometry.capsules import X, Y

D_SLOW = 0.4
"""Clearance at which the reaction begins [m]."""
D_STOP = 0.1
"""Clearance at which the reaction is full [m]."""
LEAN = 0.35
"""Largest lean of the trunk [rad]."""
SIDEWAYS = 0.6
"""Sideways lean relative to a forward lean."""
LAG = 0.25
"""Time constant of the lean [s]."""
YAW, FLEX, SIDE = 2, 3, 4
"""Joints of the person: pelvis yaw, abdomen flexion and side bend."""


@kernel(inline="always")
def closeness(distance: float) -> float:
    """Return the closeness of the arm, from 0 (D_SLOW or farther) to 1 (D_STOP or nearer)."""
    return min(1.0, max(0.0, (D_SLOW - distance) / (D_SLOW - D_STOP)))


@kernel(error_model="numpy")
def lean_away(
    q: Vec, qd: Vec, lean: Vec, strength: float, robot: Vec, limits: Vec, dt: float
) -> None:
    """Add a lean away from the robot's tool to a person's joints.

    Args:
        q: Joints at the end of the period without yielding [m, rad], shape (18,); changed.
        qd: Joint speeds [m/s, rad/s], shape (18,); changed.
        lean: Lean forward and to the left [rad] and their rates [rad/s], shape (4,); state of
            the lag.
        strength: Yielding times closeness, from 0 to 1.
        robot: The robot's capsules, shape (9, n); the last one is the tool.
        limits: Lower and upper joint limits [m, rad], shape (2, 18).
        dt: Period [s].
    """
    tool = robot.shape[1] - 1
    x, y = q[0] - robot[X, tool], q[1] - robot[Y, tool]
    length = math.sqrt(x * x + y * y)
    c, s = math.cos(q[YAW]), math.sin(q[YAW])
    ahead = (c * x + s * y) / length if length > 1e-6 else -1.0
    aside = (c * y - s * x) / length if length > 1e-6 else 0.0
    part = 1.0 - math.exp(-dt / LAG)
    wanted_flex, wanted_side = LEAN * strength * ahead, LEAN * SIDEWAYS * strength * aside
    for i, wanted in ((0, wanted_flex), (1, wanted_side)):
        change = part * (wanted - lean[i])
        lean[i] += change
        lean[2 + i] = change / dt
    _add(q, qd, FLEX, lean[0], lean[2], limits)
    # Positive side bend tips the trunk to the right.
    _add(q, qd, SIDE, -lean[1], -lean[3], limits)


@kernel(inline="always")
def _add(q: Vec, qd: Vec, j: int, angle: float, rate: float, limits: Vec) -> None:
    """Add an angle and its rate to one joint, within its limits."""
    value = q[j] + angle
    inside = limits[0, j] < value < limits[1, j]
    q[j] = min(limits[1, j], max(limits[0, j], value))
    qd[j] = qd[j] + rate if inside else 0.0
