"""Validation of people received from outside, and their form as policy observations.

The rules are those of the batches (``people/kernels/people.py``): the observed person is the
one nearest to the robot, by the distance of capsules, or of the cylinder for a person known
only as a cylinder. A cylinder is observed as a person of the cell's size standing in it and
facing the robot's base.

Any physically possible person is accepted: anywhere in a hall, with any yaw, with joints
somewhat beyond the model's limits. Distances and safety layers use these values. Policies were
trained on people within 5 m and within the model's limits, so that observations are clipped
(:func:`as_known`) and answers say so (:func:`degradations`).
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from app.errors import InvalidInput, digits, interval
from app.sim.collision.checker import Shapes
from app.sim.core.arrays import Vec, as_kernel_array
from app.sim.core.kernels.bounds import are_inside
from app.sim.human import model as human
from app.sim.human.kernels.kinematics import N_SIZE, PELVIS_Z, new_body_capsules
from app.sim.human.person import Person
from app.sim.people.kernels import people as people_kernel
from app.sim.people.kernels.pedestrian import N_PAST
from app.sim.people.kernels.people import MAX_PEOPLE, People, PeopleGeometry
from app.sim.perception.bounding_cylinder import ABOVE_ROBOT
from app.sim.perception.keypoints import FARTHEST_M
from app.sim.perception.person_estimator import PersonEstimate
from app.sim.robot.kernels import arm as arm_kernel
from app.sim.robot.kernels.arm import Arm
from app.sim.scene.scene import capsule_speeds_of, people_geometry_of

FASTEST = 50.0
"""Largest speed of joints, cylinder axis or radius [m/s, rad/s]."""
JOINT_TOLERANCE = 0.5
"""Largest excess of joint angles over the model's limits [rad]."""
WIDEST = 3.0 * FARTHEST_M
"""Largest radius of a cylinder [m], which covers the whole hall."""
KNOWN_RADIUS, KNOWN_GROWTH, KNOWN_WALK = 5.0, 5.0, 10.0
"""Largest radius [m], growth [m/s] and past walking speed [m/s] in observations."""
MOST_WRIST_MISFIT = 0.1
"""Largest distance of a monitored wrist from where it was observed [m]."""
_YAW, _MOST_YAW = 2, 1e6
_SLACK = 1e-6
_QD_LIMIT = np.full(18, FASTEST)
_Q_LOW, _Q_HIGH = human.Q_MIN - JOINT_TOLERANCE, human.Q_MAX + JOINT_TOLERANCE
_Q_LOW[:2], _Q_HIGH[:2] = -FARTHEST_M, FARTHEST_M
_Q_LOW[_YAW], _Q_HIGH[_YAW] = -_MOST_YAW, _MOST_YAW
_SIZE_LOW, _SIZE_HIGH = np.full(N_SIZE, 0.01), np.full(N_SIZE, 3.0)
_SIZE_LOW[PELVIS_Z] = -10.0  # height over the cell's origin
MOST_REMEMBERED = N_PAST - 1
"""Largest number of past samples of a cylinder, 0.1 s apart."""
_CYLINDER_LOW = np.array([-FARTHEST_M, -FARTHEST_M, 0.01])
_CYLINDER_HIGH = np.array([FARTHEST_M, FARTHEST_M, WIDEST])
_PAST_HIGH = np.array([WIDEST, FASTEST])
_KNOWN_LOW = np.concatenate((human.Q_MIN, -_QD_LIMIT, [*human.Q_MIN[:2], 0.01])) - _SLACK
_KNOWN_HIGH = np.concatenate((human.Q_MAX, _QD_LIMIT, [*human.Q_MAX[:2], KNOWN_RADIUS]))
_KNOWN_HIGH += _SLACK
_KNOWN_LOW[_YAW], _KNOWN_HIGH[_YAW] = -_MOST_YAW, _MOST_YAW
_KNOWN_BODY = _KNOWN_LOW[:36], _KNOWN_HIGH[:36]
"""Bounds of a person with joint angles."""
_FLOATS = np.dtype(np.float64)
_FACING = -0.5 * math.pi
"""Yaw of a person beyond the table who faces the robot [rad]. A yaw is taken within half a turn
of it, as policies know it from their training."""
_KNOWN_PAST = np.array([KNOWN_RADIUS, KNOWN_WALK])


