"""Observation of one robot beside people for each of several candidates (compiled)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.geometry.capsules import copy_values
from app.sim.pick.kernels.grasp import DESCEND, GraspRules
from app.sim.pick.kernels.observation import observe_target
from app.sim.pick.kernels.observation_workspace import PickObservationWorkspace, PickQuery
from app.sim.robot.kernels.arm import Arm, RobotPose, place_robot
from app.sim.robot.kernels.kinematics import ik_vertical
from app.sim.scenario.kernels.person_observation import Obs, place_person


class Surroundings(NamedTuple):
    """The robot, and people, or each of m sets of people."""

    q: Vec
    """Joint positions [rad], shape (6,)."""
    qd: Vec
    """Joint speeds [rad/s], shape (6,)."""
    human_q: Vec
    """Joint positions of P people, the nearest first [m, rad], shape (m, P, 18)."""
    human_qd: Vec
    """Their joint speeds [m/s, rad/s], shape (m, P, 18)."""
    size: Vec
    """Their body dimensions [m], shape (m, P, body.N_SIZE)."""
    time_left: float
    """Time left [s]."""


class Targets(NamedTuple):
    """The candidates, and the progress of the pick that the robot is at."""

    goals: Vec
    """Their targets [m], shape (n, 3)."""
    current: int
    """Number of the candidate that is being picked; -1: none."""
    phase: int
    """Phase of that pick (``grasp.py``)."""
    closing: float
    """Share of the closing time that has passed, 0 to 1."""


class CandidateWorkspace(NamedTuple):
    """Work space of one call."""

    robot: RobotPose
    """The robot."""
    observation: PickObservationWorkspace
    """Of the observation."""
    q_goal: Vec
    """Configuration at the target [rad], shape (6,)."""
    q_grasp: Vec
    """Configuration at the object [rad], shape (6,)."""
    point: Vec
    """Target of the tcp in the present phase [m], shape (3,)."""


@kernel()
def observe_candidates(
    arm: Arm,
    floor_z: float,
    grasp: GraspRules,
    around: Surroundings,
    targets: Targets,
    work: CandidateWorkspace,
    reachable: NDArray[np.bool_],
    out: Obs,
) -> None:
    """Write the observations of n candidates beside each of m sets of people.

    Robot and people are placed once for all candidates.

    Args:
        floor_z: Height of the floor [m].
        grasp: Phases of a pick.
        around: Robot and people.
        reachable: Filled, whether target and object are reachable, shape (n,).
        out: Filled, observations of all candidates beside the first set of people, then beside
            the next, shape (m n, length of an observation).
    """
    q_goal, q_grasp, point, person = (
        work.q_goal,
        work.q_grasp,
        work.point,
        work.observation.person,
    )
    goals, n = targets.goals, targets.goals.shape[0]
    place_robot(arm, around.q, work.robot)
    for s in range(around.human_q.shape[0]):
        human_q, human_qd, size = around.human_q[s], around.human_qd[s], around.size[s]
        place_person(floor_z, human_q[0], human_qd[0], size[0], person)
        for i in range(n):
            phase, closing = 0, 0.0
            if i == targets.current:
                phase, closing = targets.phase, targets.closing
            point[0], point[1], point[2] = goals[i, 0], goals[i, 1], goals[i, 2]
            over = ik_vertical(arm.lengths, arm.limits, point, q_goal)
            point[2] -= grasp.depth
            at = ik_vertical(arm.lengths, arm.limits, point, q_grasp)
            if phase != DESCEND:
                point[2] = goals[i, 2]
            reachable[i] = over and at
            state = PickQuery(
                around.q,
                around.qd,
                human_q,
                human_qd,
                size,
                point,
                q_grasp if phase == DESCEND else q_goal,
                q_grasp,
                phase,
                closing,
            )
            row, left = out[s * n + i], around.time_left
            if i > 0:
                copy_values(out[s * n], row)
            observe_target(arm, floor_z, state, left, work.robot, work.observation, row, i > 0)
