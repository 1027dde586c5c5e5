"""Separation of a moving robot from people whose possible position grows with time, compiled.

With clearances ``a, b`` at both ends of an interval in which no point of the robot moves more
than ``w``, the clearance inside is at least ``(a + b - w)/2``. That must exceed ``v_h (T + t) +
D``, the distance people may have covered, at the end of the interval. Otherwise the interval is
halved, until both together move less than RESOLUTION, and then counts as not clear: the check
is conservative. ``w`` is the longest chord of the capsules' ends plus half a bound on the
path's curvature, or the sum of joint displacements times levers where that is less.

A cylinder with a known velocity counts along its whole path since its observation, so slightly
more of it counts at the end of an interval than at its start: that difference may be missing
between them and is added to ``w``.

Power and force limiting assigns each part of a person a speed at which it may be touched; it is
skipped in intervals in which no point of the robot is faster (docs/method.md 2.7).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.geometry.capsules import capsule_clearances, greatest_displacement
from app.sim.geometry.cylinder import cylinder_clearance, swept_clearance
from app.sim.robot.kernels import kinematics
from app.sim.robot.kernels.arm import Arm, place_capsules
from app.sim.robot.kernels.joints import JointPath, JointState
from app.sim.robot.kernels.override import motion_at, path_parameter

RESOLUTION = 0.01
"""Intervals in which robot and people approach by less than this are not halved [m]."""
NOW, REST, END, FIRST_BETWEEN = range(4)
"""Nodes of a path: its start, its end at rest, the end of the period, and those between."""
N_NODES = 32
"""Greatest number of robot poses on each of the two parts of a path; one that needs more is not
admitted."""
CAUSE_PART, CAUSE_SHORTFALL = range(2)
"""Cause of the override: part of the people, missing distance [m]."""


class SeparationRule(NamedTuple):
    """Assumptions of speed and separation monitoring."""

    speed: Vec
    """Assumed speed of each capsule and cylinder in any direction; for a part with a known
    velocity, the greatest change of that velocity [m/s], shape (m + n,)."""
    latency: float
    """Age of people relative to the robot's state, with the reaction time [s]."""
    margin: float
    """Distance D to keep [m]."""
    contact_speed: Vec
    """Speed at which each capsule and cylinder may be touched [m/s], shape (m + n,)."""


class PeopleShapes(NamedTuple):
    """Shapes of the people as observed."""

    capsules: Vec
    """Capsules, shape (9, m)."""
    cylinders: Vec
    """Vertical cylinders: x, y, radius, top [m], shape (n, 4)."""


class PathSegment(NamedTuple):
    """Segment of a path that is checked: the period's trajectory, or the stop after it."""

    path: JointPath
    """Path of all joints."""
    deceleration: float
    """Decrease of the path speed [1/s]."""
    start: float
    """Time at which the segment starts, since the start of the period [s]."""
    speed: float
    """Bound on ``|dp/ds|`` of any point of the robot [m/s]."""
    curvature: float
    """Bound on ``|d2p/ds2|`` of any point of the robot [m/s^2]."""
    first: int
    """Node at its start; placed, and its time is set."""
    last: int
    """Node at its end, likewise."""