def person_from_cylinder(
    x: float,
    y: float,
    vx: float,
    vy: float,
    r: float,
    growth: float = 0.0,
    past: Vec | None = None,
    measured: bool = True,
) -> Person:
    """Return the person by which a cylinder is observed.

    Args:
        x: Position of the axis in the robot's base frame [m].
        y: Position of the axis [m].
        vx: Velocity of the axis [m/s].
        vy: Velocity of the axis [m/s].
        r: Radius [m].
        growth: Rate of change of the radius [m/s].
        past: Past radii [m] and walking speeds [m/s], see ``Person.past``.
        measured: Whether a safety layer may use the velocity.
    """
    qd = np.zeros(18)
    qd[:2] = vx, vy
    return Person(
        q=human.rest_posture(x, y, math.atan2(-y, -x)),
        qd=qd,
        cylinder=np.array([x, y, r]),
        growth=growth,
        past=past,
        measured=measured,
    )


def person_from_estimate(estimate: PersonEstimate) -> Person | None:
    """Return the person of an estimate; None if no person was ever seen.

    Without joint angles (pelvis and trunk never seen together) it is the safety cylinder.
    """
    if estimate.person is None:
        return _in_cylinder(estimate)
    # Long extrapolation must not make the request invalid.
    person = estimate.person
    q, qd = np.clip(person.q, _Q_LOW, _Q_HIGH), np.clip(person.qd, -FASTEST, FASTEST)
    return replace(person, q=q, qd=qd)


def as_monitored(observed: PersonEstimate) -> Person | None:
    """Return the person that a safety layer monitors; None without one.

    An unseen joint may have any angle, and a hand may be where no joint angles within the
    model's limits place it: the person is then the safety cylinder, which covers both.

    Args:
        observed: Estimate at the last frame that showed the person.
    """
    placed = not observed.held and observed.wrist_misfit_m <= MOST_WRIST_MISFIT
    return person_from_estimate(observed) if placed else _in_cylinder(observed)


def _in_cylinder(estimate: PersonEstimate) -> Person | None:
    """Return a person standing in the safety cylinder of an estimate; None without one."""
    cylinder = estimate.cylinder
    if cylinder is None:
        return None
    x, y = np.clip(cylinder.center, -FARTHEST_M, FARTHEST_M).tolist()
    vx, vy = np.clip(cylinder.velocity, -FASTEST, FASTEST).tolist()
    person = person_from_cylinder(x, y, vx, vy, min(cylinder.radius, WIDEST), measured=False)
    return replace(person, top=cylinder.top)


def person_anywhere() -> Person:
    """Return the unknown person of a safety layer, which makes the robot stop."""
    unknown = person_from_cylinder(0.0, 0.0, 0.0, 0.0, WIDEST, measured=False)
    return replace(unknown, top=ABOVE_ROBOT)


def degradations(person: Person) -> tuple[str, ...]:
    """Return the differences of an observation from the given person: ``far``, ``clamped``."""
    if is_plain(person):
        return ()
    near = _brought_near(person)
    far = ("far",) if near is not person else ()
    return far if _is_known(near) else (*far, "clamped")


def is_far(person: Person) -> bool:
    """Return whether a person is beyond the distance known to policies."""
    return _brought_near(person) is not person


def as_known(person: Person) -> Person:
    """Return a person as observed by policies; the same object if nothing is clipped.

    A person beyond 5 m along x or y is observed at that distance in the same direction.
    """
    if _is_known(person):
        return person
    near = _brought_near(person)
    cylinder, past = near.cylinder, near.past
    if cylinder is not None:
        cylinder = np.array([*cylinder[:2], min(cylinder[2], KNOWN_RADIUS)])
    return replace(
        near,
        q=np.clip(near.q, human.Q_MIN, human.Q_MAX),
        cylinder=cylinder,
        growth=min(KNOWN_GROWTH, max(-KNOWN_GROWTH, near.growth)),
        past=None if past is None else np.minimum(past, _KNOWN_PAST),
    )


