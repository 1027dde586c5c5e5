"""Work space in which observations of the reach scenario are computed (compiled)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.people.kernels.people import (
    MAX_PEOPLE,
    People,
    PeopleGeometry,
    PeopleState,
    new_people_geometry,
)
from app.sim.prediction.kernels.networks import N_TIMES, MotionPredictor
from app.sim.robot.kernels.arm import Arm, RobotPose, new_robot_pose
from app.sim.robot.kernels.configuration_lanes import new_lanes
from app.sim.scenario.kernels.person_observation import PersonWorkspace, new_person_workspace

N_PERSON = 6
"""Numbers that describe an observed person: x, y [m], vx, vy [m/s], r [m], growth [m/s]."""
RETREAT_PAN = 0.9
"""Pan angle to either side of home to which the robot may retreat [rad]."""
N_RETREATS = 3
"""Configurations to which the robot may retreat: home and either side of home."""
LOOKS = (1, 3, 6, 9, 12, 17, 24, 32)
"""Times at which the clearances of the options are evaluated, in steps of the prediction."""
N_LOOKS = len(LOOKS)
"""Number of these times."""
N_ASIDE = 1 + N_RETREATS
"""Options that do not lead to the goal: standing still and the retreats."""


class ReachQuery(NamedTuple):
    """A state of the robot and a goal for which features are written."""

    q: Vec
    """Joint positions [rad], shape (6,)."""
    qd: Vec
    """Joint speeds [rad/s], shape (6,)."""
    goal: Vec
    """Goal of the tcp [m], shape (3,)."""


class ReachObservationWorkspace(NamedTuple):
    """Work space of observations and rollouts; one per thread."""

    robot: RobotPose
    """The robot at the observed configuration."""
    geometry: PeopleGeometry
    """The people, placed as they are now."""
    observed: Vec
    """The observed person as a cylinder in the world frame, shape (N_PERSON,)."""
    clearances_ahead: Vec
    """Clearances of the robot at rest to people extrapolated to ``HORIZONS`` [m], (3,)."""
    body: PersonWorkspace
    """A worker's capsules, now and extrapolated."""
    clearance: Vec
    """Clearance of the robot to each capsule of a worker [m], shape (16,), padding included."""
    moved: RobotPose
    """The robot further along a motion."""
    lanes: Vec
    """The robot in several configurations (``robot/kernels/configuration_lanes.py``), flat."""
    q: Vec
    """Joint positions of one of these configurations [rad], and work space, shape (6,)."""
    step: Vec
    """Joint step of damped least squares from the tcp to the goal [rad], shape (6,)."""
    base: Vec
    """Action of the base controller in [-1, 1], shape (6,)."""
    predictor: MotionPredictor
    """Predicts radius and path length of a pedestrian."""
    course: Vec
    """Predicted radius and path length of one person [m], shape (N_TIMES, 2)."""
    person: Vec
    """One person, shape (N_PERSON,)."""
    people: Vec
    """All considered people, each as ``person``, shape (MAX_PEOPLE, N_PERSON)."""
    predicted: Vec
    """x, y and radius of all considered people [m], (N_TIMES, MAX_PEOPLE, 3)."""
    n: NDArray[np.int64]
    """Number of considered people, and index of the observed one, shape (2,)."""
    retreats: Vec
    """Configurations to retreat to [rad], shape (N_RETREATS, 6)."""
    aside: Vec
    """Scaled clearances of the options that do not lead to the goal: at each of ``LOOKS``, then
    the least one, shape (N_ASIDE * (N_LOOKS + 1),)."""


def new_observation_workspace(
    arm: Arm, people: People, state: PeopleState, predictor: MotionPredictor
) -> ReachObservationWorkspace:
    """Return work space for environments with the people of ``state``."""
    pan = np.zeros((N_RETREATS, 6))
    pan[1, 0], pan[2, 0] = RETREAT_PAN, -RETREAT_PAN
    body = new_person_workspace()
    return ReachObservationWorkspace(
        robot=new_robot_pose(arm),
        geometry=new_people_geometry(people, state.q.shape[1], state.cylinders.shape[1]),
        observed=np.zeros(N_PERSON),
        clearances_ahead=np.zeros(3),
        body=body,
        clearance=np.zeros(body.now.shape[1]),
        moved=new_robot_pose(arm),
        lanes=new_lanes(),
        q=np.zeros(6),
        step=np.zeros(6),
        base=np.zeros(6),
        predictor=predictor,
        course=np.zeros((N_TIMES, 2)),
        person=np.zeros(N_PERSON),
        people=np.zeros((MAX_PEOPLE, N_PERSON)),
        predicted=np.zeros((N_TIMES, MAX_PEOPLE, 3)),
        n=np.zeros(2, dtype=np.int64),
        retreats=np.clip(arm.home + pan, arm.limits.q_min, arm.limits.q_max),
        aside=np.zeros(N_ASIDE * (N_LOOKS + 1)),
    )
