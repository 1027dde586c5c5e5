"""Starts of pick episodes: targets, candidates and configurations of the robot (compiled).

Source: docs/method.md 3.2.
"""

from typing import NamedTuple

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.core.kernels import rng as random
from app.sim.geometry.capsules import copy_values
from app.sim.people.kernels.motion import start_people
from app.sim.people.kernels.people import People, place_people
from app.sim.pick.kernels.grasp import (
    APPROACH,
    GraspRules,
    distance_left,
)
from app.sim.pick.kernels.reward import RewardWeights
from app.sim.robot.kernels import kinematics
from app.sim.robot.kernels.actions import ActionRule
from app.sim.robot.kernels.arm import (
    CONTROLLED,
    Arm,
    RobotPose,
    place_robot,
    robot_tilt,
)
from app.sim.scenario.kernels.episode import (
    MAX_CANDIDATES,
    START_TRIES,
    EpisodeState,
    Indices,
    StepWorkspace,
    begin,
    measure,
)

HIGHER = 0.35
"""Largest height of other starts above the box of targets [m]."""
WRIST_SPREAD = 0.3
"""Largest turn of the wrist joints of other starts [rad]."""


class PickCell(NamedTuple):
    """Data that all environments of the pick scenario share."""

    stations: Vec
    """Positions of the stations, cubes first [m], shape (n_stations, 3)."""
    station_q: Vec
    """Vertical-tool configurations at the stations [rad], shape (n_stations, 6)."""
    n_cubes: int
    """Number of cubes."""
    arm: Arm
    """The robot in its cell."""
    people: People
    """The people in the cell."""


class PickRules(NamedTuple):
    """Rules by which episodes start and end."""

    time_limit: float
    """Longest episode [s]."""
    short_limit: float
    """Time left at the start of the short episodes [s]."""
    short_share: float
    """Share of episodes that start with only ``short_limit`` left."""
    start_clearance: float
    """Least clearance of robot and person at the start [m]."""
    target_jitter: float
    """Half width of the box around a station from which targets are drawn [m]."""
    on_path_share: float
    """Share of episodes that start between the start configuration and the target."""
    at_target_share: float
    """Share of episodes that start at the target, ready to descend."""
    anywhere_share: float
    """Shares of targets and of starts drawn from ``box`` and not from the stations."""
    box: Vec
    """Corners of the box of other targets and starts [m], shape (2, 3)."""
    n_candidates_min: int
    """Fewest targets offered."""
    n_candidates_max: int
    """Most targets offered."""


class PickTask(NamedTuple):
    """Rules of the episodes, action type and reward coefficients."""

    rules: PickRules
    """Starts and ends."""
    grasp: GraspRules
    """Phases of a pick."""
    action: ActionRule
    """Action type and bounds."""
    weights: RewardWeights
    """Reward coefficients."""


@kernel()
def set_goal(
    world: PickCell,
    grasp: GraspRules,
    state: EpisodeState,
    e: int,
    goal: Vec,
    robot: RobotPose,
) -> None:
    """Set the target [m], shape (3,), in environment ``e`` and measure the distance to it.

    Another target than the present one restarts the approach; the same one changes nothing.
    """
    same = True
    for i in range(3):
        same = same and state.goal[e, i] == goal[i]
        state.goal[e, i] = goal[i]
    if not same:
        _start_pick(world.arm, grasp, state, e)
    place_robot(world.arm, state.q[e], robot)
    state.distance[e] = distance_left(grasp, state.phase[e], state.goal[e], robot.tcp)


@kernel(inline="always")
def _start_pick(arm: Arm, grasp: GraspRules, state: EpisodeState, e: int) -> bool:
    """Start the approach of a target; return whether target and object can be reached."""
    state.phase[e], state.closing[e] = APPROACH, 0.0
    goal = state.goal[e]
    reached: bool = kinematics.ik_vertical(arm.lengths, arm.limits, goal, state.q_goal[e])
    goal[2] -= grasp.depth
    low: bool = kinematics.ik_vertical(arm.lengths, arm.limits, goal, state.q_grasp[e])
    goal[2] += grasp.depth
    return reached and low


@kernel()
def _draw_candidates(
    world: PickCell, rules: PickRules, state: EpisodeState, e: int, rng: random.State
) -> None:
    """Draw different stations as candidates of an episode; the first one is its target."""
    n_stations = world.stations.shape[0]
    spread = rules.n_candidates_max - rules.n_candidates_min + 1
    n = rules.n_candidates_min + random.below(rng, spread)
    for i in range(MAX_CANDIDATES):
        state.candidates[e, i] = -1
    for i in range(n):
        while True:
            station = random.below(rng, n_stations)
            fresh = True
            for k in range(i):
                fresh = fresh and state.candidates[e, k] != station
            if fresh:
                break
        state.candidates[e, i] = station


@kernel(inline="always")
def _draw_point(rules: PickRules, rng: random.State, point: Vec) -> None:
    """Draw a point from the box of other targets and starts [m], shape (3,)."""
    for i in range(3):
        low, high = rules.box[0, i], rules.box[1, i]
        point[i] = low + (high - low) * random.uniform(rng)


