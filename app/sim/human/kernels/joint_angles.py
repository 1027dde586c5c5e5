"""Joint angles of the 18-DoF person from directions of limbs, compiled.

The inverse of ``human/kernels/kinematics.py`` by body part; used for key-points
(``pose_fit.py``) and recordings (``inverse_kinematics.py``). With the torso's axes x, y, z in
the frame of the pelvis,

    Ry(flex) Rx(side) Rz(twist):  flex = atan2(z_x, z_z),  side = -asin(z_y),
                                  twist = atan2(x_y, y_y);

an upper arm of direction u in the torso has flexion ``atan2(u_x, -u_z)`` and lateral elevation
``asin(u_y)`` (abduction on the left, minus abduction on the right); its rotation aligns the
arm's first axis with the elbow's bend. (flex, abduct, rotate) and (flex + pi, pi - abduct,
rotate + pi) are the same orientation.

Source: docs/method.md 3.4.
"""

import math

import numpy as np

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel

Point = tuple[float, float, float]


@kernel(inline="always")
def unit_range(value: float) -> float:
    """Return a sine or cosine inside [-1, 1]; NaN stays NaN."""
    return max(-1.0, min(1.0, value)) if value == value else value


@kernel(inline="always")
def heading(x: float, y: float) -> float:
    """Return the yaw [rad] of a person whose left side points along (x, y)."""
    return math.atan2(-x, y)


@kernel(inline="always")
def turn_angles(x_y: float, y_y: float, z: Point) -> Point:
    """Return flexion, side bend and twist [rad] of a torso.

    Args:
        x_y: Second component of its x axis, seen from the pelvis.
        y_y: Second component of its y axis.
        z: Its z axis.
    """
    return (
        math.atan2(z[0], z[2]),
        -math.asin(unit_range(z[1])),
        math.atan2(x_y, y_y),
    )


@kernel(inline="always")
def clavicle_angles(forward: float, outward: float, up: float) -> tuple[float, float]:
    """Return protraction and elevation [rad] of a clavicle, from its unit direction."""
    return math.atan2(forward, outward), math.asin(unit_range(up))


@kernel(inline="always")
def arm_lift(u: Point) -> tuple[float, float]:
    """Return flexion and lift to the left [rad] of an upper arm of unit direction ``u``."""
    return math.atan2(u[0], -u[2]), math.asin(unit_range(u[1]))


@kernel(inline="always")
def arm_rotation(flex: float, lift: float, toward: Point) -> float:
    """Return the turn about an upper arm [rad] that bends its elbow ``toward``.

    Args:
        flex: Flexion [rad].
        lift: Lift to the left [rad].
        toward: Direction in the torso, normal to the arm, any length.
    """
    cf, sf, cl, sl = math.cos(flex), math.sin(flex), math.cos(lift), math.sin(lift)
    first = cf * toward[0] + sf * toward[2]
    second = -sf * sl * toward[0] + cl * toward[1] + cf * sl * toward[2]
    return math.atan2(second, first)


@kernel(error_model="numpy")
def turns_to_angles(turns: Vec, out: Vec) -> None:
    """Write flexion, side bend and twist [rad] of every torso, (n, 3, 3) to (n, 3)."""
    for k in range(turns.shape[0]):
        t = turns[k]
        z = (t[0, 2], t[1, 2], t[2, 2])
        out[k, 0], out[k, 1], out[k, 2] = turn_angles(t[1, 0], t[1, 1], z)


@kernel(error_model="numpy")
def clavicles_to_angles(directions: Vec, side: float, out: Vec) -> None:
    """Write protraction and elevation [rad], shape (n, 2).

    Args:
        directions: Neck to shoulder in the torso, unit vectors, shape (n, 3).
        side: -1 right, 1 left.
        out: Filled.
    """
    for k in range(directions.shape[0]):
        d = directions[k]
        out[k, 0], out[k, 1] = clavicle_angles(d[0], side * d[1], d[2])


@kernel(error_model="numpy")
def arms_to_angles(upper: Vec, toward: Vec, side: float, out: Vec) -> None:
    """Write flexion, abduction and rotation [rad], shape (n, 3).

    Args:
        upper: Shoulder to elbow in the torso, unit vectors, shape (n, 3).
        toward: Direction of the elbow's bend, normal to ``upper``, shape (n, 3).
        side: -1 right, 1 left.
        out: Filled.
    """
    for k in range(upper.shape[0]):
        flex, lift = arm_lift((upper[k, 0], upper[k, 1], upper[k, 2]))
        bends = (toward[k, 0], toward[k, 1], toward[k, 2])
        out[k, 0], out[k, 1] = flex, side * lift
        out[k, 2] = arm_rotation(flex, lift, bends)


def headings(across: Vec) -> Vec:
    """Return the yaws [rad], shape (n,), of lines to the left, shape (n, 2 or 3)."""
    return np.asarray(np.arctan2(-across[:, 0], across[:, 1]))
