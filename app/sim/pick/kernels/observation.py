"""Observation of the pick scenario: state of robot, person and target as features (compiled).

The features are normalised and relative to target and person. They contain the joint move of
the base controller, the distances of four groups of links to the person, and clearances ahead:
in picks to people where the motion predictor expects them, otherwise at constant velocity. All
follow from the state (docs/method.md 3.3: q, qd of robot and person, target) and the time left;
there is no hidden history. ``LAYOUT`` gives the slice of each group. The person's body
dimensions affect positions and clearances; ``BODY_SIZES`` adds them explicitly (docs/method.md
4). Picks add the phase (``PHASE_SIZES``) and a second person (``PICK_SIZES``): the first is the
one nearest to the robot, the second, of the others, the one with a hand or the pelvis nearest
to the target.

Source: (5.8) for the raw state. Deviates: features are added, because the raw state learned far
more slowly (1 % against 90 % after 2.7 k updates in trials beside the pedestrian).
"""

import math
from typing import Any, NamedTuple

import numpy as np

from app.sim.core.arrays import Vec
from app.sim.core.jit import FAR, kernel
from app.sim.core.observation_layout import slices_of
from app.sim.geometry.capsules import nearest_parts, new_columns, padded_size
from app.sim.geometry.segments import segment_nearest
from app.sim.human.kernels import kinematics as body
from app.sim.prediction.kernels.worker import WorkerPredictor, predict_worker
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
from app.sim.scenario.kernels.person_observation import (
    BASE_GAIN,
    HORIZONS,
    TICK,
    Obs,
    PersonWorkspace,
    extrapolate_capsules,
    new_person_workspace,
    place_person,
    place_predicted,
)

TIME_SCALE = 10.0
"""Unit of the time left [s]."""
DISTANCE_SCALE = 0.5
"""Unit of distances [m]; they are clipped at three units."""
FARTHEST = 3.0 * DISTANCE_SCALE
"""Distance at which clearances are clipped [m]."""

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
"""Groups of the observation that includes the person's body dimensions."""
N_WITH_BODY = N_FEATURES + body.N_SIZE
"""Length of that observation."""
PHASE_SIZES = (*SIZES, ("phase", 3), ("closing", 1), ("near_clearance", 1))
"""Groups of the observation of a pick beside one person."""
N_WITH_PHASE = sum(size for _, size in PHASE_SIZES)
"""Length of that observation."""
PICK_SIZES = (
    *PHASE_SIZES,
    ("second_pelvis", 3),
    ("second_hands_and_elbows", 24),
    ("second_hand_velocities", 6),
    ("second_clearance", 1),
    ("second_look_ahead_still", 3),
    ("second_look_ahead_base", 3),
    ("second_goal_clearance", 4),
)
"""Groups of the observation of a pick beside several people."""
N_PICK = sum(size for _, size in PICK_SIZES)
"""Length of that observation."""
(PELVIS, SECOND_ARMS, SECOND_CLEARANCE) = (
    slices_of(PICK_SIZES)[name].start
    for name in ("second_pelvis", "second_hands_and_elbows", "second_clearance")
)
CLOSE_SCALE = 0.1
"""Unit of the clearance that decides on a grasp [m]; it is clipped at one unit."""
MAX_PEOPLE = 4
"""Most people in a cell."""
PRESENT_WITHIN = 4.0
"""Distance from the robot's base from which on nobody is observed as a second person [m]."""
BASE_START = LAYOUT["base"].start
"""Index of the base motion, for the residual action."""
(ARMS, MOTION, SCALARS, NEAREST, STILL_AHEAD, BASE_AHEAD, AT_GOAL_AHEAD) = (
    LAYOUT[name].start
    for name in (
        "hands_and_elbows",
        "goal_posture_minus_q",
        "distance_tilt_clearance_time",
        "nearest_by_group",
        "look_ahead_still",
        "look_ahead_base",
        "goal_clearance",
    )
)

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
"""First lane of three robot configurations that are evaluated together: now, along the base
motion, at the goal."""
N_LANES = padded_size(3 * N_COARSE)
FIRST_PART, LAST_PART = body.C_ABDOMEN, body.C_HAND_L
"""Human capsules used by the features: those above the table."""


