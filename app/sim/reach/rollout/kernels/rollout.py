"""Simulation and scoring of one candidate action sequence (compiled).

The robot follows its exact motion, people move as ``prediction.py`` says, and the policy
is queried every ``STEP_S``. A rollout ends at the goal, in a collision, or at the horizon. A
person nearer than the prediction margin counts as a collision; the margin grows from zero over
the first moments, in which no action can change the distance.

**Speed and separation constraint.** With a safety layer that uses measured velocities
(``ssm.py``), a collision is also a person who is, or will be at the end of a motion that begins
now, nearer than the layer allows, because the layer would then stop the robot. Candidates are
simulated for as long as a person takes to walk past, and scored by time; a candidate that does
not reach the goal by then is charged the remaining joint motion at half speed. Where a person
is already nearer than the layer allows, the constraint is dropped: the layer alone acts.
"""

from typing import NamedTuple

from app.sim.core.arrays import Vec
from app.sim.core.jit import FAR, kernel
from app.sim.geometry.capsules import copy_values
from app.sim.geometry.cylinder import cylinder_clearance
from app.sim.prediction.kernels.networks import N_TIMES, STEP_S
from app.sim.reach.kernels.base_controller import base_motion
from app.sim.reach.kernels.episode import ReachCell
from app.sim.reach.kernels.observation import N_FEATURES, write_features
from app.sim.reach.kernels.observation_workspace import ReachQuery
from app.sim.reach.kernels.option_features import (
    predict_option_clearances,
    write_option_features,
)
from app.sim.reach.rollout.kernels.actor import act_once
from app.sim.reach.rollout.kernels.candidates import (
    EVASION,
    N_VIAS,
    POLICY,
    SAMPLE,
    SAMPLE_STEPS,
    STOP,
    STRAIGHT,
    CandidateSequence,
    write_bang_bang,
    write_joint_move,
)
from app.sim.reach.rollout.kernels.prediction import HORIZON_STEPS, LONG_HORIZON_STEPS
from app.sim.reach.rollout.kernels.workspace import DISTANCE, HORIZON, RolloutWorkspace
from app.sim.robot.kernels import kinematics
from app.sim.robot.kernels.actions import ActionRule, Coefficients, advance
from app.sim.robot.kernels.arm import Arm, cell_clearance, place_robot, self_clearance
from app.sim.robot.kernels.joints import JointState
from app.sim.scenario.kernels.episode import (
    COLLISION,
    RUNNING,
    SUCCESS,
    SUCCESS_DISTANCE,
    EpisodeState,
    distance_to,
)
from app.sim.scenario.kernels.person_observation import HORIZONS

SUCCESS_SCORE, COLLISION_SCORE = 2.0, -2.0
"""Scores of success and collision at time 0."""
TIME_COST = 0.3
"""Change of both scores with time: success loses, collision gains [1/s]."""
CLEARANCE_WEIGHT, DISTANCE_COST = 0.3, 0.3
"""Score of a rollout that ends otherwise: least clearance less distance to the goal [1/m]."""
DETOUR_COST = 0.05
"""Cost of the time spent on the motion to a via configuration [1/s]."""
ENOUGH_CLEARANCE = 0.5
"""Clearance above which the score does not increase [m]."""
PREDICTION_MARGIN, MARGIN_RATE = 0.01, 0.02
"""Clearance to people below which a rollout collides [m], and its growth from zero [m/s]."""
SSM_TIME_COST = 0.15
"""Replaces TIME_COST under a speed and separation constraint [1/s]."""
REMAINING_SPEED = 0.5
"""Share of full speed at which the remaining joint motion is charged."""
IK_STEPS, IK_STEP, IK_TOLERANCE = 20, 0.5, 0.02
"""Inverse kinematics of the goal: iterations, largest joint step [rad], tcp tolerance [m]."""