class SsmWorkspace(NamedTuple):
    """Work space of speed and separation monitoring, and the last decision."""

    rot: Vec
    """R_world_link, shape (7, 3, 3)."""
    pos: Vec
    """Origins of the links [m], shape (7, 3)."""
    capsules: Vec
    """The robot's capsules at each node, shape (N_NODES, 9, n)."""
    clearance: Vec
    """Clearance of each part of the people to the robot there [m], shape (N_NODES, m + n)."""
    velocity: Vec
    """Known vx, vy and growth of cylinders [m/s], zeros where unknown, shape (n, 3)."""
    known_speed: Vec
    """Speed of any point of each part by that velocity [m/s], shape (m + n,)."""
    observed_speed: Vec
    """Observed speed of each part, 0 if unknown or part of its known velocity [m/s],
    shape (m + n,)."""
    x: Vec
    """Time of each node since the start of its segment [s], shape (N_NODES,)."""
    right: NDArray[np.int64]
    """Nodes at the ends of intervals still to be checked, shape (N_NODES,)."""
    none: Vec
    """Zeros: the coefficients of a straight path, shape (6,)."""
    q_node: Vec
    """Joint positions at a node [rad], shape (6,)."""
    qd_node: Vec
    """Joint speeds at a node [rad/s], shape (6,)."""
    q_end: Vec
    """Joint positions at the end of the period [rad], shape (6,)."""
    qd_end: Vec
    """Joint speeds at the end of the period [rad/s], shape (6,)."""
    c: Vec
    """Decision: second coefficients of the path [rad/s^2], shape (6,)."""
    d: Vec
    """Decision: third coefficients of the path [rad/s^3], shape (6,)."""
    deceleration: Vec
    """Decision: decrease of the path speed [1/s], shape (1,)."""
    end: JointState
    """Decision: state after the period."""
    cause: Vec
    """Cause of the override (CAUSE_PART, CAUSE_SHORTFALL); part -1 if none."""


def new_ssm_workspace(arm: Arm, n_capsules: int, n_cylinders: int) -> SsmWorkspace:
    """Return work space for people of ``n_capsules`` capsules and ``n_cylinders`` cylinders."""
    n_parts = n_capsules + n_cylinders
    return SsmWorkspace(
        rot=np.empty((7, 3, 3)),
        pos=np.empty((7, 3)),
        capsules=np.repeat(arm.capsules[None], N_NODES, axis=0),
        clearance=np.empty((N_NODES, n_parts)),
        velocity=np.zeros((n_cylinders, 3)),
        known_speed=np.zeros(n_parts),
        observed_speed=np.zeros(n_parts),
        x=np.zeros(N_NODES),
        right=np.zeros(N_NODES, dtype=np.int64),
        none=np.zeros(6),
        q_node=np.zeros(6),
        qd_node=np.zeros(6),
        q_end=np.zeros(6),
        qd_end=np.zeros(6),
        c=np.zeros(6),
        d=np.zeros(6),
        deceleration=np.zeros(1),
        end=JointState(np.zeros(6), np.zeros(6), np.zeros(6)),
        cause=np.zeros(2),
    )


@kernel(error_model="numpy")
def place_node(
    arm: Arm, people: PeopleShapes, q: Vec, node: int, age: float, space: SsmWorkspace
) -> None:
    """Place the robot at ``q`` and write its clearance to every part of the people.

    Args:
        people: People as observed.
        q: Joint positions [rad], shape (6,).
        node: Node to fill.
        age: Time since the observation [s]; a cylinder with a known velocity counts along its
            whole path since then.
    """
    robot, clearance = space.capsules[node], space.clearance[node]
    kinematics.link_poses(arm.lengths, q, space.rot, space.pos)
    place_capsules(space.rot, space.pos, arm.link, arm.p0, arm.span, 0, robot)
    m = people.capsules.shape[1]
    capsule_clearances(robot, people.capsules, clearance[:m])
    cylinders = people.cylinders
    for k in range(cylinders.shape[0]):
        x, y, r, top = cylinders[k, 0], cylinders[k, 1], cylinders[k, 2], cylinders[k, 3]
        if space.known_speed[m + k] * age > 0.0:
            vx, vy, growth = space.velocity[k, 0], space.velocity[k, 1], space.velocity[k, 2]
            r += max(0.0, growth) * age
            clearance[m + k] = swept_clearance(robot, x, y, vx * age, vy * age, r)
        else:
            clearance[m + k], _ = cylinder_clearance(robot, 0, x, y, r, top)


