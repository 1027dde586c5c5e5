"""Whether a moving robot stays clear of people who grow with time, compiled.

With clearances ``a, b`` at both ends of an interval in which no point of the robot covers more
than ``w``, the clearance inside is at least ``(a + b - w)/2``. That must exceed ``reach(t) =
v_h (lead + t) + D``, how far people may have come, at the end of the interval. Otherwise the
interval is halved, and given up as not clear where that would tell no more than RESOLUTION:
never late. ``w`` is the longest chord of the capsules' ends plus half a bound on the path's
curvature, or the sum of joint ways times levers where that is less.

A cylinder that is known to go on at some velocity counts all along its way since it was seen, a
little more of it at the end of an interval than at its start: that much more may be missing
between them.

Power and force limiting gives parts of people a speed at which they may be touched; they are
passed over in intervals in which no point of the robot is faster. Source: METHOD 2.7.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.geometry.capsules import gaps, greatest_displacement
from app.sim.geometry.cylinder import cylinder_clearance, swept_clearance
from app.sim.robot.kernels import kinematics
from app.sim.robot.kernels.arm import Arm, place_capsules
from app.sim.robot.kernels.override import clock, motion_at

RESOLUTION = 0.01
"""Intervals in which robot and people approach by less than this are not halved [m]."""
NOW, REST, END, FIRST_BETWEEN = range(4)
"""Nodes of a path: its start, its end at rest, the end of the piece, and those between."""
N_NODES = 32
"""Poses looked at per path; a path that needs more is not admitted."""
WHEN, WHO, SLACK = range(3)
"""What set the override: time on the path [s], column of the people, distance lacking [m]."""


class Safety(NamedTuple):
    """What the rule assumes."""

    speed: Vec
    """Speed of each capsule and each cylinder in any direction, beyond what is known of how it
    goes on [m/s], shape (m + n,)."""
    lead: float
    """How much older than the robot's state the people are [s], reaction included."""
    margin: float
    """Distance D to keep [m]."""
    contact_speed: Vec
    """Speed at which each capsule and each cylinder may be touched [m/s], shape (m + n,)."""


class Watch(NamedTuple):
    """Work space, and what was decided; made once."""

    rot: Vec
    """R_world_link, shape (7, 3, 3)."""
    pos: Vec
    """Origins of the links [m], shape (7, 3)."""
    columns: Vec
    """The robot's capsules at each node, shape (N_NODES, 9, n)."""
    gap: Vec
    """Distances of people's capsules and cylinders to the robot there [m], (N_NODES, m + n)."""
    going: Vec
    """How cylinders are known to go on: vx, vy and growth [m/s], zeros where that is not known,
    shape (n, 3)."""
    going_speed: Vec
    """How fast any point of each part gets on so [m/s], shape (m + n,)."""
    x: Vec
    """When each node is [s], since the start of its segment, shape (N_NODES,)."""
    right: NDArray[np.int64]
    """Nodes that end the intervals still to be looked at, shape (N_NODES,)."""
    none: Vec
    """Zeros: the coefficients of a straight path, shape (6,)."""
    q_node: Vec
    """Joints at a node [rad], shape (6,)."""
    qd_node: Vec
    """Speeds there [rad/s], shape (6,)."""
    q_end: Vec
    """Joints at the end of the piece [rad], shape (6,)."""
    qd_end: Vec
    """Speeds there [rad/s], shape (6,)."""
    c: Vec
    """Decided: second coefficients of the path [rad/s^2], shape (6,)."""
    d: Vec
    """Decided: third coefficients of the path [rad/s^3], shape (6,)."""
    drop: Vec
    """Decided: what the rate loses per second [1/s], shape (1,)."""
    q: Vec
    """Decided: joints after the period [rad], shape (6,)."""
    qd: Vec
    """Decided: speeds after the period [rad/s], shape (6,)."""
    qdd: Vec
    """Decided: accelerations at its end [rad/s^2], shape (6,)."""
    why: Vec
    """What set the override (WHEN, WHO, SLACK); WHO is -1 where nobody did, shape (3,)."""


