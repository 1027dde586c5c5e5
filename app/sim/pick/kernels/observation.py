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

from app.sim.core.arrays import Vec
from app.sim.core.jit import FAR, kernel
from app.sim.core.observation_layout import OBS_BOUND
from app.sim.geometry.capsules import nearest_parts
from app.sim.geometry.segments import segment_nearest
from app.sim.human.kernels import kinematics as body
from app.sim.pick.kernels.base_motion import base_motion
from app.sim.pick.kernels.observation_layout import (
    ARMS,
    AT_GOAL_AHEAD,
    BASE_START,
    CLOSE_SCALE,
    CLOSING,
    COS_Q,
    DISTANCE_SCALE,
    FARTHEST,
    HUMAN_Q,
    HUMAN_QD,
    MOTION,
    N_FEATURES,
    N_PICK,
    N_WITH_BODY,
    N_WITH_PHASE,
    NEAR_CLEARANCE,
    NEAREST,
    PELVIS_Y,
    PHASE,
    QD,
    SCALARS,
    SECOND_CLEARANCE,
    SIN_Q,
    STILL_AHEAD,
    TCP,
    TCP_VELOCITY,
    TIME_SCALE,
    TO_GOAL,
    TOOL_AXIS,
    Q,
)
from app.sim.pick.kernels.observation_workspace import (
    ALONG_BASE,
    AT_GOAL,
    COARSE_FIRST,
    COARSE_LINK,
    COARSE_P0,
    FIRST_PART,
    GOAL_LANES,
    LAST_PART,
    N_COARSE,
    N_LANES,
    STILL,
    PickObservationWorkspace,
    PickQuery,
    predict_person,
    query_at,
)
from app.sim.pick.kernels.second_person import place_second, write_second
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
    HORIZONS,
    TICK,
    Obs,
    PersonWorkspace,
    extrapolate_capsules,
    place_person,
)


@kernel(inline="always")
def _place_lanes(arm: Arm, q: Vec, first: int, work: PickObservationWorkspace) -> None:
    """Place the robot's coarse capsules at ``q`` [rad], shape (6,), from lane ``first`` on."""
    kinematics.link_poses(arm.lengths, q, work.rot, work.pos)
    place_capsules(work.rot, work.pos, COARSE_LINK, COARSE_P0, work.span, first, work.lanes)


@kernel(inline="always")
def _measure_lanes(work: PickObservationWorkspace, lanes: int, person: Vec) -> None:
    """Write the clearance of a person to each of the first lanes into ``work.clearance``.

    Args:
        lanes: Number of lanes.
        person: Capsules of the person, shape (9, 16).
    """
    nearest_parts(work.lanes, lanes, person, FIRST_PART, LAST_PART, work.clearance, None)


@kernel(inline="always")
def _lane_clearance(first: int, work: PickObservationWorkspace) -> float:
    """Return the clearance of one configuration's lanes, in units of the scale."""
    best = FARTHEST
    for k in range(first, first + N_COARSE):
        best = min(best, work.clearance[k])
    return best / DISTANCE_SCALE


@kernel(inline="always")
def _scaled(d: float) -> float:
    return min(3.0, d / DISTANCE_SCALE)


@kernel(inline="always")
def _write_joints(arm: Arm, state: PickQuery, out: Obs) -> None:
    q, qd, human_q = state.q, state.qd, state.human_q[0]
    for j in range(CONTROLLED):
        out[Q + j] = q[j] / math.pi
        out[QD + j] = qd[j] / arm.limits.qd_max[j]
        out[SIN_Q + j] = math.sin(q[j])
        out[COS_Q + j] = math.cos(q[j])
    for j in range(18):
        out[HUMAN_Q + j] = human_q[j]
        out[HUMAN_QD + j] = 0.5 * state.human_qd[0, j]
    out[HUMAN_Q + 1] = human_q[1] - PELVIS_Y
    out[HUMAN_Q + 2] = (human_q[2] + 1.5 * math.pi) % (2.0 * math.pi) - math.pi
    if out.shape[0] == N_WITH_BODY:
        for i in range(body.N_SIZE):
            out[N_FEATURES + i] = state.size[0, i]