def _brought_near(person: Person) -> Person:
    """Return a person within the known distance; the same object if it is within already."""
    cylinder = person.cylinder
    there = person.q[:2] if cylinder is None else cylinder[:2]
    away, most = max(abs(there.item(0)), abs(there.item(1))), float(human.Q_MAX[0])
    if away <= most + _SLACK:
        return person
    here = most / away * there
    if cylinder is not None:
        cylinder = np.array([*here, cylinder[2]])
    return replace(person, q=np.concatenate([here, person.q[2:]]), cylinder=cylinder)


def _is_known(person: Person) -> bool:
    """Return whether all values are within the range known to policies, except the yaw."""
    if person.cylinder is None:
        inside = are_inside(np.concatenate((person.q, person.qd)), *_KNOWN_BODY)
    else:
        values = np.concatenate((person.q, person.qd, person.cylinder))
        inside = are_inside(values, _KNOWN_LOW, _KNOWN_HIGH)
    if not inside or not abs(person.growth) <= KNOWN_GROWTH:
        return False
    return person.past is None or bool((person.past <= _KNOWN_PAST).all())


def checked_people(people: Sequence[Person]) -> tuple[Person, ...]:
    """Return validated people.

    Raises:
        InvalidInput: More than four people, or a value out of range.
    """
    if len(people) > MAX_PEOPLE:
        raise InvalidInput("people", len(people), f"must hold at most {MAX_PEOPLE} people")
    return tuple(checked_person(person, f"people[{i}]") for i, person in enumerate(people))


def checked_and_known(
    people: Sequence[Person],
) -> tuple[tuple[Person, ...], tuple[Person, ...]]:
    """Return :func:`checked_people`, and the same people as observed by policies."""
    if len(people) <= MAX_PEOPLE and all(map(is_plain, people)):
        same = tuple(people)
        return same, same
    checked = checked_people(people)
    return checked, tuple(map(as_known, checked))


def checked_person(person: Person, path: str) -> Person:
    """Return a validated person.

    Raises:
        InvalidInput: A value out of range.
    """
    if is_plain(person):
        return person
    size, cylinder = person.size, person.cylinder
    if size is not None:
        size = checked_vector(f"{path}.size", size, N_SIZE, _SIZE_LOW, _SIZE_HIGH, "m")
    if cylinder is not None:
        low, high = _CYLINDER_LOW, _CYLINDER_HIGH
        cylinder = checked_vector(f"{path}.cylinder", cylinder, 3, low, high, "m")
    if not abs(person.growth) <= FASTEST:
        rule = f"must lie in [-{digits(FASTEST)}, {digits(FASTEST)}] m/s"
        raise InvalidInput(f"{path}.growth", person.growth, rule)
    past = None if person.past is None else _checked_past(f"{path}.past", person.past)
    q = checked_vector(f"{path}.q", person.q, 18, _Q_LOW, _Q_HIGH, "m or rad")
    return replace(
        person,
        q=with_known_yaw(q),
        qd=checked_vector(f"{path}.qd", person.qd, 18, -_QD_LIMIT, _QD_LIMIT, "m/s or rad/s"),
        size=size,
        cylinder=cylinder,
        past=past,
    )


def is_plain(person: Person) -> bool:
    """Return whether a person is valid and known to policies, by one quick comparison.

    False for a person of another size or with a past, who may be both.
    """
    if person.size is not None or person.past is not None:
        return False
    parts = (person.q, person.qd, person.cylinder)
    for part, shape in zip(parts, ((18,), (18,), (3,)), strict=True):
        if part is None:
            continue
        if type(part) is not np.ndarray or part.dtype is not _FLOATS or part.shape != shape:
            return False
    return _is_known(person) and abs(person.q.item(_YAW) - _FACING) <= math.pi


def with_known_yaw(q: Vec) -> Vec:
    """Return the same postures with the yaw that policies know; the same object if it is.

    Args:
        q: Joint positions [m, rad], shape (..., 18).
    """
    beyond = q[..., _YAW] - _FACING
    if (np.abs(beyond) <= math.pi).all():
        return q
    turned = q.copy()
    turned[..., _YAW] -= 2.0 * math.pi * np.rint(beyond / (2.0 * math.pi))
    return turned


