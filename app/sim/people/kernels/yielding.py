"""A person who gives way to the arm: slows and leans away as it comes close, compiled.

With clearance ``d`` between person and robot, closeness is ``u = (D_SLOW - d) / (D_SLOW -
D_STOP)`` in [0, 1]. A person of yielding ``k`` goes through its work at ``1 - k u`` of its pace
and leans its trunk away from the tool by ``k u LEAN``, with a first-order lag of ``LAG``.
Courtesy 0 is the source's person, who sees no robot; 1 stands still at ``D_STOP``.

Source: METHOD 4 (a human that reacts to the robot); the source leaves it to future work, so the
form and its constants are ours. LAG lies between the 0.15 to 0.25 s of a simple visual reaction
and the time a trunk needs.
"""

import math

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.geometry.capsules import X, Y

D_SLOW = 0.4
"""Clearance at which a person begins to react [m]."""
D_STOP = 0.1
"""Clearance at which the reaction is full [m]."""
LEAN = 0.35
"""Greatest lean of the trunk [rad]."""
SIDEWAYS = 0.6
"""Share of a lean that is done sideways where that is the way."""
LAG = 0.25
"""Time constant of the lean [s]."""
YAW, FLEX, SIDE = 2, 3, 4
"""Joints of the person: pelvis yaw, abdomen flexion and side bend."""


@kernel(inline="always")
def closeness(distance: float) -> float:
    """Return how near the arm is felt, from 0 (D_SLOW or farther) to 1 (D_STOP or nearer)."""
    return min(1.0, max(0.0, (D_SLOW - distance) / (D_SLOW - D_STOP)))


@kernel(error_model="numpy")
def lean_away(
    q: Vec, qd: Vec, lean: Vec, strength: float, robot: Vec, q_min: Vec, q_max: Vec, dt: float
) -> None:
    """Lean a person away from the robot's tool.

    Args:
        q: Joints at the end of the period without reaction [m, rad], shape (18,); changed.
        qd: Joint speeds [m/s, rad/s], shape (18,); changed.
        lean: Lean forward and to the left [rad] and the rates of both [rad/s], shape (4,);
            carried from period to period.
        strength: Courtesy times closeness, from 0 to 1.
        robot: The robot's capsules, shape (9, n); the last one is the tool.
        q_min: Lower joint limits [m, rad], shape (18,).
        q_max: Upper joint limits [m, rad], shape (18,).
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
    _add(q, qd, FLEX, lean[0], lean[2], q_min, q_max)
    # Positive side bend tips the trunk to the right.
    _add(q, qd, SIDE, -lean[1], -lean[3], q_min, q_max)


@kernel(inline="always")
def _add(q: Vec, qd: Vec, j: int, angle: float, rate: float, q_min: Vec, q_max: Vec) -> None:
    """Add an angle and its rate to one joint, inside its limits."""
    value = q[j] + angle
    inside = q_min[j] < value < q_max[j]
    q[j] = min(q_max[j], max(q_min[j], value))
    qd[j] = qd[j] + rate if inside else 0.0