class PickQuery(NamedTuple):
    """A state of robot, people and target; or n states, with a leading axis of n."""

    q: Vec
    """Joint positions [rad], shape (6,)."""
    qd: Vec
    """Joint speeds [rad/s], shape (6,)."""
    human_q: Vec
    """Joint positions of P people, the nearest first [m, rad], shape (P, 18)."""
    human_qd: Vec
    """Their joint speeds [m/s, rad/s], shape (P, 18)."""
    size: Vec
    """Their body dimensions [m], shape (P, body.N_SIZE)."""
    goal: Vec
    """Target of the tcp in this phase [m], shape (3,)."""
    q_goal: Vec
    """Vertical-tool configuration at the target [rad], shape (6,)."""
    q_grasp: Vec
    """The same at the object [rad], shape (6,); that at the target where nothing is grasped."""
    phase: Any
    """Phase of the pick (``grasp.py``), 0 where nothing is grasped."""
    closing: Any
    """Share of the closing time that has passed, 0 to 1."""


class PickObservationWorkspace(NamedTuple):
    """Work space of one observation."""

    person: PersonWorkspace
    """The first person, now and extrapolated."""
    second: PersonWorkspace
    """The second person, likewise."""
    far: PersonWorkspace
    """The person far away who is observed where there is no second one."""
    lanes: Vec
    """Coarse capsules of the robot in three configurations, shape (9, N_LANES)."""
    gap: Vec
    """Distance of each lane to the person [m], shape (N_LANES,)."""
    part: Vec
    """The person's capsule nearest to each lane, shape (N_LANES,)."""
    rot: Vec
    """R_world_link of another configuration, shape (7, 3, 3)."""
    pos: Vec
    """Origins of its links [m], shape (7, 3)."""
    q: Vec
    """Its joints [rad], shape (6,)."""
    base: Vec
    """The base motion, shape (6,)."""
    gap_vector: Vec
    """From robot to person [m], shape (3,)."""
    human_q: Vec
    """Joint positions of the people [m, rad], shape (MAX_PEOPLE, 18)."""
    human_qd: Vec
    """Their joint speeds [m/s, rad/s], shape (MAX_PEOPLE, 18)."""
    human_size: Vec
    """Their body dimensions [m], shape (MAX_PEOPLE, body.N_SIZE)."""
    point: Vec
    """Target of the tcp in the present phase [m], shape (3,)."""
    predictor: WorkerPredictor
    """Predicts the motion of the observed people in picks."""
    ahead: Vec
    """Their predicted joint positions [m, rad], shape (2, 3, 18)."""


def new_pick_observation_workspace(
    floor_z: float, far_q: Vec, far_size: Vec, predictor: WorkerPredictor
) -> PickObservationWorkspace:
    """Return work space for one observation at a time.

    Args:
        floor_z: Height of the floor [m].
        far_q: Joint positions of the person far away [m, rad], shape (18,).
        far_size: Body dimensions of that person [m], shape (body.N_SIZE,).
        predictor: Motion predictor; its work space becomes part of this one.
    """
    far = new_person_workspace()
    place_person(floor_z, far_q, np.zeros(18), far_size, far)
    return PickObservationWorkspace(
        person=new_person_workspace(),
        second=new_person_workspace(),
        far=far,
        lanes=new_columns(
            N_LANES, np.tile(COARSE_RADIUS, 3), np.tile((COARSE_SPAN**2).sum(axis=1), 3)
        ),
        gap=np.zeros(N_LANES),
        part=np.zeros(N_LANES),
        rot=np.zeros((7, 3, 3)),
        pos=np.zeros((7, 3)),
        q=np.zeros(6),
        base=np.zeros(6),
        gap_vector=np.zeros(3),
        human_q=np.zeros((MAX_PEOPLE, 18)),
        human_qd=np.zeros((MAX_PEOPLE, 18)),
        human_size=np.zeros((MAX_PEOPLE, body.N_SIZE)),
        point=np.zeros(3),
        predictor=predictor,
        ahead=np.zeros((2, len(HORIZONS), 18)),
    )


