"""People of a cell with one of them in other postures, as task selection observes them."""

import numpy as np

from app.errors import InvalidInput
from app.sim.core.arrays import Vec, as_kernel_array
from app.sim.core.jit import kernel
from app.sim.geometry.capsules import capsule_clearances
from app.sim.human import model as human
from app.sim.human.kernels.kinematics import N_SIZE
from app.sim.human.person import Person
from app.sim.people.kernels.people import (
    People,
    PeopleGeometry,
    person_clearance,
    place_workers,
)
from app.sim.perception.observed_people import (
    as_known,
    is_far,
    nearest_index,
    with_known_yaw,
)
from app.sim.pick.task_policy import MovedPerson
from app.sim.robot.kernels.arm import Arm, new_robot_pose, place_robot
from app.sim.scene.scene import people_geometry_of


def scenes_of(
    arm: Arm, shared: People, q: Vec, people: tuple[Person, ...], moved: MovedPerson
) -> tuple[tuple[Vec, Vec, Vec], Vec]:
    """Return the observed people beside each posture, the nearest to the robot first.

    Args:
        shared: From :func:`~app.sim.scene.scene.people_of`.
        q: The robot's joint positions [rad], shape (6,).
        people: Checked people.
        moved: One of them, in m postures.

    Returns:
        Joint positions [m, rad] and speeds [m/s, rad/s], shape (m, P, 18) each, and body
        dimensions [m], shape (m, P, N_SIZE); then the distance of the robot to the nearest
        person [m], shape (m,).

    Raises:
        InvalidInput: There is no such person, or a posture is no person's.
    """
    who, n = moved.index, len(people)
    if not 0 <= who < n:
        rule = f"must be less than {n}, the number of people"
        raise InvalidInput("grid.person", who, rule)
    postures = with_known_yaw(as_kernel_array(moved.q))
    if postures.ndim != 2 or postures.shape[1:] != (18,) or not np.isfinite(postures).all():
        raise InvalidInput("moved.q", postures.shape, "must be finite, of shape (m, 18)")
    present = [i for i in range(n) if i == who or not is_far(people[i])]
    others, m = [i for i in present if i != who], len(postures)
    order = np.tile([who, *others], (m, 1))
    clearance = _clearances(arm, shared, q, people[who], postures)
    if others:
        place = nearest_index(arm, shared, q, [people[i] for i in others])
        first = others[place or 0]
        near = people[first]
        gap = _clearances(arm, shared, q, near, as_kernel_array(near.q)[None])
        order[clearance > gap] = [first, *(i for i in present if i != first)]
        clearance = np.minimum(clearance, gap)
    known = [as_known(person) for person in people]
    sizes = np.stack([shared.bodies[0] if p.size is None else p.size for p in known])
    joints = np.tile(np.stack([person.q for person in known]), (m, 1, 1))
    joints[:, who] = postures.clip(human.Q_MIN, human.Q_MAX)
    speeds = np.stack([person.qd for person in known])
    scenes = joints[np.arange(m)[:, None], order], speeds[order], sizes[order]
    return scenes, clearance


def _clearances(arm: Arm, shared: People, q: Vec, person: Person, postures: Vec) -> Vec:
    """Return the distance of robot and person in each posture [m], shape (m,)."""
    robot = new_robot_pose(arm)
    place_robot(arm, as_kernel_array(q), robot)
    body = person.cylinder is None
    size = shared.bodies[0] if person.size is None else person.size
    geometry = people_geometry_of(
        shared,
        postures[:1] if body else np.zeros((0, 18)),
        np.zeros((0, 3)) if person.cylinder is None else person.cylinder[None],
        size[None] if body else np.zeros((0, N_SIZE)),
    )
    found = np.empty(len(postures))
    _measure(shared, robot.capsules, geometry, postures, found)
    return found


@kernel(nogil=True)
def _measure(
    shared: People, robot: Vec, geometry: PeopleGeometry, postures: Vec, out: Vec
) -> None:
    """Write the distance of the robot's capsules to the only person in each posture."""
    for i in range(postures.shape[0]):
        if geometry.q.shape[0] > 0:
            place_workers(shared, postures[i : i + 1], geometry)
            capsule_clearances(robot, geometry.capsules, geometry.clearance)
        else:
            geometry.cylinders[0, 0] = postures[i, 0]
            geometry.cylinders[0, 1] = postures[i, 1]
        out[i] = person_clearance(shared, robot, geometry, 0)