@kernel(error_model="numpy", inline="always")
def person_reach(rule: SeparationRule, j: int, age: float, space: SsmWorkspace) -> float:
    """Return the distance that part ``j`` of the people may have covered, plus D [m].

    A part observed faster than assumed counts at its observed speed.

    Args:
        rule: Assumptions.
        age: Time since people were observed [s].
        space: Work space with the observed speeds.
    """
    return float(max(rule.speed[j], space.observed_speed[j]) * age + rule.margin)


@kernel(error_model="numpy", inline="always")
def violates_separation(
    rule: SeparationRule, age: float, node: int, space: SsmWorkspace
) -> bool:
    """Return whether a part that may not be touched could be in contact at a node.

    Args:
        rule: Assumptions.
        age: Time since people were observed [s].
    """
    clearance = space.clearance[node]
    for j in range(clearance.shape[0]):
        reach = person_reach(rule, j, age, space)
        if rule.contact_speed[j] <= 0.0 and not clearance[j] >= reach:
            cause = space.cause
            cause[CAUSE_PART], cause[CAUSE_SHORTFALL] = j, reach - clearance[j]
            return True
    return False


@kernel(error_model="numpy", inline="always")
def _interval_clear(
    rule: SeparationRule,
    segment: PathSegment,
    latency: float,
    a: int,
    b: int,
    space: SsmWorkspace,
) -> tuple[bool, float]:
    """Return whether no part of the people reaches the robot between two nodes.

    Parts that may be touched at the robot's speed (power and force limiting) do not count.

    Args:
        rule: Assumptions.
        latency: Age of people at the start of the period [s].
        a: Node at the start; placed.
        b: Node at the end; placed.

    Returns:
        Whether it is clear, and a bound on the robot's displacement in it, with that of the
        part which is too near where it is not clear [m].
    """
    xa, xb = space.x[a], space.x[b]
    sa, path_speed = path_parameter(segment.deceleration, xa)
    sb, _ = path_parameter(segment.deceleration, xb)
    length = sb - sa
    span, age = xb - xa, latency + (segment.start + xb)
    fastest = segment.speed
    if length > 0.0:
        chord = greatest_displacement(space.capsules[a], space.capsules[b])
        fastest = min(segment.speed, chord / length + 0.5 * length * segment.curvature)
    w = fastest * length
    before, after = space.clearance[a], space.clearance[b]
    for j in range(before.shape[0]):
        both = w + space.known_speed[j] * span
        least = 0.5 * (before[j] + after[j] - both)
        reach = person_reach(rule, j, age, space)
        if not (least > reach or path_speed * fastest <= rule.contact_speed[j]):
            cause = space.cause
            cause[CAUSE_PART], cause[CAUSE_SHORTFALL] = j, reach - least
            return False, both + max(rule.speed[j], space.observed_speed[j]) * span
    return True, w


@kernel(error_model="numpy")
def segment_clear(
    arm: Arm,
    rule: SeparationRule,
    latency: float,
    people: PeopleShapes,
    segment: PathSegment,
    space: SsmWorkspace,
) -> bool:
    """Return whether no part of the people reaches the robot on one segment of a path.

    Parts that may be touched at the robot's speed (power and force limiting) do not count.

    Args:
        rule: Assumptions.
        latency: Age of people at the start of the period [s].
        people: People as observed.
        segment: Segment; its nodes are placed.
    """
    top, fresh, left = 0, FIRST_BETWEEN, segment.first
    space.right[0] = segment.last
    while top >= 0:
        b = space.right[top]
        clear, w = _interval_clear(rule, segment, latency, left, b, space)
        if clear:
            left = b
            top -= 1
            continue
        if w < RESOLUTION or fresh == N_NODES:
            return False
        x = 0.5 * (space.x[left] + space.x[b])
        motion_at(segment.path, segment.deceleration, x, space.q_node, space.qd_node)
        age = latency + segment.start + x
        place_node(arm, people, space.q_node, fresh, age, space)
        if violates_separation(rule, age, fresh, space):
            return False
        space.x[fresh] = x
        top += 1
        space.right[top] = fresh
        fresh += 1
    return True