def new_ssm_workspace(arm: Arm, n_columns: int, n_cylinders: int) -> Watch:
    """Return work space for people of ``n_columns`` capsules and ``n_cylinders`` cylinders."""
    return Watch(
        np.empty((7, 3, 3)),
        np.empty((7, 3)),
        np.repeat(arm.columns[None], N_NODES, axis=0),
        np.empty((N_NODES, n_columns + n_cylinders)),
        np.zeros((n_cylinders, 3)),
        np.zeros(n_columns + n_cylinders),
        np.zeros(N_NODES),
        np.zeros(N_NODES, dtype=np.int64),
        np.zeros(6),
        np.zeros(6),
        np.zeros(6),
        np.zeros(6),
        np.zeros(6),
        np.zeros(6),
        np.zeros(6),
        np.zeros(1),
        np.zeros(6),
        np.zeros(6),
        np.zeros(6),
        np.zeros(3),
    )


@kernel(error_model="numpy")
def place_node(
    arm: Arm, columns: Vec, cylinders: Vec, q: Vec, node: int, since: float, watch: Watch
) -> None:
    """Place the robot at ``q`` and write its distances to every part of the people.

    Args:
        arm: Robot in its cell.
        columns: The people's capsules, shape (9, m).
        cylinders: Cylinders: x, y, radius, top [m], shape (n, 4).
        q: Joints [rad], shape (6,).
        node: Which node.
        since: How long ago people were there [s]: where cylinders are known to go on, all of
            their way since then counts.
        watch: Work space.
    """
    robot, gap = watch.columns[node], watch.gap[node]
    kinematics.link_poses(q, watch.rot, watch.pos)
    place_capsules(watch.rot, watch.pos, arm.link, arm.p0, arm.span, 0, robot)
    m = columns.shape[1]
    gaps(robot, columns, gap[:m])
    for k in range(cylinders.shape[0]):
        x, y, r, top = cylinders[k, 0], cylinders[k, 1], cylinders[k, 2], cylinders[k, 3]
        if watch.going_speed[m + k] * since > 0.0:
            sx, sy, growth = watch.going[k, 0], watch.going[k, 1], watch.going[k, 2]
            r += max(0.0, growth) * since
            gap[m + k] = swept_clearance(robot, x, y, sx * since, sy * since, r)
        else:
            gap[m + k], _ = cylinder_clearance(robot, 0, x, y, r, top)


@kernel(error_model="numpy", inline="always")
def reached(safety: Safety, since: float, t: float, node: int, watch: Watch) -> bool:
    """Whether a part that may not be touched in motion could be within reach at a node."""
    gap = watch.gap[node]
    for j in range(gap.shape[0]):
        reach = safety.speed[j] * since + safety.margin
        if safety.contact_speed[j] <= 0.0 and not gap[j] >= reach:
            watch.why[WHEN], watch.why[WHO], watch.why[SLACK] = t, j, reach - gap[j]
            return True
    return False


@kernel(error_model="numpy")
def path_bounds(arm: Arm, qd: Vec, c: Vec, d: Vec, s_end: float) -> tuple[float, float]:
    """Return bounds on the first and second derivative along a path of any point's place.

    Args:
        arm: Robot in its cell.
        qd: First coefficients [rad/s], shape (6,).
        c: Second coefficients [rad/s^2], shape (6,).
        d: Third coefficients [rad/s^3], shape (6,).
        s_end: Where the path ends [s].

    Returns:
        ``|dp/ds|`` [m/s] and ``|d2p/ds2|`` [m/s^2], for s in [0, s_end].
    """
    angular, swing, push = 0.0, 0.0, 0.0
    for j in range(6):
        bend = 3.0 * d[j] * s_end
        fastest = max(abs(qd[j]), abs(qd[j] + (2.0 * c[j] + bend) * s_end))
        if abs(c[j]) < abs(bend):
            fastest = max(fastest, abs(qd[j] - c[j] * c[j] / (3.0 * d[j])))
        angular += fastest
        swing += fastest * arm.lever[j]
        push += max(abs(2.0 * c[j]), abs(2.0 * (c[j] + bend))) * arm.lever[j]
    return swing, push + angular * swing