@kernel(inline="always")
def base_motion(arm: Arm, q: Vec, q_goal: Vec, out: Vec) -> float:
    """Write the straight joint move toward a configuration as normalised speeds in [-1, 1].

    All controlled joints arrive together; the speed falls with the remaining difference.

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


@kernel(inline="always")
def _place_lanes(arm: Arm, q: Vec, first: int, work: PickObservationWorkspace) -> None:
    """Place the robot's coarse capsules at ``q`` [rad], shape (6,), from lane ``first`` on."""
    kinematics.link_poses(arm.lengths, q, work.rot, work.pos)
    place_capsules(work.rot, work.pos, COARSE_LINK, COARSE_P0, COARSE_SPAN, first, work.lanes)


@kernel(inline="always")
def _lane_clearance(first: int, work: PickObservationWorkspace) -> float:
    """Return the clearance of one configuration's lanes, in units of the scale."""
    best = FARTHEST
    for k in range(first, first + N_COARSE):
        best = min(best, work.gap[k])
    return best / DISTANCE_SCALE


@kernel(inline="always")
def _scaled(d: float) -> float:
    return min(3.0, d / DISTANCE_SCALE)


@kernel(inline="always")
def _write_joints(arm: Arm, state: PickQuery, out: Obs) -> None:
    q, qd, human_q = state.q, state.qd, state.human_q[0]
    for j in range(CONTROLLED):
        out[j] = q[j] / math.pi
        out[5 + j] = qd[j] / arm.limits.qd_max[j]
        out[10 + j] = math.sin(q[j])
        out[15 + j] = math.cos(q[j])
    for j in range(18):
        out[20 + j] = human_q[j]
        out[38 + j] = 0.5 * state.human_qd[0, j]
    out[21] = human_q[1] - 1.25
    out[22] = (human_q[2] + 1.5 * math.pi) % (2.0 * math.pi) - math.pi


@kernel(inline="always")
def _write_tool(qd: Vec, goal: Vec, robot: RobotPose, out: Obs) -> None:
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


@kernel(inline="always")
def _write_human_arms(person: PersonWorkspace, robot: RobotPose, goal: Vec, out: Obs) -> None:
    k, now, later, pos, tcp = ARMS, person.points, person.points_later, robot.pos, robot.tcp
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


@kernel(inline="always")
def _write_nearest(work: PickObservationWorkspace, k: int, out: Obs) -> float:
    """Write distance and direction of the nearest human part per link group.

    Returns:
        The least distance [m].
    """
    overall, gap, vector = FAR, work.gap, work.gap_vector
    for group in range(4):
        lane = COARSE_FIRST[group]
        for c in range(COARSE_FIRST[group] + 1, COARSE_FIRST[group + 1]):
            if gap[c] < gap[lane]:
                lane = c
        part = int(work.part[lane])
        length = segment_nearest(work.lanes, lane, work.person.now, part, vector)
        out[k + 4 * group] = _scaled(gap[lane])
        for i in range(3):
            out[k + 4 * group + 1 + i] = vector[i] / (length + 1e-9)
        overall = min(overall, gap[lane])
    return overall


@kernel(inline="always")
def _write_phase(state: PickQuery, clearance: float, out: Obs) -> None:
    """Write the phase of the pick, the share of closing and the near clearance."""
    for phase in range(3):
        out[N_FEATURES + phase] = 1.0 if state.phase == phase else 0.0
    out[N_FEATURES + 3] = state.closing
    out[N_FEATURES + 4] = min(1.0, clearance / CLOSE_SCALE)


