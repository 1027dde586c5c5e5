"""What episodes of both scenarios share: how they stand, and one period of robot and people."""

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from app.sim.collision.kernels.contact import NO_CONTACT, PeriodMotion, sweep
from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.geometry.capsules import copy_rows
from app.sim.human.kernels.kinematics import PELVIS_Z
from app.sim.people.kernels.motion import advance_people
from app.sim.people.kernels.people import (
    People,
    PeopleGeometry,
    PeopleState,
    place_people,
    store_clearances,
)
from app.sim.robot.kernels.actions import ActionRule, Coefficients, advance
from app.sim.robot.kernels.arm import Arm, RobotPose, copy_capsules, place_robot
from app.sim.robot.kernels.joints import JointPath, JointState

RUNNING, SUCCESS, COLLISION, TIMEOUT, UNFEASIBLE = range(5)
"""How an episode stands."""
PLAIN, FEATURES, FORECAST, CROWD = range(4)
"""What observations hold: the source's plain state, that and features, those and what is
forecast, or all that and everybody as a set."""
SUCCESS_DISTANCE = 0.1
"""tcp to target [m], thesis 4.3 and 5.3.1."""
START_TRIES = 200
"""Starts drawn before the last one is taken whatever its clearance."""


class Rows(Protocol):
    """The rows of a scenario that a period moves on; ``PickState`` says what they hold."""

    @property
    def q(self) -> Vec: ...  # noqa: D102
    @property
    def qd(self) -> Vec: ...  # noqa: D102
    @property
    def qdd(self) -> Vec: ...  # noqa: D102
    @property
    def robot(self) -> Vec: ...  # noqa: D102
    @property
    def people(self) -> PeopleState: ...  # noqa: D102
    @property
    def clear(self) -> Vec: ...  # noqa: D102
    @property
    def elapsed(self) -> Vec: ...  # noqa: D102
    @property
    def time_left(self) -> Vec: ...  # noqa: D102


class Space(Protocol):
    """The work space of a period; ``pick.Work`` says what it holds."""

    @property
    def robot(self) -> RobotPose: ...  # noqa: D102
    @property
    def crowd(self) -> PeopleGeometry: ...  # noqa: D102
    @property
    def c(self) -> Vec: ...  # noqa: D102
    @property
    def d(self) -> Vec: ...  # noqa: D102
    @property
    def q(self) -> Vec: ...  # noqa: D102
    @property
    def qd(self) -> Vec: ...  # noqa: D102
    @property
    def qdd(self) -> Vec: ...  # noqa: D102


@kernel(inline="always")
def move(
    arm: Arm,
    everybody: People,
    action: ActionRule,
    state: Rows,
    e: int,
    act: NDArray[np.float32],
    work: Space,
) -> tuple[bool, bool]:
    """Move robot and people of environment ``e`` through one period.

    Args:
        arm: Robot in its cell.
        everybody: Shared data of the people.
        action: What actions mean.
        state: Rows; changed.
        e: Environment.
        act: Action in [-1, 1].
        work: Holds the poses at the end afterwards, and the coefficients of the period.

    Returns:
        Whether anything touched, and whether some joint had no admissible coefficient.
    """
    people, crowd, robot = state.people, work.crowd, work.robot
    copy_rows(people.q[e], crowd.q0)
    copy_rows(people.cylinders[e], crowd.cylinders0)
    for w in range(people.q.shape[1]):
        crowd.pelvis_z[0, w] = people.size[e, w, PELVIS_Z]
    start = JointState(state.q[e], state.qd[e], state.qdd[e])
    segment, end = Coefficients(work.c, work.d), JointState(work.q, work.qd, work.qdd)
    unfeasible = advance(action, arm.limits, arm.dt, start, act, segment, end)
    state.elapsed[e] += arm.dt
    state.time_left[e] -= arm.dt
    advance_people(everybody, people, e, state.robot[e], arm.dt, crowd.away)
    copy_rows(people.size[e], crowd.size)
    path = JointPath(state.q[e], state.qd[e], work.c, work.d)
    motion = PeriodMotion(path, work.q, people.q[e], people.cylinders[e])
    kind, _ = sweep(
        arm,
        everybody,
        motion,
        state.robot[e],
        people.columns[e],
        state.clear[e],
        robot,
        crowd,
    )
    for j in range(6):
        state.q[e, j], state.qd[e, j], state.qdd[e, j] = work.q[j], work.qd[j], work.qdd[j]
    if kind != NO_CONTACT:
        place_robot(arm, work.q, robot)
        place_people(everybody, people, e, crowd)
    if everybody.yielding > 0.0:
        store_clearances(people, e, crowd)
    copy_capsules(robot.columns, state.robot[e])
    copy_capsules(crowd.columns, people.columns[e])
    return kind != NO_CONTACT, unfeasible


@kernel(inline="always")
def distance_to(goal: Vec, robot: RobotPose) -> float:
    """Return the distance of a placed robot's tcp to a target [m]."""
    x, y, z = goal[0] - robot.tcp[0], goal[1] - robot.tcp[1], goal[2] - robot.tcp[2]
    return math.sqrt(x * x + y * y + z * z)
