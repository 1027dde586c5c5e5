"""Contact test of one control period, compiled: finds every contact, to 1 ms.

At a pose with clearance ``d`` nothing touches before ``d / v`` seconds, with ``v`` a bound on
the speed of approach of any two points. So an interval with clearances ``a`` and ``b`` at its
ends is free where ``a + b > v (its length)``; otherwise it is halved, down to intervals of
``FINEST_STEP``, at the end of which contact is reported. So no contact is missed, its time is
late by at most ``FINEST_STEP``, and bodies that pass at less than ``v FINEST_STEP / 2`` may
count as touching. The end of the period mostly suffices. Within a period the robot follows its
polynomial, workers move linearly in joint space, cylinders linearly.
"""

from typing import NamedTuple

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.geometry.capsules import copy_rows
from app.sim.human.kernels.kinematics import PELVIS_Z
from app.sim.people.kernels.people import (
    People,
    PeopleGeometry,
    people_clearance,
    place_workers,
)
from app.sim.people.kernels.speeds import people_speed_bound
from app.sim.robot.kernels.arm import (
    Arm,
    RobotPose,
    cell_clearance,
    place_robot,
    robot_speed_bound,
    self_clearance,
)
from app.sim.robot.kernels.joints import JointPath

NO_CONTACT, HUMAN_CONTACT, CELL_CONTACT, SELF_CONTACT = range(4)
FINEST_STEP = 1e-3
"""Intervals up to this are not halved [s]."""

Clear = tuple[float, float, float]


class PeriodMotion(NamedTuple):
    """Motion of robot and people in one period."""

    path: JointPath
    """The robot's path."""
    q1: Vec
    """Joint positions at the end [rad], shape (6,)."""
    human_q1: Vec
    """The workers' joints at the end [m, rad], shape (W, 18)."""
    cylinders1: Vec
    """x, y and radius of the cylinders at the end [m], shape (C, 3)."""


@kernel(inline="always")
def clearances(arm: Arm, people: People, robot: RobotPose, geometry: PeopleGeometry) -> Clear:
    """Return the distances of a placed robot to people, cell and itself [m]."""
    return (
        people_clearance(people, robot.capsules, geometry),
        cell_clearance(arm, robot.capsules)[0],
        self_clearance(arm, robot)[0],
    )


@kernel(inline="always")
def _kind(a: Clear, b: Clear, robot_speed: float, approach: float, seconds: float) -> int:
    """Return the kind of contact possible in an interval, from clearances at its ends."""
    if a[0] + b[0] <= approach * seconds:
        return HUMAN_CONTACT
    if a[1] + b[1] <= robot_speed * seconds:
        return CELL_CONTACT
    if a[2] + b[2] <= 2.0 * robot_speed * seconds:
        return SELF_CONTACT
    return NO_CONTACT


@kernel(inline="always")
def sweep(
    arm: Arm,
    people: People,
    motion: PeriodMotion,
    robot0: Vec,
    workers0: Vec,
    clear: Vec,
    robot: RobotPose,
    geometry: PeopleGeometry,
) -> tuple[int, float]:
    """Check one period for contact, including between its ends.

    Args:
        motion: Motion of robot and people.
        robot0: The robot's capsules at the start, shape (9, n).
        workers0: The workers' capsules at the start, shape (9, m).
        clear: Clearances at the start, from :func:`clearances` [m], shape (3,); afterwards
            those at the last pose tested.
        robot: Work space; holds the last pose tested, the end of the period if no contact.
        geometry: Work space, likewise; ``q0``, ``cylinders0``, ``pelvis_z[0]`` hold the people
            at the start, ``size`` their sizes at the end.

    Returns:
        Kind of contact, and the time in the period at which it was found [s].
    """
    place_robot(arm, motion.q1, robot)
    place_workers(people, motion.human_q1, geometry)
    for w in range(motion.human_q1.shape[0]):
        geometry.pelvis_z[1, w] = geometry.size[w, PELVIS_Z]
    copy_rows(motion.cylinders1, geometry.cylinders)
    robot_speed = robot_speed_bound(arm, motion.path, robot0, robot.capsules)
    approach = robot_speed + people_speed_bound(
        workers0, geometry.capsules, geometry.cylinders0, motion.cylinders1, arm.dt
    )
    begin = (clear[0], clear[1], clear[2])
    end = clearances(arm, people, robot, geometry)
    kind, x, last = NO_CONTACT, arm.dt, end
    if _kind(begin, end, robot_speed, approach, arm.dt) != NO_CONTACT:
        speeds = (robot_speed, approach)
        kind, x, last = _search(arm, people, motion, begin, end, speeds, robot, geometry)
        _place_at(arm, people, motion, x, robot, geometry)
    clear[0], clear[1], clear[2] = last
    return kind, x


@kernel()
def _search(
    arm: Arm,
    people: People,
    motion: PeriodMotion,
    begin: Clear,
    end: Clear,
    speeds: tuple[float, float],
    robot: RobotPose,
    geometry: PeopleGeometry,
) -> tuple[int, float, Clear]:
    """Halve the period until every interval is free or too short to be halved.

    Args:
        motion: Motion of robot and people.
        begin: Clearances at the start [m].
        end: Clearances at the end [m].
        speeds: Bounds on the robot's speed and on that of robot and people together [m/s].
        robot: Work space.
        geometry: Work space.

    Returns:
        Kind of contact, its time in the period [s], and the clearances there [m].
    """
    a, top, (robot_speed, approach) = 0.0, 0, speeds
    right, ahead = geometry.stack_end, geometry.stack_clear
    right[0] = arm.dt
    ahead[0, 0], ahead[0, 1], ahead[0, 2] = end
    while top >= 0:
        b, there = right[top], (ahead[top, 0], ahead[top, 1], ahead[top, 2])
        kind = _kind(begin, there, robot_speed, approach, b - a)
        if kind == NO_CONTACT:
            a, begin = b, there
            top -= 1
        elif a == 0.0 and begin[kind - 1] <= 0.0:
            return kind, a, begin
        elif b - a <= FINEST_STEP:
            return kind, b, there
        else:
            top += 1
            right[top] = 0.5 * (a + b)
            _place_at(arm, people, motion, right[top], robot, geometry)
            ahead[top, 0], ahead[top, 1], ahead[top, 2] = clearances(
                arm, people, robot, geometry
            )
    return NO_CONTACT, arm.dt, end


@kernel()
def _place_at(
    arm: Arm,
    people: People,
    motion: PeriodMotion,
    x: float,
    robot: RobotPose,
    geometry: PeopleGeometry,
) -> None:
    """Place robot and people at time ``x`` of the period [s]."""
    q, part = geometry.robot_q, x / arm.dt
    q0, qd0, c, d = motion.path
    human_q1, cylinders1 = motion.human_q1, motion.cylinders1
    for j in range(6):
        q[j] = q0[j] + x * (qd0[j] + x * (c[j] + x * d[j]))
    place_robot(arm, q, robot)
    for w in range(human_q1.shape[0]):
        for j in range(18):
            geometry.q[w, j] = geometry.q0[w, j] + part * (human_q1[w, j] - geometry.q0[w, j])
        rise = geometry.pelvis_z[1, w] - geometry.pelvis_z[0, w]
        geometry.size[w, PELVIS_Z] = geometry.pelvis_z[0, w] + part * rise
    place_workers(people, geometry.q, geometry)
    for k in range(cylinders1.shape[0]):
        for i in range(3):
            start = geometry.cylinders0[k, i]
            geometry.cylinders[k, i] = start + part * (cylinders1[k, i] - start)
