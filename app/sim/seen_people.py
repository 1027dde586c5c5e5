"""Which of several people a policy for one sees, and how a cylinder is seen as a person.

The same rules as in the batches (``kernels/people.py``, ``nearest_person`` and
``see_nearest``): the person nearest to the robot is seen, by the distance of their capsules to
the robot's, or of their cylinder where no more is known of them; a cylinder is seen as a person
of the cell's size who stands in it and faces the robot's base.
"""

import math
from collections.abc import Sequence

import numpy as np

from app.errors import InvalidInput
from app.sim import human
from app.sim.kernels import arm as arm_kernel
from app.sim.kernels import people as people_kernel
from app.sim.kernels.arm import Arm
from app.sim.kernels.body import N_SIZE, PELVIS_Z
from app.sim.kernels.occupancy import N_PAST
from app.sim.kernels.people import MAX_PEOPLE, People
from app.sim.person_estimate import PersonEstimate
from app.sim.ports import Person, Vec
from app.sim.scene import crowd_of, own

_Q_LOW, _Q_HIGH = human.Q_MIN - 1e-6, human.Q_MAX + 1e-6
_QD_LIMIT = np.full(18, 50.0)
_SIZE_LOW, _SIZE_HIGH = np.full(N_SIZE, 0.01), np.full(N_SIZE, 3.0)
_SIZE_LOW[PELVIS_Z] = -10.0  # counted from the cell's origin
_CYLINDER_LOW = np.array([human.Q_MIN[0], human.Q_MIN[1], 0.01])
WIDEST = 5.0
"""Greatest radius of a cylinder [m]."""
FASTEST_GROWTH = 5.0
"""Greatest speed at which the radius of a cylinder changes [m/s]."""
FASTEST_WALK = 10.0
"""Greatest walking speed that is remembered of a cylinder [m/s]."""
MOST_REMEMBERED = N_PAST - 1
"""Most moments that are remembered of a cylinder, a tenth of a second apart."""
_CYLINDER_HIGH = np.array([human.Q_MAX[0], human.Q_MAX[1], WIDEST])
_PAST_HIGH = np.array([WIDEST, FASTEST_WALK])
_JOINED_LOW = np.concatenate((_Q_LOW, -_QD_LIMIT, _CYLINDER_LOW))
_JOINED_HIGH = np.concatenate((_Q_HIGH, _QD_LIMIT, _CYLINDER_HIGH))