class Beginning(NamedTuple):
    """Start of a rollout: inside the first step, and how much of the margin applies."""

    elapsed: int
    """Control periods of the first step that have been executed with the last action."""
    margin: float
    """Share of the prediction margin."""


@kernel(inline="always")
def periods_of(dt: float) -> int:
    """Return the number of control periods of ``dt`` [s] per step."""
    return max(1, int(STEP_S / dt + 0.5))


@kernel(inline="always")
def _observe_people(world: ReachCell, step: int, work: RolloutWorkspace) -> float:
    """Fill the observed people at a step; return the clearance of the placed robot [m]."""
    observation, robot, top = work.observation, work.observation.robot, world.people.top_z
    places, n, nearest, observed = work.people.places, work.people.n[0], FAR, 0
    for i in range(3):
        observation.clearances_ahead[i] = FAR
    for p in range(n):
        x, y, r = places[step, p, 0], places[step, p, 1], places[step, p, 2]
        d, _ = cylinder_clearance(robot.capsules, 0, x, y, r, top)
        if d < nearest:
            nearest, observed = d, p
        vx = (places[step + 1, p, 0] - x) / STEP_S
        vy = (places[step + 1, p, 1] - y) / STEP_S
        for i in range(3):
            there_x, there_y = x + HORIZONS[i] * vx, y + HORIZONS[i] * vy
            d, _ = cylinder_clearance(robot.capsules, 0, there_x, there_y, r, top)
            observation.clearances_ahead[i] = min(observation.clearances_ahead[i], d)
        for i in range(N_TIMES):
            for m in range(3):
                observation.predicted[i, p, m] = places[step + 1 + i, p, m]
    now, later = places[step, observed], places[step + 1, observed]
    for m in range(2):
        observation.observed[m] = now[m]
        observation.observed[2 + m] = (later[m] - now[m]) / STEP_S
    observation.observed[4] = now[2]
    observation.observed[5] = (later[2] - now[2]) / STEP_S
    observation.n[0], observation.n[1] = n, observed
    return nearest


@kernel(inline="always")
def _query_policy(
    world: ReachCell, goal: Vec, time_left: float, step: int, work: RolloutWorkspace
) -> None:
    """Write the policy's action at a step into ``work.act``; the robot is placed."""
    arm, top, observation, obs = world.arm, world.people.top_z, work.observation, work.obs
    query = ReachQuery(work.q, work.qd, goal)
    clearance = _observe_people(world, step, work)
    predict_option_clearances(arm, top, work.q, work.qd, observation)
    write_features(arm, top, query, clearance, time_left, observation, obs)
    write_option_features(arm, top, query, observation, N_FEATURES, obs)
    act_once(work.actor, obs, work.act)


@kernel(inline="always")
def _people_clearance(
    world: ReachCell, step: int, share: float, within: float, work: RolloutWorkspace
) -> float:
    """Return the clearance of the placed robot to people between two steps [m].

    Args:
        step: The earlier step.
        share: Share of the time to the later one that has passed.
        within: The most that is returned [m].
    """
    least, places, top = within, work.people.places, world.people.top_z
    for p in range(work.people.n[0]):
        a, b = places[step, p], places[step + 1, p]
        x, y = a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])
        r = a[2] + share * (b[2] - a[2])
        least, _ = cylinder_clearance(work.observation.robot.capsules, 0, x, y, r, top, least)
    return least


@kernel()
def _clearance_at(world: ReachCell, t: float, work: RolloutWorkspace) -> float:
    """Return the clearance of the placed robot to people at time ``t`` from now [m]."""
    step = int(t / STEP_S)
    return _people_clearance(world, step, t / STEP_S - step, FAR, work)


@kernel()
def _separation(world: ReachCell, t: float, work: RolloutWorkspace) -> float:
    """Return the separation of the placed robot and people as the safety layer counts it [m].

    This is the lesser of the clearances at time ``t`` [s] and at the end of a motion that
    begins then.
    """
    now = _clearance_at(world, t, work)
    return min(now, _clearance_at(world, t + work.ssm[HORIZON], work))


