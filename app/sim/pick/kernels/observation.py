"""Features of the pick scenario: what the networks see of robot, person and target, compiled.

Normalised to a few units, relative to target and person, with a straight-line base motion,
nearest distances of four link groups, and clearances extrapolated at constant velocity. All
follow from the state that a caller can send (METHOD 3.3: q, qd of robot and person, target) and
the time left; no hidden history. ``LAYOUT`` names every slice. The person's size is in them
through where hands, elbows and capsules are; with BODY_SIZES it is told outright (METHOD 4).

Source: (5.8) for the raw state. Deviates: features are added to it, since raw state learned far
more slowly (1 % against 90 % after 2.7 k updates in trials beside the walking cylinder).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.core.observation_layout import slices_of
from app.sim.geometry.capsules import (
    INVERSE,
    RADIUS,
    UU,
    UX,
    UY,
    UZ,
    X,
    nearest_parts,
    new_columns,
    padded_size,
)
from app.sim.geometry.segments import FAR, FAST, segment_nearest
from app.sim.human.kernels import kinematics as body
from app.sim.robot.kernels import kinematics
from app.sim.robot.kernels.arm import (
    CONTROLLED,
    Arm,
    RobotPose,
    new_robot_pose,
    place_capsules,
    place_robot,
    robot_tilt,
)

Obs = NDArray[np.float32]

HORIZONS = (0.25, 0.5, 1.0)
"""Times ahead at which clearances are extrapolated [s]."""
BASE_GAIN = 3.0
"""Speed of the straight joint move per radian left [1/s]; it brakes within limits."""
TIME_SCALE = 10.0
"""Time left is given in units of this [s]."""
DISTANCE_SCALE = 0.5
"""Distances are given in units of this and cut at three units [m]."""
FARTHEST = 3.0 * DISTANCE_SCALE
"""Clearances are looked at up to here [m]."""

SIZES = (
    ("q", 5),
    ("qd", 5),
    ("sin_q", 5),
    ("cos_q", 5),
    ("human_q", 18),
    ("human_qd", 18),
    ("tcp", 3),
    ("goal_minus_tcp", 3),
    ("tcp_velocity", 3),
    ("tool_axis", 3),
    ("hands_and_elbows", 36),
    ("hand_velocities", 6),
    ("goal_posture_minus_q", 5),
    ("base", 5),
    ("distance_tilt_clearance_time", 4),
    ("nearest_by_group", 16),
    ("look_ahead_still", 3),
    ("look_ahead_base", 3),
    ("goal_clearance", 4),
)

LAYOUT = slices_of(SIZES)
"""Slice of each group of features in the observation."""
N_FEATURES = sum(size for _, size in SIZES)
"""Length of the observation."""
BODY_SIZES = (*SIZES, ("body", body.N_SIZE))
"""The same with the person's size, for a policy that sees it."""
N_WITH_BODY = N_FEATURES + body.N_SIZE
"""Length of that observation."""
BASE_START = LAYOUT["base"].start
"""Where the base motion starts, for the residual action."""