def standing_in(
    x: float,
    y: float,
    vx: float,
    vy: float,
    r: float,
    growth: float = 0.0,
    past: Vec | None = None,
    measured: bool = True,
) -> Person:
    """Return the person that a cylinder is seen as.

    Args:
        x: Axis of the cylinder, robot's base frame [m].
        y: The same.
        vx: Its velocity [m/s].
        vy: The same.
        r: Its radius [m].
        growth: How fast the radius grows [m/s].
        past: Radius [m] and walking speed [m/s] before, as in ``Person.past``.
        measured: Whether a safety layer may go by the velocity.
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


def as_person(estimate: PersonEstimate) -> Person | None:
    """Return the person that an estimate is seen as; None where nobody was ever seen.

    Where pelvis and trunk were never seen together there are no joint angles; then the person
    is as good as their safety cylinder.
    """
    cylinder = estimate.cylinder
    if estimate.person is not None or cylinder is None:
        return estimate.person
    x, y = np.clip(cylinder.center, human.Q_MIN[:2], human.Q_MAX[:2]).tolist()
    vx, vy = cylinder.velocity.tolist()
    return standing_in(x, y, vx, vy, min(cylinder.radius, WIDEST), measured=False)


def checked_people(people: Sequence[Person]) -> tuple[Person, ...]:
    """Return the people with checked arrays.

    Raises:
        InvalidInput: More than four, or a number that no person can have.
    """
    if len(people) > MAX_PEOPLE:
        raise InvalidInput("people", len(people), f"must hold at most {MAX_PEOPLE} people")
    return tuple(_checked(person, f"people[{i}]") for i, person in enumerate(people))


def _checked(person: Person, path: str) -> Person:
    if _right_as_it_is(person):
        return person
    size, cylinder = person.size, person.cylinder
    if size is not None:
        size = checked_vector(f"{path}.size", size, N_SIZE, _SIZE_LOW, _SIZE_HIGH, "m")
    if cylinder is not None:
        low, high = _CYLINDER_LOW, _CYLINDER_HIGH
        cylinder = checked_vector(f"{path}.cylinder", cylinder, 3, low, high, "m")
    if not abs(person.growth) <= FASTEST_GROWTH:
        rule = f"must lie in [-{FASTEST_GROWTH:g}, {FASTEST_GROWTH:g}] m/s"
        raise InvalidInput(f"{path}.growth", person.growth, rule)
    past = None if person.past is None else _checked_past(f"{path}.past", person.past)
    return Person(
        q=checked_vector(f"{path}.q", person.q, 18, _Q_LOW, _Q_HIGH, "m or rad"),
        qd=checked_vector(f"{path}.qd", person.qd, 18, -_QD_LIMIT, _QD_LIMIT, "m/s or rad/s"),
        size=size,
        cylinder=cylinder,
        growth=person.growth,
        past=past,
        measured=person.measured,
    )


def _right_as_it_is(person: Person) -> bool:
    """Tell in one comparison whether nothing is wrong with a person of ordinary arrays."""
    if person.size is not None or person.past is not None:
        return False
    parts: tuple[Vec, ...] = (person.q, person.qd)
    if person.cylinder is not None:
        parts = (person.q, person.qd, person.cylinder)
    for part, n in zip(parts, (18, 18, 3), strict=False):
        if type(part) is not np.ndarray or part.dtype != np.float64 or part.shape != (n,):
            return False
    values = np.concatenate(parts)
    low, high = _JOINED_LOW[: len(values)], _JOINED_HIGH[: len(values)]
    inside = (low <= values) & (values <= high)
    return bool(inside.all()) and abs(person.growth) <= FASTEST_GROWTH


def _checked_past(path: str, past: Vec) -> Vec:
    known = np.asarray(past, dtype=np.float64)
    if known.ndim != 2 or known.shape[1] != 2 or len(known) > MOST_REMEMBERED:
        rule = f"must hold a radius and a speed of at most {MOST_REMEMBERED} moments"
        raise InvalidInput(path, list(known.shape), rule)
    right = (known >= 0.0) & (known <= _PAST_HIGH)
    if not right.all():
        moment, what = (int(i) for i in np.argwhere(~right)[0])
        most, unit = ((WIDEST, "m"), (FASTEST_WALK, "m/s"))[what]
        rule = f"must lie in [0, {most:g}] {unit}"
        raise InvalidInput(f"{path}[{moment}][{what}]", float(known[moment, what]), rule)
    return known


def nearest_index(arm: Arm, shared: People, q: Vec, people: Sequence[Person]) -> int | None:
    """Return which person is nearest to the robot; None for nobody.

    Args:
        arm: Robot in its cell.
        shared: From :func:`~app.sim.scene.people_of`.
        q: The robot's joint positions [rad], shape (6,).
        people: At most four.
    """
    if len(people) < 2:
        return len(people) - 1 if people else None
    workers = [i for i, person in enumerate(people) if person.cylinder is None]
    walkers = [i for i, person in enumerate(people) if person.cylinder is not None]
    sizes = [shared.bodies[0] if (s := people[i].size) is None else s for i in workers]
    crowd = crowd_of(
        shared,
        np.array([people[i].q for i in workers]).reshape(-1, 18),
        np.array([people[i].cylinder for i in walkers], dtype=np.float64).reshape(-1, 3),
        np.array(sizes).reshape(-1, N_SIZE),
    )
    robot = arm_kernel.new_robot_pose(arm)
    arm_kernel.place_robot(arm, own(q), robot)
    return (workers + walkers)[people_kernel.nearest_person(shared, robot.columns, crowd)]


def checked_vector(path: str, values: Vec, size: int, low: Vec, high: Vec, unit: str) -> Vec:
    """Return numbers as an array once they keep their rules.

    Args:
        path: Name of the field, for the error.
        values: Numbers.
        size: How many there must be.
        low: Least of each, shape (size,).
        high: Greatest of each, shape (size,).
        unit: Unit, for the error.

    Raises:
        InvalidInput: Another number of them, not finite, or outside the limits.
    """
    vector = np.asarray(values, dtype=np.float64)
    if vector.shape != (size,):
        raise InvalidInput(path, vector.tolist(), f"must hold {size} numbers")
    inside = (low <= vector) & (vector <= high)
    if inside.all():
        return vector
    for i in np.flatnonzero(~inside)[:1]:
        field, value = f"{path}[{i}]", float(vector[i])
        if not math.isfinite(value):
            raise InvalidInput(field, value, "must be finite")
        rule = f"must lie in [{low[i]:.4g}, {high[i]:.4g}] {unit}"
        raise InvalidInput(field, value, rule)
    return vector