@kernel()
def apply_ssm_constraint(
    world: ReachCell, state: EpisodeState, e: int, work: RolloutWorkspace
) -> None:
    """Set the distance required of candidates, and the goal configuration, for a decision.

    ``work.ssm_distance`` is 0 if people are nearer than required already: the layer alone acts
    then. ``work.q_goal`` is found by inverse kinematics from home. People must be predicted.
    """
    arm, observation, robot, goal = (
        world.arm,
        work.observation,
        work.observation.robot,
        state.goal[e],
    )
    place_robot(arm, state.q[e], robot)
    required = work.ssm[DISTANCE]
    work.ssm_distance[0] = required if _separation(world, 0.0, work) > required else 0.0
    copy_values(arm.home, work.q_goal)
    for _ in range(IK_STEPS):
        place_robot(arm, work.q_goal, robot)
        if distance_to(goal, robot) < IK_TOLERANCE:
            break
        kinematics.tcp_jacobian(robot.rot, robot.pos, robot.tcp, robot.jacobian)
        base_motion(arm, robot, goal, observation)
        longest = IK_STEP
        for j in range(6):
            longest = max(longest, abs(observation.step[j]))
        for j in range(6):
            there = work.q_goal[j] + IK_STEP / longest * observation.step[j]
            work.q_goal[j] = max(arm.limits.q_min[j], min(arm.limits.q_max[j], there))


@kernel(inline="always")
def write_straight(world: ReachCell, goal: Vec, work: RolloutWorkspace) -> None:
    """Write the action of a straight motion to the goal; the robot is placed.

    The tcp moves straight; under a speed and separation constraint the joints do, because the
    robot then returns from farther away.
    """
    if work.ssm_distance[0] > 0.0:
        write_joint_move(world.arm, work.q_goal, work.q, work.act)
        return
    observation, robot = work.observation, work.observation.robot
    kinematics.tcp_jacobian(robot.rot, robot.pos, robot.tcp, robot.jacobian)
    base_motion(world.arm, robot, goal, observation)
    for j in range(6):
        work.act[j] = max(-1.0, min(1.0, observation.base[j]))


@kernel(inline="always")
def _write_action(
    world: ReachCell,
    goal: Vec,
    time_left: float,
    step: int,
    candidate: CandidateSequence,
    work: RolloutWorkspace,
) -> None:
    """Write the action of a candidate at a step into ``work.act``; the robot is placed."""
    kind, first = candidate.kind, step < candidate.steps
    if kind == POLICY and step == 0:
        copy_values(work.best_act, work.act)
    elif kind == SAMPLE and first:
        write_joint_move(world.arm, work.waypoint, work.q, work.act)
    elif kind == SAMPLE or (kind == STRAIGHT and first):
        write_straight(world, goal, work)
    elif kind >= EVASION:
        write_bang_bang(kind - EVASION, first, work.act)
    elif kind == POLICY or not first:
        _query_policy(world, goal, time_left, step, work)
    elif kind == STOP:
        work.act[:] = 0.0
    else:
        write_joint_move(world.arm, work.vias[kind], work.q, work.act)


@kernel(inline="always")
def _collides(arm: Arm, clearance: float, work: RolloutWorkspace) -> bool:
    """Return whether the placed robot touches people, the cell or itself."""
    robot = work.observation.robot
    return bool(
        clearance <= 0.0
        or cell_clearance(arm, robot.capsules)[0] <= 0.0
        or self_clearance(arm, robot)[0] <= 0.0
    )


@kernel()
def _margin_left(
    world: ReachCell, clearance: float, t: float, share: float, work: RolloutWorkspace
) -> float:
    """Return the clearance to people beyond the required distance [m].

    Args:
        clearance: Clearance of the placed robot to people [m].
        t: Time from now [s].
        share: Share of the prediction margin.
    """
    left = clearance
    if work.ssm_distance[0] > 0.0:
        left = min(clearance, _separation(world, t, work)) - work.ssm_distance[0]
    return left - share * min(PREDICTION_MARGIN, MARGIN_RATE * t)


