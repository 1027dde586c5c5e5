"""State and step that the pick and reach scenarios share (compiled).

Each environment is a row of the arrays in :class:`EpisodeState`. An episode is determined by
(seed, environment, episode): target, start and the people's motion.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.collision.kernels.contact import NO_CONTACT, PeriodMotion, clearances, sweep
from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.core.kernels import rng as random
from app.sim.geometry.capsules import copy_rows
from app.sim.human.kernels.kinematics import PELVIS_Z
from app.sim.people.kernels.motion import advance_people
from app.sim.people.kernels.people import (
    People,
    PeopleGeometry,
    PeopleState,
    new_people_geometry,
    place_people,
    store_clearances,
)
from app.sim.robot.kernels.actions import ActionRule, Coefficients, advance
from app.sim.robot.kernels.arm import Arm, RobotPose, copy_capsules, new_robot_pose, place_robot
from app.sim.robot.kernels.joints import JointPath, JointState

Indices = NDArray[np.int64]

RUNNING, SUCCESS, COLLISION, TIMEOUT, UNFEASIBLE = range(5)
"""Outcomes of an episode."""
PLAIN, FEATURES, FORECAST, PEOPLE_SET = range(4)
"""Contents of observations: the thesis' raw state; the raw state and features; those and the
option features; all that and the people as a set."""
SUCCESS_DISTANCE = 0.1
"""tcp to target [m], thesis 4.3 and 5.3.1."""
START_TRIES = 200
"""Draws of a start, of which the last is used with any clearance."""
MAX_CANDIDATES = 6
"""Most targets that an episode of the pick scenario offers."""
NO_TARGET = -1
"""Number of a goal that is not one of the targets."""


class EpisodeState(NamedTuple):
    """State of all environments of a scenario."""

    q: Vec
    """Joint positions [rad], shape (n_envs, 6)."""
    qd: Vec
    """Joint speeds [rad/s], shape (n_envs, 6)."""
    qdd: Vec
    """Joint accelerations [rad/s^2], shape (n_envs, 6)."""
    robot: Vec
    """The robot's capsules at this moment, shape (n_envs, 9, n)."""
    people: PeopleState
    """State of the people."""
    goal: Vec
    """Target of the tcp [m], shape (n_envs, 3)."""
    target: Indices
    """Reach: number of the goal among the targets, or NO_TARGET, shape (n_envs,)."""
    q_goal: Vec
    """Pick: vertical-tool configuration at the target [rad], shape (n_envs, 6)."""
    q_grasp: Vec
    """Pick: vertical-tool configuration at the object [rad], shape (n_envs, 6)."""
    phase: Indices
    """Pick: phase of the grasp (``pick/kernels/grasp.py``), shape (n_envs,)."""
    closing: Vec
    """Pick: time for which the gripper has been closing [s], shape (n_envs,)."""
    candidates: Indices
    """Pick: stations offered, -1 where there are fewer, shape (n_envs, MAX_CANDIDATES)."""
    time_left: Vec
    """Time left [s], shape (n_envs,)."""
    elapsed: Vec
    """Time since the start [s], shape (n_envs,)."""
    distance: Vec
    """tcp to target, in picks with the descent and lift to come [m], shape (n_envs,)."""
    tilt: Vec
    """Pick: angle of the tool axis to the vertical [rad], shape (n_envs,)."""
    touched: Indices
    """Reach: control periods with a collision in the present episode, shape (n_envs,)."""
    episode: Indices
    """Number of the present episode, shape (n_envs,)."""
    outcome: Indices
    """Outcome of the present episode (RUNNING ...), shape (n_envs,)."""
    clear: Vec
    """Clearances to people, cell and the robot itself [m], shape (n_envs, 3)."""
    n_redrawn: Indices
    """Starts rejected because of too little clearance, shape (n_envs,)."""


def new_episode_state(arm: Arm, people: PeopleState, n_envs: int) -> EpisodeState:
    """Return the state of ``n_envs`` environments whose episodes have not started."""

    def numbers(*shape: int) -> Vec:
        return np.zeros((n_envs, *shape))

    def counts(*shape: int) -> Indices:
        return np.zeros((n_envs, *shape), dtype=np.int64)

    return EpisodeState(
        q=numbers(6),
        qd=numbers(6),
        qdd=numbers(6),
        robot=np.repeat(arm.capsules[None], n_envs, axis=0),
        people=people,
        goal=numbers(3),
        target=counts(),
        q_goal=numbers(6),
        q_grasp=numbers(6),
        phase=counts(),
        closing=numbers(),
        candidates=counts(MAX_CANDIDATES),
        time_left=numbers(),
        elapsed=numbers(),
        distance=numbers(),
        tilt=numbers(),
        touched=counts(),
        episode=counts(),
        outcome=counts(),
        clear=numbers(3),
        n_redrawn=counts(),
    )