@kernel()
def _draw_configuration(
    world: PickCell, rules: PickRules, point: Vec, q: Vec, rng: random.State
) -> None:
    """Draw a configuration with the tool over a point of the box, tilted within joint limits.

    Args:
        rules: Starts of episodes.
        point: Work space, shape (3,).
        q: Filled with the configuration [rad], shape (6,).
    """
    _draw_point(rules, rng, point)
    point[2] += HIGHER * random.uniform(rng)
    limits = world.arm.limits
    kinematics.ik_vertical(world.arm.lengths, limits, point, q)
    for j in range(3, CONTROLLED):
        turned = q[j] + WRIST_SPREAD * (2.0 * random.uniform(rng) - 1.0)
        q[j] = min(limits.q_max[j], max(limits.q_min[j], turned))


@kernel()
def _draw_station(world: PickCell, candidates: Indices, q: Vec, rng: random.State) -> None:
    """Write the configuration at home, a cube or a dock that is no candidate.

    Kind and station are drawn again where it is one.
    """
    n_stations = world.stations.shape[0]
    while True:
        kind = random.below(rng, 3)
        if kind == 0:
            copy_values(world.arm.home, q)
            break
        station = random.below(rng, world.n_cubes)
        if kind == 2:
            station = world.n_cubes + random.below(rng, n_stations - world.n_cubes)
        offered = False
        for i in range(MAX_CANDIDATES):
            offered = offered or candidates[i] == station
        if not offered:
            copy_values(world.station_q[station], q)
            break


@kernel()
def _draw_start(
    world: PickCell, rules: PickRules, state: EpisodeState, e: int, work: StepWorkspace
) -> None:
    """Draw the robot's start: at a station or anywhere, on the path to the target or at it."""
    rng, q = work.rng, state.q[e]
    _draw_station(world, state.candidates[e], q, rng)
    if rules.anywhere_share > 0.0 and random.uniform(rng) < rules.anywhere_share:
        _draw_configuration(world, rules, work.robot.tcp, q, rng)
    part = 0.0
    if random.uniform(rng) < rules.on_path_share:
        part = random.uniform(rng)
    if rules.at_target_share > 0.0 and random.uniform(rng) < rules.at_target_share:
        part = 1.0
    for j in range(CONTROLLED):
        q[j] += part * (state.q_goal[e, j] - q[j])
    for j in range(6):
        state.qd[e, j], state.qdd[e, j] = 0.0, 0.0


@kernel(inline="always")
def reset_env(
    world: PickCell,
    task: PickTask,
    seed: int,
    first_env: int,
    state: EpisodeState,
    e: int,
    work: StepWorkspace,
) -> None:
    """Start the next episode of environment ``e``."""
    rng, rules, grasp = work.rng, task.rules, task.grasp
    random.start_stream(seed, first_env + e, state.episode[e], rng)
    _draw_candidates(world, rules, state, e, rng)
    goal, arm = state.goal[e], world.arm
    copy_values(world.stations[state.candidates[e, 0]], goal)
    for i in range(3):
        low = i == 2 and grasp.depth > 0.0  # the object stays over the table
        spread = 0.5 * rules.target_jitter if low else rules.target_jitter
        goal[i] += spread * (2.0 * random.uniform(rng) - 1.0)
    if rules.anywhere_share > 0.0 and random.uniform(rng) < rules.anywhere_share:
        _draw_point(rules, rng, goal)
    if not _start_pick(arm, grasp, state, e):
        copy_values(world.stations[state.candidates[e, 0]], goal)
        _start_pick(arm, grasp, state, e)
    short = random.uniform(rng) < rules.short_share
    for attempt in range(START_TRIES):
        _draw_start(world, rules, state, e, work)
        place_robot(arm, state.q[e], work.robot)
        start_people(world.people, state.people, e, rng, work.geometry)
        measure(arm, world.people, state, e, work)
        state.n_redrawn[e] = attempt
        clear = state.clear[e]
        if clear[0] >= rules.start_clearance and min(clear[1], clear[2]) > 0.0:
            break
    state.tilt[e] = robot_tilt(work.robot)
    begin(state, e, rules.short_limit if short else rules.time_limit, work)
    state.distance[e] = distance_left(grasp, APPROACH, goal, work.robot.tcp)


@kernel()
def measure_starts(
    world: PickCell, grasp: GraspRules, state: EpisodeState, work: StepWorkspace
) -> None:
    """Measure clearances, tilts and distances of all environments at their starts."""
    for e in range(state.q.shape[0]):
        place_robot(world.arm, state.q[e], work.robot)
        place_people(world.people, state.people, e, work.geometry)
        measure(world.arm, world.people, state, e, work)
        state.tilt[e] = robot_tilt(work.robot)
        begin(state, e, state.time_left[e], work)
        state.distance[e] = distance_left(grasp, APPROACH, state.goal[e], work.robot.tcp)