@kernel(inline="always")
def _horizon_of(kind: int, work: RolloutWorkspace) -> int:
    """Return the number of steps for which a candidate is simulated."""
    if work.ssm_distance[0] > 0.0 and (kind == POLICY or kind == STRAIGHT or kind == SAMPLE):
        return LONG_HORIZON_STEPS
    return SAMPLE_STEPS if kind == SAMPLE else HORIZON_STEPS


@kernel(inline="always")
def _remaining_time(arm: Arm, work: RolloutWorkspace) -> float:
    """Return the time that the joints need to the configuration at the goal [s]."""
    longest = 0.0
    for j in range(6):
        longest = max(longest, abs(work.q_goal[j] - work.q[j]) / arm.limits.qd_max[j])
    return longest / REMAINING_SPEED


@kernel()
def simulate_candidate(
    world: ReachCell,
    rule: ActionRule,
    state: EpisodeState,
    e: int,
    candidate: CandidateSequence,
    beginning: Beginning,
    work: RolloutWorkspace,
) -> tuple[int, float]:
    """Simulate one candidate from the present state of environment ``e``.

    Args:
        rule: Action type and bounds.
        e: Environment.
        candidate: The candidate; the action of POLICY is ``work.best_act``, the waypoint of
            SAMPLE is ``work.waypoint``.
        beginning: Start of the rollout.
        work: Policy, work space and predicted people; ``closest`` and ``first_act`` are filled.

    Returns:
        Outcome (RUNNING, SUCCESS or COLLISION) and score.
    """
    arm, goal, least, robot = world.arm, state.goal[e], ENOUGH_CLEARANCE, work.observation.robot
    periods, now, elapsed = periods_of(arm.dt), 0, beginning.elapsed
    constrained = work.ssm_distance[0] > 0.0
    time_cost = SSM_TIME_COST if constrained else TIME_COST
    via = 0 <= candidate.kind < N_VIAS and not constrained
    detour = DETOUR_COST * STEP_S * candidate.steps if via else 0.0
    for j in range(6):
        work.q[j], work.qd[j], work.qdd[j] = state.q[e, j], state.qd[e, j], state.qdd[e, j]
    place_robot(arm, work.q, robot)
    joints, segment = JointState(work.q, work.qd, work.qdd), Coefficients(work.c, work.d)
    work.closest[0] = FAR
    for step in range(_horizon_of(candidate.kind, work)):
        left = state.time_left[e] - step * STEP_S
        if left <= 0.0:
            break
        if step == 0 and elapsed > 0:
            copy_values(work.last_act[e], work.act)
        else:
            _write_action(world, goal, left, step, candidate, work)
        if step == 0:
            copy_values(work.act, work.first_act)
        for _ in range(elapsed if step == 0 else 0, periods):
            advance(rule, arm.limits, arm.dt, joints, work.act, segment, joints)
            place_robot(arm, work.q, robot)
            before = now // periods
            now += 1
            t, share = now * arm.dt, now / periods - before
            clearance = _people_clearance(world, before, share, ENOUGH_CLEARANCE, work)
            least = min(least, clearance)
            if _collides(arm, _margin_left(world, clearance, t, beginning.margin, work), work):
                return COLLISION, COLLISION_SCORE + time_cost * t - detour
            work.closest[0] = min(work.closest[0], distance_to(goal, robot))
            if work.closest[0] < SUCCESS_DISTANCE:
                return SUCCESS, SUCCESS_SCORE - time_cost * t - detour
    score = CLEARANCE_WEIGHT * least - DISTANCE_COST * distance_to(goal, robot) - detour
    if constrained:
        score = SUCCESS_SCORE - time_cost * (now * arm.dt + _remaining_time(arm, work))
    return RUNNING, score