COARSE_LINK = np.array([2, 3, 4, 5, 6], dtype=np.int64)
COARSE_P0 = np.array(
    [[0.0, -0.045, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
)
COARSE_SPAN = np.array(
    [
        [0.0, 0.0, 0.612],
        [0.0, 0.0, 0.57],
        [0.0, 0.115, 0.0],
        [0.0, 0.0, 0.116],
        [0.0, 0.17, 0.0],
    ]
)
COARSE_RADIUS = np.array([0.09, 0.075, 0.066, 0.066, 0.045])
COARSE_FIRST = (0, 1, 2, 4, 5)
"""First coarse capsule of each of the four link groups, and their number."""
N_COARSE = 5
STILL, ALONG_BASE, AT_GOAL = 0, N_COARSE, 2 * N_COARSE
"""First lane of three postures looked at together: now, along the base motion, at the goal."""
N_LANES = padded_size(3 * N_COARSE)
FIRST_PART, LAST_PART = body.C_ABDOMEN, body.C_HAND_L
"""Human capsules the features look at: what stands above the table."""
TICK = 1e-3
"""Time by which the person is moved on to find how fast the capsules move [s]."""


@kernel(inline="always")
def base_motion(arm: Arm, q: Vec, q_goal: Vec, out: Vec) -> float:
    """Write the straight joint move toward a posture as normalised speeds in [-1, 1].

    All controlled joints arrive together; the speed falls with the way left.

    Returns:
        The greatest joint difference [rad].
    """
    widest = 0.0
    for j in range(CONTROLLED):
        widest = max(widest, abs(q_goal[j] - q[j]))
    if widest < 1e-9:
        for j in range(CONTROLLED):
            out[j] = 0.0
        return widest
    pace = min(1.0, BASE_GAIN * widest / arm.limits.qd_max[0]) / widest
    for j in range(CONTROLLED):
        out[j] = (q_goal[j] - q[j]) * pace
    return widest


class Sight(NamedTuple):
    """Work space of one observation; made once, filled again and again."""

    trig: Vec
    """Sines, cosines and more, shape (3, 16)."""
    points: Vec
    """The person's points now [m], shape (N_POINTS, 3)."""
    points_later: Vec
    """The same one ``TICK`` later [m], shape (N_POINTS, 3)."""
    frames: Vec
    """The person's orientations, shape (N_FRAMES, 3, 3)."""
    now: Vec
    """The person's capsules now, shape (9, 16)."""
    later: Vec
    """The same one ``TICK`` later, shape (9, 16)."""
    moved: Vec
    """The same at a time ahead, at constant velocity, shape (9, 16)."""
    lanes: Vec
    """Coarse capsules of the robot in three postures, shape (9, N_LANES)."""
    gap: Vec
    """Distance of each of them to the person [m], shape (N_LANES,)."""
    part: Vec
    """The person's capsule nearest to each, shape (N_LANES,)."""
    rot: Vec
    """R_world_link of a posture looked at, shape (7, 3, 3)."""
    pos: Vec
    """Origins of its links [m], shape (7, 3)."""
    q: Vec
    """Joints of a posture looked at [rad], shape (6,)."""
    base: Vec
    """The base motion, shape (6,)."""
    human_q: Vec
    """The person's joints a tick later [m, rad], shape (18,)."""
    gap_vector: Vec
    """From robot to person [m], shape (3,)."""


def new_sight() -> Sight:
    """Return work space, nothing seen yet."""
    person = body.capsule_columns(1)
    lanes = new_columns(
        N_LANES, np.tile(COARSE_RADIUS, 3), np.tile((COARSE_SPAN**2).sum(axis=1), 3)
    )
    return Sight(
        trig=np.zeros((3, 16)),
        points=np.zeros((body.N_POINTS, 3)),
        points_later=np.zeros((body.N_POINTS, 3)),
        frames=np.zeros((body.N_FRAMES, 3, 3)),
        now=person.copy(),
        later=person.copy(),
        moved=person.copy(),
        lanes=lanes,
        gap=np.zeros(N_LANES),
        part=np.zeros(N_LANES),
        rot=np.zeros((7, 3, 3)),
        pos=np.zeros((7, 3)),
        q=np.zeros(6),
        base=np.zeros(6),
        human_q=np.zeros(18),
        gap_vector=np.zeros(3),
    )


@kernel(inline="always")
def see_person(floor_z: float, human_q: Vec, human_qd: Vec, size: Vec, sight: Sight) -> None:
    """Fill the person's part of ``sight``: points and capsules, now and a tick later."""
    for j in range(18):
        sight.human_q[j] = human_q[j] + TICK * human_qd[j]
    body.points_and_frames(sight.human_q, size, sight.trig, sight.points_later, sight.frames)
    body.capsules(sight.points_later, sight.frames, size, floor_z, 0, sight.later)
    body.points_and_frames(human_q, size, sight.trig, sight.points, sight.frames)
    body.capsules(sight.points, sight.frames, size, floor_z, 0, sight.now)


@kernel(error_model="numpy", fastmath=FAST)
def look_ahead(now: Vec, later: Vec, ahead: float, moved: Vec) -> None:
    """Move capsules on at constant velocity.

    Args:
        now: Capsules as columns, shape (9, n).
        later: The same one ``TICK`` later, shape (9, n).
        ahead: Time ahead [s].
        moved: Filled, shape (9, n).
    """
    part = ahead / TICK
    for row in range(X, UU):
        for k in range(now.shape[1]):
            moved[row, k] = now[row, k] + part * (later[row, k] - now[row, k])
    for k in range(now.shape[1]):
        ux, uy, uz = moved[UX, k], moved[UY, k], moved[UZ, k]
        square = ux * ux + uy * uy + uz * uz
        moved[UU, k], moved[RADIUS, k] = square, now[RADIUS, k]
        moved[INVERSE, k] = 1.0 / (square if square > 1e-12 else 1e30)


@kernel(inline="always")
def _place_lanes(arm: Arm, q: Vec, first: int, sight: Sight) -> None:
    """Place the robot's coarse capsules at ``q`` [rad], shape (6,), from lane ``first`` on."""
    kinematics.link_poses(arm.lengths, q, sight.rot, sight.pos)
    place_capsules(
        sight.rot, sight.pos, COARSE_LINK, COARSE_P0, COARSE_SPAN, first, sight.lanes
    )


@kernel(inline="always")
def _lane_clearance(first: int, sight: Sight) -> float:
    """Return the clearance of one posture's lanes, in units of the scale."""
    best = FARTHEST
    for k in range(first, first + N_COARSE):
        best = min(best, sight.gap[k])
    return best / DISTANCE_SCALE


@kernel(inline="always")
def _scaled(d: float) -> float:
    return min(3.0, d / DISTANCE_SCALE)


@kernel(inline="always")
def _put_joints(arm: Arm, q: Vec, qd: Vec, human_q: Vec, human_qd: Vec, out: Obs) -> int:
    for j in range(CONTROLLED):
        out[j] = q[j] / math.pi
        out[5 + j] = qd[j] / arm.limits.qd_max[j]
        out[10 + j] = math.sin(q[j])
        out[15 + j] = math.cos(q[j])
    for j in range(18):
        out[20 + j] = human_q[j]
        out[38 + j] = 0.5 * human_qd[j]
    out[21] = human_q[1] - 1.25
    out[22] = (human_q[2] + 1.5 * math.pi) % (2.0 * math.pi) - math.pi
    return 56


@kernel(inline="always")
def _put_tool(qd: Vec, goal: Vec, robot: RobotPose, out: Obs) -> int:
    jacobian, tcp = robot.jacobian, robot.tcp
    kinematics.tcp_jacobian(robot.rot, robot.pos, tcp, jacobian)
    for i in range(3):
        speed = 0.0
        for j in range(6):
            speed += jacobian[i, j] * qd[j]
        out[56 + i] = tcp[i]
        out[59 + i] = 2.0 * (goal[i] - tcp[i])
        out[62 + i] = 2.0 * speed
        out[65 + i] = robot.rot[6, i, 1]
    return 68


@kernel(inline="always")
def _put_arms(sight: Sight, robot: RobotPose, goal: Vec, out: Obs) -> int:
    k, now, later, pos, tcp = 68, sight.points, sight.points_later, robot.pos, robot.tcp
    for point in (body.HAND_R, body.HAND_L, body.ELBOW_R, body.ELBOW_L):
        for i in range(3):
            out[k + i] = now[point, i] - tcp[i]
            out[k + 3 + i] = now[point, i] - goal[i]
            out[k + 6 + i] = now[point, i] - pos[3, i]
        k += 9
    for point in (body.HAND_R, body.HAND_L):
        for i in range(3):
            out[k + i] = (later[point, i] - now[point, i]) / TICK
        k += 3
    return k


@kernel(inline="always")
def _put_nearest(sight: Sight, k: int, out: Obs) -> float:
    """Write distance and direction of the nearest human part per link group.

    Returns:
        The least distance [m].
    """
    overall, gap, vector = FAR, sight.gap, sight.gap_vector
    for group in range(4):
        lane = COARSE_FIRST[group]
        for c in range(COARSE_FIRST[group] + 1, COARSE_FIRST[group + 1]):
            if gap[c] < gap[lane]:
                lane = c
        length = segment_nearest(sight.lanes, lane, sight.now, int(sight.part[lane]), vector)
        out[k + 4 * group] = _scaled(gap[lane])
        for i in range(3):
            out[k + 4 * group + 1 + i] = vector[i] / (length + 1e-9)
        overall = min(overall, gap[lane])
    return overall


@kernel(inline="always")
def observe(
    arm: Arm,
    floor_z: float,
    q: Vec,
    qd: Vec,
    human_q: Vec,
    human_qd: Vec,
    size: Vec,
    goal: Vec,
    q_goal: Vec,
    time_left: float,
    robot: RobotPose,
    sight: Sight,
    out: Obs,
) -> None:
    """Write the observation of one state, one person and one target.

    Args:
        arm: Robot in its cell.
        floor_z: Height of the floor [m].
        q: Joint positions [rad], shape (6,).
        qd: Joint speeds [rad/s], shape (6,).
        human_q: The person's joint positions [m, rad], shape (18,).
        human_qd: The person's joint speeds [m/s, rad/s], shape (18,).
        size: The person's size [m], shape (body.N_SIZE,).
        goal: Where the tcp shall be [m], shape (3,).
        q_goal: Vertical-tool posture at the goal [rad], shape (6,).
        time_left: Time left to reach it [s].
        robot: The robot, placed at ``q``.
        sight: Work space.
        out: Filled, shape (N_FEATURES,) or (N_WITH_BODY,).
    """
    if out.shape[0] > N_FEATURES:
        for i in range(body.N_SIZE):
            out[N_FEATURES + i] = size[i]
    see_person(floor_z, human_q, human_qd, size, sight)
    _put_joints(arm, q, qd, human_q, human_qd, out)
    _put_tool(qd, goal, robot, out)
    k = _put_arms(sight, robot, goal, out)
    base, tcp = sight.base, robot.tcp
    base_motion(arm, q, q_goal, base)
    for j in range(CONTROLLED):
        out[k + j] = q_goal[j] - q[j]
        out[k + 5 + j] = base[j]
    k += 10
    out[k] = 2.0 * math.sqrt(
        (goal[0] - tcp[0]) ** 2 + (goal[1] - tcp[1]) ** 2 + (goal[2] - tcp[2]) ** 2
    )
    out[k + 1] = robot_tilt(robot)
    out[k + 3] = time_left / TIME_SCALE
    place_capsules(
        robot.rot, robot.pos, COARSE_LINK, COARSE_P0, COARSE_SPAN, STILL, sight.lanes
    )
    _place_lanes(arm, q_goal, AT_GOAL, sight)
    nearest_parts(sight.lanes, sight.now, FIRST_PART, LAST_PART, sight.gap, sight.part)
    out[k + 2] = _scaled(_put_nearest(sight, k + 4, out))
    k += 20
    out[k + 6] = _lane_clearance(AT_GOAL, sight)
    sight.q[5] = q[5]
    for i in range(3):
        for j in range(CONTROLLED):
            way = base[j] * arm.limits.qd_max[j] * HORIZONS[i]
            limit = abs(q_goal[j] - q[j])
            sight.q[j] = q[j] + min(limit, max(-limit, way))
        _place_lanes(arm, sight.q, ALONG_BASE, sight)
        look_ahead(sight.now, sight.later, HORIZONS[i], sight.moved)
        nearest_parts(sight.lanes, sight.moved, FIRST_PART, LAST_PART, sight.gap, sight.part)
        out[k + i] = _lane_clearance(STILL, sight)
        out[k + 3 + i] = _lane_clearance(ALONG_BASE, sight)
        out[k + 7 + i] = _lane_clearance(AT_GOAL, sight)


@kernel()
def observe_rows(
    arm: Arm,
    floor_z: float,
    q: Vec,
    qd: Vec,
    human_q: Vec,
    human_qd: Vec,
    sizes: Vec,
    goals: Vec,
    q_goals: Vec,
    time_left: Vec,
    robot: RobotPose,
    sight: Sight,
    out: Obs,
) -> None:
    """Apply :func:`observe` to n rows; ``robot`` and ``sight`` are work space."""
    for i in range(q.shape[0]):
        place_robot(arm, q[i], robot)
        observe(
            arm,
            floor_z,
            q[i],
            qd[i],
            human_q[i],
            human_qd[i],
            sizes[i],
            goals[i],
            q_goals[i],
            time_left[i],
            robot,
            sight,
            out[i],
        )


def observe_batch(
    arm: Arm,
    floor_z: float,
    q: Vec,
    qd: Vec,
    human_q: Vec,
    human_qd: Vec,
    sizes: Vec,
    goals: Vec,
    q_goals: Vec,
    time_left: Vec,
    out: Obs,
) -> None:
    """Apply :func:`observe` to n rows; all arguments but two have a leading axis of n."""
    robot, sight = new_robot_pose(arm), new_sight()
    observe_rows(
        arm, floor_z, q, qd, human_q, human_qd, sizes, goals, q_goals, time_left, robot, sight,
        out,
    )  # fmt: skip