@kernel(error_model="numpy", inline="always")
def _interval_clear(
    safety: Safety, since: float, t: float, span: float, way: float, rate: float, first: float,
    second: float, a: int, b: int, watch: Watch,
) -> tuple[bool, float]:  # fmt: skip
    """Whether nobody can be met between two nodes too fast.

    Args:
        safety: What the rule assumes.
        since: How long ago people were seen by the end [s].
        t: When the interval ends, on the path [s].
        span: How long it is [s].
        way: Length of the interval along the path [s].
        rate: Rate at its start, the greatest in it.
        first: Bound on ``|dp/ds|`` [m/s].
        second: Bound on ``|d2p/ds2|`` [m/s^2].
        a: Node at the start.
        b: Node at the end.
        watch: Both nodes are placed.

    Returns:
        Whether it is clear, and the farthest any point of robot and people goes as known [m].
    """
    fastest = first
    if way > 0.0:
        chord = greatest_displacement(watch.columns[a], watch.columns[b])
        fastest = min(first, chord / way + 0.5 * way * second)
    w = fastest * way
    before, after = watch.gap[a], watch.gap[b]
    for j in range(before.shape[0]):
        both = w + watch.going_speed[j] * span
        least = 0.5 * (before[j] + after[j] - both)
        reach = safety.speed[j] * since + safety.margin
        if not (least > reach or rate * fastest <= safety.contact_speed[j]):
            watch.why[WHEN], watch.why[WHO], watch.why[SLACK] = t, j, reach - least
            return False, both + safety.speed[j] * span
    return True, w


@kernel(error_model="numpy")
def segment_clear(
    arm: Arm, safety: Safety, lead: float, columns: Vec, cylinders: Vec, q: Vec, qd: Vec,
    c: Vec, d: Vec, drop: float, t0: float, first: float, second: float, left: int, last: int,
    watch: Watch,
) -> bool:  # fmt: skip
    """Whether nobody can be met too fast on one segment of a path: the piece, or its stop.

    Args:
        arm: Robot in its cell.
        safety: What the rule assumes.
        lead: How much older than the robot's state the people are [s].
        columns: The people's capsules, shape (9, m).
        cylinders: Cylinders: x, y, radius, top [m], shape (n, 4).
        q: Joints at the start of the segment [rad], shape (6,).
        qd: Speeds there [rad/s], shape (6,).
        c: Second coefficients [rad/s^2], shape (6,).
        d: Third coefficients [rad/s^3], shape (6,).
        drop: What the rate loses per second [1/s].
        t0: When the segment starts, on the path [s].
        first: Bound on ``|dp/ds|`` [m/s].
        second: Bound on ``|d2p/ds2|`` [m/s^2].
        left: Node at its start.
        last: Node at its end.
        watch: Both are placed, and ``x`` is set for both.
    """
    top, fresh = 0, FIRST_BETWEEN
    watch.right[0] = last
    while top >= 0:
        b = watch.right[top]
        xa, xb = watch.x[left], watch.x[b]
        sa, rate = clock(drop, xa)
        sb, _ = clock(drop, xb)
        t = t0 + xb
        clear, w = _interval_clear(
            safety, lead + t, t, xb - xa, sb - sa, rate, first, second, left, b, watch
        )
        if clear:
            left = b
            top -= 1
            continue
        if w < RESOLUTION or fresh == N_NODES:
            return False
        x = 0.5 * (xa + xb)
        motion_at(q, qd, c, d, drop, x, watch.q_node, watch.qd_node)
        since = lead + t0 + x
        place_node(arm, columns, cylinders, watch.q_node, fresh, since, watch)
        if reached(safety, since, t0 + x, fresh, watch):
            return False
        watch.x[fresh] = x
        top += 1
        watch.right[top] = fresh
        fresh += 1
    return True