@kernel(inline="always")
def _place_second(floor_z: float, state: PickQuery, work: PickObservationWorkspace) -> int:
    """Place the second person; return the number of that person, 0 where there is none.

    Of the people after the first it is the one with a hand or the pelvis nearest to the target.
    """
    second, goal, person = 0, state.goal, work.second
    best, placed = PRESENT_WITHIN, 0
    for w in range(1, state.human_q.shape[0]):
        x, y = state.human_q[w, 0], state.human_q[w, 1]
        if math.hypot(x, y) >= PRESENT_WITHIN:
            continue
        place_person(floor_z, state.human_q[w], state.human_qd[w], state.size[w], person)
        placed = w
        distance = math.hypot(x - goal[0], y - goal[1])
        for point in (body.HAND_R, body.HAND_L):
            dx = person.points[point, 0] - goal[0]
            dy = person.points[point, 1] - goal[1]
            distance = min(distance, math.hypot(dx, dy))
        if second == 0 or distance < best:
            best, second = distance, w
    if second != placed:
        q, qd = state.human_q[second], state.human_qd[second]
        place_person(floor_z, q, qd, state.size[second], person)
    return second


@kernel(inline="always")
def _write_second(q: Vec, goal: Vec, tcp: Vec, person: PersonWorkspace, out: Obs) -> None:
    """Write position, arms and hand velocities of the second person."""
    k = SECOND_ARMS
    out[PELVIS], out[PELVIS + 1] = q[0], q[1] - 1.25
    out[PELVIS + 2] = (q[2] + 1.5 * math.pi) % (2.0 * math.pi) - math.pi
    for point in (body.HAND_R, body.HAND_L, body.ELBOW_R, body.ELBOW_L):
        for i in range(3):
            out[k + i] = person.points[point, i] - tcp[i]
            out[k + 3 + i] = person.points[point, i] - goal[i]
        k += 6
    for point in (body.HAND_R, body.HAND_L):
        for i in range(3):
            out[k + i] = (person.points_later[point, i] - person.points[point, i]) / TICK
        k += 3


@kernel(inline="always")
def _write_clearances(work: PickObservationWorkspace, place: int, i: int, out: Obs) -> None:
    """Write the clearances of the three configurations at horizon ``i`` from ``place`` on."""
    out[place + i] = _lane_clearance(STILL, work)
    out[place + 3 + i] = _lane_clearance(ALONG_BASE, work)
    out[place + 7 + i] = _lane_clearance(AT_GOAL, work)


@kernel(inline="always")
def _write_look_ahead(
    arm: Arm,
    floor_z: float,
    state: PickQuery,
    second: int,
    work: PickObservationWorkspace,
    out: Obs,
) -> None:
    """Write the clearances to the observed people at all horizons."""
    q, q_goal, base = state.q, state.q_goal, work.base
    person, other = work.person, work.second
    work.q[5] = q[5]
    predicts = out.shape[0] == N_WITH_PHASE or out.shape[0] == N_PICK
    if predicts:
        predict_worker(work.predictor, state.human_q[0], state.human_qd[0], work.ahead[0])
    if second > 0:
        human_q, human_qd = state.human_q[second], state.human_qd[second]
        predict_worker(work.predictor, human_q, human_qd, work.ahead[1])
    for i in range(3):
        for j in range(CONTROLLED):
            step = base[j] * arm.limits.qd_max[j] * HORIZONS[i]
            limit = abs(q_goal[j] - q[j])
            work.q[j] = q[j] + min(limit, max(-limit, step))
        _place_lanes(arm, work.q, ALONG_BASE, work)
        if predicts:
            place_predicted(floor_z, work.ahead[0, i], state.size[0], person)
        else:
            extrapolate_capsules(person.now, person.later, HORIZONS[i], person.moved)
        nearest_parts(work.lanes, person.moved, FIRST_PART, LAST_PART, work.gap, work.part)
        _write_clearances(work, STILL_AHEAD, i, out)
        if second > 0:
            place_predicted(floor_z, work.ahead[1, i], state.size[second], other)
            nearest_parts(work.lanes, other.moved, FIRST_PART, LAST_PART, work.gap, work.part)
            _write_clearances(work, SECOND_CLEARANCE + 1, i, out)