@kernel(inline="always")
def _write_tool(qd: Vec, robot: RobotPose, out: Obs) -> None:
    jacobian, tcp = robot.jacobian, robot.tcp
    kinematics.tcp_jacobian(robot.rot, robot.pos, tcp, jacobian)
    for i in range(3):
        speed = 0.0
        for j in range(6):
            speed += jacobian[i, j] * qd[j]
        out[TCP + i] = tcp[i]
        out[TCP_VELOCITY + i] = 2.0 * speed
        out[TOOL_AXIS + i] = robot.rot[6, i, 1]
    out[SCALARS + 1] = robot_tilt(robot)


@kernel(inline="always")
def _write_human_arms(person: PersonWorkspace, robot: RobotPose, out: Obs) -> None:
    k, now, later, pos, tcp = ARMS, person.points, person.points_later, robot.pos, robot.tcp
    for point in (body.HAND_R, body.HAND_L, body.ELBOW_R, body.ELBOW_L):
        for i in range(3):
            out[k + i] = now[point, i] - tcp[i]
            out[k + 6 + i] = now[point, i] - pos[3, i]
        k += 9
    for point in (body.HAND_R, body.HAND_L):
        for i in range(3):
            out[k + i] = (later[point, i] - now[point, i]) / TICK
        k += 3


@kernel(inline="always")
def _write_target(goal: Vec, person: PersonWorkspace, tcp: Vec, out: Obs) -> None:
    """Write the target relative to tool, hands and elbows."""
    square, k = 0.0, ARMS + 3
    for i in range(3):
        out[TO_GOAL + i] = 2.0 * (goal[i] - tcp[i])
        square += (goal[i] - tcp[i]) ** 2
    out[SCALARS] = 2.0 * math.sqrt(square)
    for point in (body.HAND_R, body.HAND_L, body.ELBOW_R, body.ELBOW_L):
        for i in range(3):
            out[k + i] = person.points[point, i] - goal[i]
        k += 9


@kernel(inline="always")
def _write_nearest(work: PickObservationWorkspace, out: Obs) -> None:
    """Write distance and direction of the nearest human part per link group."""
    overall, clearance, vector, k = FAR, work.clearance, work.to_person, NEAREST
    for group in range(4):
        lane = STILL + COARSE_FIRST[group]
        for c in range(lane + 1, STILL + COARSE_FIRST[group + 1]):
            if clearance[c] < clearance[lane]:
                lane = c
        part = int(work.part[lane])
        length = segment_nearest(work.lanes, lane, work.person.now, part, vector)
        out[k + 4 * group] = _scaled(clearance[lane])
        for i in range(3):
            out[k + 4 * group + 1 + i] = vector[i] / (length + 1e-9)
        overall = min(overall, clearance[lane])
    out[SCALARS + 2] = _scaled(overall)
    if out.shape[0] == N_WITH_PHASE or out.shape[0] == N_PICK:
        out[NEAR_CLEARANCE] = min(1.0, overall / CLOSE_SCALE)


@kernel(inline="always")
def _write_phase(state: PickQuery, out: Obs) -> None:
    """Write the phase of the pick and the share of closing."""
    for phase in range(3):
        out[PHASE + phase] = 1.0 if state.phase == phase else 0.0
    out[CLOSING] = state.closing