class StepWorkspace(NamedTuple):
    """Work space of resets and steps; one per thread."""

    robot: RobotPose
    """A pose of the robot."""
    geometry: PeopleGeometry
    """A pose of the people."""
    c: Vec
    """Second coefficients of a control period [rad/s^2], shape (6,)."""
    d: Vec
    """Third coefficients of a control period [rad/s^3], shape (6,)."""
    q: Vec
    """Joint positions at the end of a control period [rad], shape (6,)."""
    qd: Vec
    """Joint speeds at the end of a control period [rad/s], shape (6,)."""
    qdd: Vec
    """Joint accelerations at the end of a control period [rad/s^2], shape (6,)."""
    rng: random.State
    """Random stream of the episode that starts, shape (1,)."""


def new_step_workspace(arm: Arm, people: People, state: PeopleState) -> StepWorkspace:
    """Return work space for environments with the people of ``state``."""
    return StepWorkspace(
        robot=new_robot_pose(arm),
        geometry=new_people_geometry(people, state.q.shape[1], state.cylinders.shape[1]),
        c=np.zeros(6),
        d=np.zeros(6),
        q=np.zeros(6),
        qd=np.zeros(6),
        qdd=np.zeros(6),
        rng=np.zeros(1, dtype=np.uint64),
    )


@kernel(inline="always")
def move(
    arm: Arm,
    people: People,
    action: ActionRule,
    state: EpisodeState,
    e: int,
    act: NDArray[np.float32],
    work: StepWorkspace,
) -> tuple[bool, bool]:
    """Move robot and people of environment ``e`` through one control period.

    Args:
        action: Action type and bounds.
        state: Environments; changed.
        e: Environment.
        act: Action in [-1, 1].
        work: Holds the poses at the end afterwards, and the coefficients of the control period.

    Returns:
        Whether there was a contact, and whether a joint had no admissible coefficient.
    """
    humans, geometry, robot = state.people, work.geometry, work.robot
    copy_rows(humans.q[e], geometry.q0)
    copy_rows(humans.cylinders[e], geometry.cylinders0)
    for w in range(humans.q.shape[1]):
        geometry.pelvis_z[0, w] = humans.size[e, w, PELVIS_Z]
    start = JointState(state.q[e], state.qd[e], state.qdd[e])
    segment, end = Coefficients(work.c, work.d), JointState(work.q, work.qd, work.qdd)
    unfeasible = advance(action, arm.limits, arm.dt, start, act, segment, end)
    state.elapsed[e] += arm.dt
    state.time_left[e] -= arm.dt
    advance_people(people, humans, e, state.robot[e], arm.dt, geometry.away)
    copy_rows(humans.size[e], geometry.size)
    path = JointPath(state.q[e], state.qd[e], work.c, work.d)
    motion = PeriodMotion(path, work.q, humans.q[e], humans.cylinders[e])
    capsules0, clear = state.robot[e], state.clear[e]
    kind, _ = sweep(arm, people, motion, capsules0, humans.capsules[e], clear, robot, geometry)
    for j in range(6):
        state.q[e, j], state.qd[e, j], state.qdd[e, j] = work.q[j], work.qd[j], work.qdd[j]
    if kind != NO_CONTACT:
        place_robot(arm, work.q, robot)
        place_people(people, humans, e, geometry)
    if people.yielding > 0.0:
        store_clearances(humans, e, geometry)
    copy_capsules(robot.capsules, state.robot[e])
    copy_rows(geometry.capsules, humans.capsules[e])
    return kind != NO_CONTACT, unfeasible


@kernel(inline="always")
def measure(arm: Arm, people: People, state: EpisodeState, e: int, work: StepWorkspace) -> None:
    """Store the clearances of the placed robot and people in environment ``e``."""
    clear = clearances(arm, people, work.robot, work.geometry)
    state.clear[e, 0], state.clear[e, 1], state.clear[e, 2] = clear


@kernel(inline="always")
def begin(state: EpisodeState, e: int, time_limit: float, work: StepWorkspace) -> None:
    """Start an episode of environment ``e`` from the placed robot and people.

    Args:
        state: Environments; changed.
        e: Environment.
        time_limit: Time left at the start [s].
        work: Holds the placed robot and people.
    """
    state.distance[e] = distance_to(state.goal[e], work.robot)
    copy_capsules(work.robot.capsules, state.robot[e])
    copy_rows(work.geometry.capsules, state.people.capsules[e])
    state.time_left[e], state.elapsed[e] = time_limit, 0.0
    state.touched[e], state.outcome[e] = 0, RUNNING


@kernel(inline="always")
def distance_to(goal: Vec, robot: RobotPose) -> float:
    """Return the distance of a placed robot's tcp to a target [m]."""
    x, y, z = goal[0] - robot.tcp[0], goal[1] - robot.tcp[1], goal[2] - robot.tcp[2]
    return math.sqrt(x * x + y * y + z * z)


@kernel(inline="always")
def progress(old: float, new: float, coefficient: float, gamma: float) -> float:
    """Return the progress reward: positive where ``new`` is less than ``old``."""
    return coefficient * (old - gamma * new)