@kernel(inline="always")
def observe(
    arm: Arm,
    floor_z: float,
    state: PickQuery,
    time_left: float,
    robot: RobotPose,
    work: PickObservationWorkspace,
    out: Obs,
) -> None:
    """Write the observation of one state and one target.

    Args:
        arm: Robot in its cell.
        floor_z: Height of the floor [m].
        state: The state.
        time_left: Time left to reach the target [s].
        robot: The robot, placed at ``state.q``.
        work: Work space.
        out: Filled, shape (N_FEATURES,), (N_WITH_BODY,), (N_WITH_PHASE,) or (N_PICK,).
    """
    n_obs, second = out.shape[0], 0
    if n_obs == N_WITH_BODY:
        for i in range(body.N_SIZE):
            out[N_FEATURES + i] = state.size[0, i]
    q, goal, q_goal, person = state.q, state.goal, state.q_goal, work.person
    place_person(floor_z, state.human_q[0], state.human_qd[0], state.size[0], person)
    _write_joints(arm, state, out)
    _write_tool(state.qd, goal, robot, out)
    _write_human_arms(person, robot, goal, out)
    base, tcp = work.base, robot.tcp
    base_motion(arm, q, q_goal, base)
    for j in range(CONTROLLED):
        out[MOTION + j] = q_goal[j] - q[j]
        out[BASE_START + j] = base[j]
    out[SCALARS] = 2.0 * math.sqrt(
        (goal[0] - tcp[0]) ** 2 + (goal[1] - tcp[1]) ** 2 + (goal[2] - tcp[2]) ** 2
    )
    out[SCALARS + 1] = robot_tilt(robot)
    out[SCALARS + 3] = time_left / TIME_SCALE
    place_capsules(robot.rot, robot.pos, COARSE_LINK, COARSE_P0, COARSE_SPAN, STILL, work.lanes)
    _place_lanes(arm, state.q_grasp, AT_GOAL, work)
    nearest_parts(work.lanes, person.now, FIRST_PART, LAST_PART, work.gap, work.part)
    clearance = _write_nearest(work, NEAREST, out)
    out[SCALARS + 2] = _scaled(clearance)
    out[AT_GOAL_AHEAD] = _lane_clearance(AT_GOAL, work)
    if n_obs == N_WITH_PHASE or n_obs == N_PICK:
        _write_phase(state, clearance, out)
    if n_obs == N_PICK:
        second = _place_second(floor_z, state, work)
        if second > 0:
            _write_second(state.human_q[second], goal, tcp, work.second, out)
        else:
            _write_second(work.far.q, goal, tcp, work.far, out)
        for k in range(SECOND_CLEARANCE, N_PICK):
            out[k] = FARTHEST / DISTANCE_SCALE
    if second > 0:
        now = work.second.now
        nearest_parts(work.lanes, now, FIRST_PART, LAST_PART, work.gap, work.part)
        out[SECOND_CLEARANCE] = _lane_clearance(STILL, work)
        out[SECOND_CLEARANCE + 7] = _lane_clearance(AT_GOAL, work)
    _write_look_ahead(arm, floor_z, state, second, work, out)


@kernel(inline="always")
def query_at(states: PickQuery, i: int) -> PickQuery:
    """Return state ``i`` of n states."""
    return PickQuery(
        states.q[i],
        states.qd[i],
        states.human_q[i],
        states.human_qd[i],
        states.size[i],
        states.goal[i],
        states.q_goal[i],
        states.q_grasp[i],
        states.phase[i],
        states.closing[i],
    )


@kernel()
def observe_states(
    arm: Arm,
    floor_z: float,
    states: PickQuery,
    time_left: Vec,
    robot: RobotPose,
    work: PickObservationWorkspace,
    out: Obs,
) -> None:
    """Apply :func:`observe` to n states; ``robot`` and ``work`` are work space."""
    for i in range(states.q.shape[0]):
        place_robot(arm, states.q[i], robot)
        observe(arm, floor_z, query_at(states, i), time_left[i], robot, work, out[i])


def observe_batch(
    arm: Arm,
    floor_z: float,
    states: PickQuery,
    time_left: Vec,
    work: PickObservationWorkspace,
    out: Obs,
) -> None:
    """Apply :func:`observe` to n states.

    Args:
        arm: Robot in its cell.
        floor_z: Height of the floor [m].
        states: The states, arrays of shape (n, ...).
        time_left: Time left in each [s], shape (n,).
        work: Work space.
        out: Filled, shape (n, length of an observation).
    """
    observe_states(arm, floor_z, states, time_left, new_robot_pose(arm), work, out)