@kernel(inline="always")
def _write_clearances(work: PickObservationWorkspace, place: int, i: int, out: Obs) -> None:
    """Write the clearances ahead at horizon ``i``, whose group starts at ``place``."""
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
    person = work.person
    work.q[5] = q[5]
    predicts = out.shape[0] == N_WITH_PHASE or out.shape[0] == N_PICK
    human_q, human_qd, size = state.human_q, state.human_qd, state.size
    if predicts:
        predict_person(floor_z, human_q[0], human_qd[0], size[0], 0, work)
    if second > 0:
        predict_person(floor_z, human_q[second], human_qd[second], size[second], 1, work)
    for i in range(3):
        for j in range(CONTROLLED):
            step = base[j] * arm.limits.qd_max[j] * HORIZONS[i]
            limit = abs(q_goal[j] - q[j])
            work.q[j] = q[j] + min(limit, max(-limit, step))
        _place_lanes(arm, work.q, ALONG_BASE, work)
        if not predicts:
            extrapolate_capsules(person.now, person.later, HORIZONS[i], person.moved)
        moved = work.ahead[0, i] if predicts else person.moved
        _measure_lanes(work, N_LANES, moved)
        out[STILL_AHEAD + i] = _lane_clearance(STILL, work)
        _write_clearances(work, STILL_AHEAD, i, out)
        if second > 0:
            moved, k = work.ahead[1, i], SECOND_CLEARANCE + 1
            _measure_lanes(work, N_LANES, moved)
            out[k + i] = _lane_clearance(STILL, work)
            _write_clearances(work, k, i, out)


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
        floor_z: Height of the floor [m].
        time_left: Time left to reach the target [s].
        robot: The robot, placed at ``state.q``.
        out: Filled, shape (N_FEATURES,), (N_WITH_BODY,), (N_WITH_PHASE,) or (N_PICK,).
    """
    place_person(floor_z, state.human_q[0], state.human_qd[0], state.size[0], work.person)
    observe_target(arm, floor_z, state, time_left, robot, work, out, False)


@kernel(inline="always")
def observe_target(
    arm: Arm,
    floor_z: float,
    state: PickQuery,
    time_left: float,
    robot: RobotPose,
    work: PickObservationWorkspace,
    out: Obs,
    again: bool,
) -> None:
    """Apply :func:`observe` with the first person already placed in ``work.person``.

    With ``again`` only what depends on the target is written: work space and ``out`` have the
    rest from another target in the same state.
    """
    n_obs, second = out.shape[0], 0
    q, goal, q_goal, person = state.q, state.goal, state.q_goal, work.person
    base, tcp = work.base, robot.tcp
    if not again:
        _write_joints(arm, state, out)
        _write_tool(state.qd, robot, out)
        _write_human_arms(person, robot, out)
        out[SCALARS + 3] = min(OBS_BOUND, time_left / TIME_SCALE)
        rot, pos = robot.rot, robot.pos
        place_capsules(rot, pos, COARSE_LINK, COARSE_P0, work.span, STILL, work.lanes)
    _write_target(goal, person, tcp, out)
    base_motion(arm, q, q_goal, base)
    for j in range(CONTROLLED):
        out[MOTION + j] = q_goal[j] - q[j]
        out[BASE_START + j] = base[j]
    _place_lanes(arm, state.q_grasp, AT_GOAL, work)
    if again:
        _measure_lanes(work, GOAL_LANES, person.now)
    else:
        nearest_parts(
            work.lanes, N_LANES, person.now, FIRST_PART, LAST_PART, work.clearance, work.part
        )
        _write_nearest(work, out)
    out[AT_GOAL_AHEAD] = _lane_clearance(AT_GOAL, work)
    if n_obs == N_WITH_PHASE or n_obs == N_PICK:
        _write_phase(state, out)
    if n_obs == N_PICK:
        second = place_second(floor_z, state, work)
        if second > 0:
            write_second(state.human_q[second], goal, tcp, work.second, out)
        else:
            write_second(work.far.q, goal, tcp, work.far, out)
        for k in range(SECOND_CLEARANCE, N_PICK):
            out[k] = FARTHEST / DISTANCE_SCALE
    if second > 0:
        _measure_lanes(work, N_LANES, work.second.now)
        out[SECOND_CLEARANCE] = _lane_clearance(STILL, work)
        out[SECOND_CLEARANCE + 7] = _lane_clearance(AT_GOAL, work)
    _write_look_ahead(arm, floor_z, state, second, work, out)


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
        floor_z: Height of the floor [m].
        states: The states, arrays of shape (n, ...).
        time_left: Time left in each [s], shape (n,).
        out: Filled, shape (n, length of an observation).
    """
    observe_states(arm, floor_z, states, time_left, new_robot_pose(arm), work, out)
