"""Contact and clearance of one state, for live cell, decisions, safety layer and planners.

The same kernels as those of the batches (``kernels/contact.py``), so that reports agree with
training.
"""

from dataclasses import dataclass

import numpy as np

from app.sim.collision.kernels import contact as kernel
from app.sim.core.arrays import Vec, as_kernel_array
from app.sim.geometry.capsules import capsule_clearances, distances
from app.sim.geometry.cylinder import cylinder_clearance
from app.sim.human import model as human
from app.sim.human.kernels.kinematics import N_CAPSULES, PELVIS_Z
from app.sim.people.kernels import people as people_kernel
from app.sim.people.kernels.people import People, PeopleGeometry
from app.sim.robot.capsules import load_robot_capsules
from app.sim.robot.kernels import arm as arm_kernel
from app.sim.robot.kernels.arm import Arm
from app.sim.robot.kernels.joints import JointPath
from app.sim.scene.scene import NO_CYLINDERS, people_geometry_of, require_finite

CONTACT_KINDS = ("none", "human", "cell", "self")


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact:
    """Result of the contact test of one period."""

    kind: str
    """One of CONTACT_KINDS."""
    clearance_m: float
    """Distance of robot and people at the pose of contact, or at the end [m]."""
    time_s: float
    """Time in the period at which it was found; the period without contact [s]."""
    link: str
    """Robot capsule that touches, or is nearest to a person."""
    part: str
    """Touched or nearest part: a capsule of a worker (CAPSULE_NAMES), ``walker``, ``table``,
    ``obstacle``, another capsule of the robot, or ``no-person``."""
    worker: int | None = None
    """The worker whose capsule that is, from 0."""
    walker: int | None = None
    """The walker that is, from 0."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Clearance:
    """Distances of one pose of the robot."""

    people_m: float
    """To the nearest person [m]; 1000 where there is none."""
    cell_m: float
    """To table and obstacles [m]."""
    self_m: float
    """Least distance of links to each other [m]."""


def clearance(
    arm: Arm, people: People, q: Vec, human_q: Vec, cylinders: Vec, sizes: Vec | None = None
) -> Clearance:
    """Return the distances of the robot at ``q``.

    Args:
        q: Joint positions [rad], shape (6,).
        human_q: The workers' joints [m, rad], shape (W, 18).
        cylinders: The walkers' x, y and radius [m], shape (C, 3).
        sizes: The workers' sizes [m], shape (W, body.N_SIZE); None for the cell's person.
    """
    robot = _robot_at(arm, q)
    geometry = people_geometry_of(people, human_q, cylinders, sizes)
    to_people, to_cell, to_self = kernel.clearances(arm, people, robot, geometry)
    return Clearance(people_m=to_people, cell_m=to_cell, self_m=to_self)


def contact(
    arm: Arm,
    people: People,
    path: JointPath,
    human_q: tuple[Vec, Vec],
    cylinders: tuple[Vec, Vec] = (NO_CYLINDERS, NO_CYLINDERS),
    sizes: Vec | tuple[Vec, Vec] | None = None,
) -> Contact:
    """Check one control period for contact, including between its ends.

    Args:
        path: The robot's path in the period.
        human_q: The workers' joints at start and end [m, rad], shape (W, 18) each.
        cylinders: The walkers' x, y, radius at start and end [m], shape (C, 3) each.
        sizes: The workers' sizes [m], shape (W, body.N_SIZE), or those at start and end where
            pelvis or lengths change; None for the cell's person.

    Raises:
        SimulationError: A number is NaN or infinite.
    """
    before, after = sizes if isinstance(sizes, tuple) else (sizes, sizes)
    require_finite("q, qd, c, d", np.concatenate(path))
    require_finite("human_q", np.concatenate(human_q))
    require_finite("cylinders", np.concatenate(cylinders))
    q0, qd0, c, d = path = JointPath(*map(as_kernel_array, path))
    robot = _robot_at(arm, q0)
    geometry = people_geometry_of(people, human_q[0], cylinders[0], before)
    geometry.pelvis_z[:] = geometry.size[:, PELVIS_Z]
    geometry.q0[:], geometry.cylinders0[:] = human_q[0], cylinders[0]
    clear = np.array(kernel.clearances(arm, people, robot, geometry))
    capsules0 = geometry.capsules.copy()
    if after is not None:
        geometry.size[:] = after
    q1 = q0 + arm.dt * (qd0 + arm.dt * (c + arm.dt * d))
    motion = kernel.PeriodMotion(
        path, q1, as_kernel_array(human_q[1]), as_kernel_array(cylinders[1])
    )
    kind, x = kernel.sweep(
        arm, people, motion, robot.capsules.copy(), capsules0, clear, robot, geometry
    )
    link, part, worker, walker = _who(arm, people, kind, robot, geometry)
    return Contact(
        kind=CONTACT_KINDS[kind],
        clearance_m=float(clear[0]),
        time_s=x,
        link=link,
        part=part,
        worker=worker,
        walker=walker,
    )


def worker_distances(arm: Arm, people: People, q: Vec, human_q: Vec, sizes: Vec) -> Vec:
    """Return the distance of the robot at ``q`` to each worker [m], shape (W,).

    Args:
        people: Shared data of W workers.
        q: Joint positions [rad], shape (6,).
        human_q: The workers' joints [m, rad], shape (W, 18).
        sizes: Their sizes [m], shape (W, body.N_SIZE).
    """
    n_workers = len(human_q)
    if n_workers == 0:
        return np.zeros(0)
    robot = _robot_at(arm, q)
    geometry = people_geometry_of(people, human_q, NO_CYLINDERS, sizes)
    capsule_clearances(robot.capsules, geometry.capsules, geometry.clearance)
    parts = geometry.clearance[: n_workers * N_CAPSULES].reshape(n_workers, N_CAPSULES)
    return np.asarray(parts.min(axis=1))


def pedestrian_distances(arm: Arm, people: People, q: Vec, cylinders: Vec) -> Vec:
    """Return the distance of the robot at ``q`` to each walking cylinder [m], shape (C,).

    Args:
        people: Shared data with the height of cylinders.
        q: Joint positions [rad], shape (6,).
        cylinders: x, y and radius of each [m], shape (C, 3).
    """
    capsules, top = _robot_at(arm, q).capsules, people.top_z
    found = [cylinder_clearance(capsules, 0, x, y, r, top)[0] for x, y, r in cylinders]
    return np.array(found)


def _robot_at(arm: Arm, q: Vec) -> arm_kernel.RobotPose:
    robot = arm_kernel.new_robot_pose(arm)
    arm_kernel.place_robot(arm, as_kernel_array(q), robot)
    return robot


def _who(
    arm: Arm, people: People, kind: int, robot: arm_kernel.RobotPose, geometry: PeopleGeometry
) -> tuple[str, str, int | None, int | None]:
    """Return names of the robot capsule and the nearest part, and the worker or walker."""
    names = load_robot_capsules().name
    if kind == kernel.SELF_CONTACT:
        _, pair = arm_kernel.self_clearance(arm, robot)
        return names[arm.first[pair]], names[arm.second[pair]], None, None
    if kind == kernel.CELL_CONTACT:
        _, link, box = arm_kernel.cell_clearance(arm, robot.capsules)
        return names[link], "table" if box < 0 else "obstacle", None, None
    who = people_kernel.nearest_person(people, robot.capsules, geometry)
    if who < 0:
        return names[-1], "no-person", None, None
    if who >= len(geometry.q):
        walker = who - len(geometry.q)
        x, y, r = geometry.cylinders[walker]
        _, link = cylinder_clearance(robot.capsules, 0, x, y, r, people.top_z)
        return names[link], "walker", None, walker
    best, link, part = np.inf, 0, 0
    for k in range(len(names)):
        distances(robot.capsules, k, geometry.capsules, geometry.clearance)
        near = int(np.argmin(geometry.clearance))
        if geometry.clearance[near] < best:
            best, link, part = float(geometry.clearance[near]), k, near
    return names[link], human.CAPSULE_NAMES[part % N_CAPSULES], part // N_CAPSULES, None
