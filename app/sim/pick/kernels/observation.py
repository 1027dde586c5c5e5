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
from app.sim.geometry.capsules import nearest_parts
from app.sim.geometry.segments import segment_nearest
from app.sim.human.kernels import kinematics as body
from app.sim.pick.kernels.observation_layout import (
    ARMS,
    AT_GOAL_AHEAD,
    BASE_START,
    CLOSE_SCALE,
    DISTANCE_SCALE,
    FARTHEST,
    MOTION,
    N_FEATURES,
    N_PICK,
    N_WITH_BODY,
    N_WITH_PHASE,
    NEAREST,
    PELVIS,
    PRESENT_WITHIN,
    SCALARS,
    SECOND_ARMS,
    SECOND_CLEARANCE,
    STILL_AHEAD,
    TIME_SCALE,
)
from app.sim.pick.kernels.observation_workspace import (
    ALONG_BASE,
    AT_GOAL,
    COARSE_FIRST,
    COARSE_LINK,
    COARSE_P0,
    COARSE_SPAN,
    FIRST_PART,
    LAST_PART,
    N_COARSE,
    STILL,
    PickObservationWorkspace,
    PickQuery,
    predict_person,
    query_at,
)
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
    place_person,
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
        nearest_parts(work.lanes, moved, FIRST_PART, LAST_PART, work.gap, work.part)
        _write_clearances(work, STILL_AHEAD, i, out)
        if second > 0:
            moved = work.ahead[1, i]
            nearest_parts(work.lanes, moved, FIRST_PART, LAST_PART, work.gap, work.part)
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
    place_person(floor_z, state.human_q[0], state.human_qd[0], state.size[0], work.person)
    observe_target(arm, floor_z, state, time_left, robot, work, out)


@kernel(inline="always")
def observe_target(
    arm: Arm,
    floor_z: float,
    state: PickQuery,
    time_left: float,
    robot: RobotPose,
    work: PickObservationWorkspace,
    out: Obs,
) -> None:
    """Apply :func:`observe` with the first person already placed in ``work.person``."""
    n_obs, second = out.shape[0], 0
    if n_obs == N_WITH_BODY:
        for i in range(body.N_SIZE):
            out[N_FEATURES + i] = state.size[0, i]
    q, goal, q_goal, person = state.q, state.goal, state.q_goal, work.person
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