def _checked_past(path: str, past: Vec) -> Vec:
    known = np.asarray(past, dtype=np.float64)
    if known.ndim != 2 or known.shape[1] != 2 or len(known) > MOST_REMEMBERED:
        rule = f"must hold a radius and a speed of at most {MOST_REMEMBERED} moments"
        raise InvalidInput(path, list(known.shape), rule)
    right = (known >= 0.0) & (known <= _PAST_HIGH)
    if not right.all():
        moment, what = (int(i) for i in np.argwhere(~right)[0])
        most, unit = ((WIDEST, "m"), (FASTEST, "m/s"))[what]
        rule = f"must lie in [0, {digits(most)}] {unit}"
        raise InvalidInput(f"{path}[{moment}][{what}]", float(known[moment, what]), rule)
    return known


def nearest_index(arm: Arm, shared: People, q: Vec, people: Sequence[Person]) -> int | None:
    """Return the index of the person nearest to the robot; None without people.

    Args:
        shared: From :func:`~app.sim.scene.scene.people_of`.
        q: The robot's joint positions [rad], shape (6,).
        people: People, any number.
    """
    if len(people) < 2:
        return len(people) - 1 if people else None
    order = bodies_first(people)
    geometry = _placed(shared, [people[i] for i in order])
    robot = arm_kernel.new_robot_pose(arm)
    arm_kernel.place_robot(arm, as_kernel_array(q), robot)
    return order[people_kernel.nearest_person(shared, robot.capsules, geometry)]


def bodies_first(people: Sequence[Person]) -> list[int]:
    """Return the indices of people with joint angles, then of cylinders."""
    return sorted(range(len(people)), key=lambda i: people[i].cylinder is not None)


def people_shapes(shared: People, people: Sequence[Person]) -> Shapes:
    """Return people as shapes, for a safety layer.

    Args:
        shared: From :func:`~app.sim.scene.scene.people_of`.
        people: Checked people, any number; those with joint angles first, then cylinders.
    """
    geometry = _placed(shared, people)
    workers = [person for person in people if person.cylinder is None]
    cylinders = [person for person in people if person.cylinder is not None]
    tops = [max(shared.top_z, person.top) for person in cylinders]
    going = [
        (*person.qd[:2], person.growth) if person.measured else (math.nan,) * 3
        for person in cylinders
    ]
    observed = [math.hypot(*one.qd[:2]) + abs(one.growth) for one in cylinders]
    return Shapes(
        capsules=geometry.capsules,
        cylinders=np.column_stack([geometry.cylinders, tops]),
        going=np.reshape(going, (-1, 3)),
        cylinder_speed=np.array(observed),
        speed=capsule_speeds_of(
            shared,
            geometry,
            np.reshape([one.q for one in workers], (-1, 18)),
            np.reshape([one.qd for one in workers], (-1, 18)),
        ),
    )


def _placed(shared: People, people: Sequence[Person]) -> PeopleGeometry:
    """Return people placed as shapes; those with joint angles come first."""
    workers = [person for person in people if person.cylinder is None]
    cylinders = [person.cylinder for person in people if person.cylinder is not None]
    sizes = [shared.bodies[0] if one.size is None else one.size for one in workers]
    return people_geometry_of(
        shared._replace(capsules=new_body_capsules(len(workers))),
        np.reshape([one.q for one in workers], (-1, 18)),
        np.reshape(cylinders, (-1, 3)).astype(np.float64),
        np.reshape(sizes, (-1, N_SIZE)),
    )


def checked_vector(path: str, values: Vec, size: int, low: Vec, high: Vec, unit: str) -> Vec:
    """Return values as a validated array.

    Args:
        path: Name of the field in errors.
        size: Required number of values.
        low: Lower bounds, shape (size,).
        high: Upper bounds, shape (size,).
        unit: Unit in errors.

    Raises:
        InvalidInput: Wrong number of values, or a value that is not finite or out of bounds.
    """
    vector = np.asarray(values, dtype=np.float64)
    if vector.shape != (size,):
        raise InvalidInput(path, vector.tolist(), f"must hold {size} numbers")
    inside = (low <= vector) & (vector <= high)
    if not inside.all():
        i = int(np.argmin(inside))
        field, value = f"{path}[{i}]", float(vector[i])
        if not math.isfinite(value):
            raise InvalidInput(field, value, "must be finite")
        rule = f"must lie in {interval(low[i], high[i])} {unit}"
        raise InvalidInput(field, value, rule)
    return vector
