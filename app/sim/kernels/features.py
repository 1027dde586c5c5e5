"""Features of the pick scenario: what the networks see of robot, person and target, compiled.

Normalised to a few units, relative to target and person, with a straight-line base motion,
nearest distances of four link groups, and clearances extrapolated at constant velocity. All
follow from the state that a caller can send (METHOD 3.3: q, qd of robot and person, target) and
the time left; no hidden history. ``LAYOUT`` names every slice.

Source: (5.8) for the raw state. Deviates: features are added to it, since raw state learned far
more slowly (1 % against 90 % after 2.7 k updates in trials beside the walking cylinder).
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from app.sim.kernels import body, kinematics
from app.sim.kernels.arm import CONTROLLED, Arm, Pose, new_pose, place
from app.sim.kernels.geometry import FAR, place_capsules, segment_nearest, set_clearance
from app.sim.ports import Vec

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


def _layout() -> dict[str, slice]:
    slices, start = {}, 0
    for name, size in SIZES:
        slices[name] = slice(start, start + size)
        start += size
    return slices


LAYOUT = _layout()
"""Slice of each group of features in the observation."""
N_FEATURES = sum(size for _, size in SIZES)
"""Length of the observation."""
BASE_START = LAYOUT["base"].start
"""Where the base motion starts, for the residual action."""

COARSE_LINK = np.array([2, 3, 4, 5, 6], dtype=np.int64)
COARSE_P0 = np.array(
    [[0.0, -0.045, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
)
COARSE_P1 = np.array(
    [
        [0.0, -0.045, 0.612],
        [0.0, 0.0, 0.57],
        [0.0, 0.115, 0.0],
        [0.0, 0.0, 0.116],
        [0.0, 0.17, 0.0],
    ]
)
COARSE_RADIUS = np.array([0.09, 0.075, 0.066, 0.066, 0.045])
COARSE_GROUP = np.array([0, 1, 2, 2, 3], dtype=np.int64)
N_COARSE = 5
FIRST_PART, LAST_PART = body.C_ABDOMEN, body.C_HAND_L
"""Human capsules the features look at: what stands above the table."""


@njit(cache=True)
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
        out[:CONTROLLED] = 0.0
        return widest
    pace = min(1.0, BASE_GAIN * widest / arm.qd_max[0]) / widest
    for j in range(CONTROLLED):
        out[j] = (q_goal[j] - q[j]) * pace
    return widest


@njit(cache=True)
def coarse_clearance(coarse: Vec, human: Vec, velocity: Vec, ahead: float) -> float:
    """Return the clearance of coarse robot capsules to the person moved ahead in time [m].

    Args:
        coarse: Ends of the coarse capsules [m], shape (5, 2, 3).
        human: Ends of the person's capsules [m], shape (12, 2, 3).
        velocity: Their velocities [m/s], shape (12, 2, 3).
        ahead: Time ahead [s].
    """
    moved = np.empty((body.N_CAPSULES, 2, 3))
    for h in range(FIRST_PART, LAST_PART + 1):
        for end in range(2):
            for i in range(3):
                moved[h, end, i] = human[h, end, i] + ahead * velocity[h, end, i]
    return set_clearance(
        coarse, COARSE_RADIUS, moved, body.RADII, FIRST_PART, LAST_PART, FARTHEST
    )[0]


@njit(cache=True)
def place_coarse(q: Vec, pose: Pose, coarse: Vec) -> None:
    """Fill ``coarse``, shape (5, 2, 3), with the coarse capsules at ``q``; overwrites pose."""
    kinematics.link_poses(q, pose.rot, pose.pos)
    place_capsules(pose.rot, pose.pos, COARSE_LINK, COARSE_P0, COARSE_P1, 0, coarse)


@njit(cache=True, inline="always")
def _scaled(d: float) -> float:
    return min(3.0, d / DISTANCE_SCALE)


@njit(cache=True)
def _put_joints(arm: Arm, q: Vec, qd: Vec, human_q: Vec, human_qd: Vec, out: Obs) -> int:
    for j in range(CONTROLLED):
        out[j] = q[j] / math.pi
        out[5 + j] = qd[j] / arm.qd_max[j]
        out[10 + j] = math.sin(q[j])
        out[15 + j] = math.cos(q[j])
    for j in range(18):
        out[20 + j] = human_q[j]
        out[38 + j] = 0.5 * human_qd[j]
    out[21] = human_q[1] - 1.25
    out[22] = (human_q[2] + 1.5 * math.pi) % (2.0 * math.pi) - math.pi
    return 56


@njit(cache=True)
def _put_tool(qd: Vec, goal: Vec, pose: Pose, tcp: Vec, out: Obs) -> int:
    jacobian = np.empty((3, 6))
    kinematics.tcp_jacobian(pose.rot, pose.pos, tcp, jacobian)
    for i in range(3):
        speed = 0.0
        for j in range(6):
            speed += jacobian[i, j] * qd[j]
        out[56 + i] = tcp[i]
        out[59 + i] = 2.0 * (goal[i] - tcp[i])
        out[62 + i] = 2.0 * speed
        out[65 + i] = pose.rot[6, i, 1]
    return 68


@njit(cache=True)
def _put_arms(pose: Pose, later: Pose, tick: float, tcp: Vec, goal: Vec, out: Obs) -> int:
    k = 68
    elbow = pose.pos[3]
    for point in (body.HAND_R, body.HAND_L, body.ELBOW_R, body.ELBOW_L):
        for i in range(3):
            out[k + i] = pose.points[point, i] - tcp[i]
            out[k + 3 + i] = pose.points[point, i] - goal[i]
            out[k + 6 + i] = pose.points[point, i] - elbow[i]
        k += 9
    for point in (body.HAND_R, body.HAND_L):
        for i in range(3):
            out[k + i] = (later.points[point, i] - pose.points[point, i]) / tick
        k += 3
    return k


@njit(cache=True)
def _put_nearest(coarse: Vec, human: Vec, k: int, out: Obs) -> float:
    """Write distance and direction of the nearest human part per link group."""
    gap, overall = np.empty(3), FAR
    best, direction = np.full(4, FAR), np.zeros((4, 3))
    for c in range(N_COARSE):
        group = COARSE_GROUP[c]
        for h in range(FIRST_PART, LAST_PART + 1):
            length = segment_nearest(coarse[c], human[h], gap)
            d = length - COARSE_RADIUS[c] - body.RADII[h]
            if d < best[group]:
                best[group] = d
                for i in range(3):
                    direction[group, i] = gap[i] / (length + 1e-9)
    for group in range(4):
        out[k + 4 * group] = _scaled(best[group])
        for i in range(3):
            out[k + 4 * group + 1 + i] = direction[group, i]
        overall = min(overall, best[group])
    return overall


@njit(cache=True)
def _tilt(pose: Pose) -> float:
    """Return the angle of the tool to the vertical [rad]."""
    return math.acos(min(1.0, max(-1.0, -pose.rot[6, 2, 1])))


@njit(cache=True)
def observe(
    arm: Arm,
    q: Vec,
    qd: Vec,
    human_q: Vec,
    human_qd: Vec,
    goal: Vec,
    q_goal: Vec,
    time_left: float,
    pose: Pose,
    later: Pose,
    coarse: Vec,
    out: Obs,
) -> None:
    """Write the observation of one state and one target.

    Args:
        arm: Robot in its cell.
        q: Joint positions [rad], shape (6,).
        qd: Joint speeds [rad/s], shape (6,).
        human_q: The person's joint positions [m, rad], shape (18,).
        human_qd: The person's joint speeds [m/s, rad/s], shape (18,).
        goal: Where the tcp shall be [m], shape (3,).
        q_goal: Vertical-tool posture at the goal [rad], shape (6,).
        time_left: Time left to reach it [s].
        pose: Work space.
        later: More work space.
        coarse: Work space, shape (5, 2, 3).
        out: Filled, shape (N_FEATURES,).
    """
    tick = 1e-3
    ahead_q = human_q + tick * human_qd
    body.points_and_frames(ahead_q, arm.pelvis_z, later.points, later.frames)
    body.capsules(later.points, later.frames, arm.floor_z, later.human)
    place(arm, q, human_q, pose)
    velocity = (later.human - pose.human) / tick
    tcp = np.empty(3)
    kinematics.tcp_point(pose.rot, pose.pos, arm.tool_length, tcp)
    _put_joints(arm, q, qd, human_q, human_qd, out)
    _put_tool(qd, goal, pose, tcp, out)
    k = _put_arms(pose, later, tick, tcp, goal, out)
    base = np.zeros(6)
    base_motion(arm, q, q_goal, base)
    for j in range(CONTROLLED):
        out[k + j] = q_goal[j] - q[j]
        out[k + 5 + j] = base[j]
    k += 10
    out[k] = 2.0 * math.sqrt(
        (goal[0] - tcp[0]) ** 2 + (goal[1] - tcp[1]) ** 2 + (goal[2] - tcp[2]) ** 2
    )
    out[k + 1] = _tilt(pose)
    out[k + 3] = time_left / TIME_SCALE
    place_capsules(pose.rot, pose.pos, COARSE_LINK, COARSE_P0, COARSE_P1, 0, coarse)
    out[k + 2] = _scaled(_put_nearest(coarse, pose.human, k + 4, out))
    k += 20
    _put_look_ahead(arm, q, q_goal, base, velocity, pose, later, coarse, k, out)


@njit(cache=True)
def _put_look_ahead(
    arm: Arm,
    q: Vec,
    q_goal: Vec,
    base: Vec,
    velocity: Vec,
    pose: Pose,
    later: Pose,
    coarse: Vec,
    k: int,
    out: Obs,
) -> None:
    for i in range(3):
        out[k + i] = _scaled(coarse_clearance(coarse, pose.human, velocity, HORIZONS[i]))
    moved = q.copy()
    for i in range(3):
        for j in range(CONTROLLED):
            way = base[j] * arm.qd_max[j] * HORIZONS[i]
            limit = abs(q_goal[j] - q[j])
            moved[j] = q[j] + min(limit, max(-limit, way))
        place_coarse(moved, later, coarse)
        out[k + 3 + i] = _scaled(coarse_clearance(coarse, pose.human, velocity, HORIZONS[i]))
    place_coarse(q_goal, later, coarse)
    out[k + 6] = _scaled(coarse_clearance(coarse, pose.human, velocity, 0.0))
    for i in range(3):
        out[k + 7 + i] = _scaled(coarse_clearance(coarse, pose.human, velocity, HORIZONS[i]))


@njit(cache=True)
def observe_batch(
    arm: Arm,
    q: Vec,
    qd: Vec,
    human_q: Vec,
    human_qd: Vec,
    goals: Vec,
    q_goals: Vec,
    time_left: Vec,
    out: Obs,
) -> None:
    """Apply :func:`observe` to n rows; every argument has a leading axis of n."""
    n_robot = arm.link.shape[0]
    pose, later, coarse = new_pose(n_robot), new_pose(n_robot), np.empty((N_COARSE, 2, 3))
    for i in range(q.shape[0]):
        observe(
            arm,
            q[i],
            qd[i],
            human_q[i],
            human_qd[i],
            goals[i],
            q_goals[i],
            time_left[i],
            pose,
            later,
            coarse,
            out[i],
        )
