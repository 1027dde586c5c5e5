"""Kernel data of a work cell: robot and people.

The kernels take plain tuples of arrays (``robot/kernels/arm.py``,
``people/kernels/people.py``); this file makes them from a :class:`~app.sim.cells.cell.Cell`.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from app.errors import InvalidInput, SimulationError
from app.sim.cells.cell import Cell
from app.sim.cells.people import (
    ConstantWalker,
    CylinderPerson,
    FixedSpeedWalker,
    Walker,
    Worker,
)
from app.sim.core.arrays import Vec, as_kernel_array, as_kernel_index
from app.sim.geometry.capsules import new_capsules
from app.sim.human import model as human
from app.sim.human.kernels import kinematics as body
from app.sim.people.human_motion_config import NO_TRACKS, HumanMotionConfig, with_human_motion
from app.sim.people.kernels import people, speeds
from app.sim.people.kernels.people import MAX_PEOPLE, People, PeopleState
from app.sim.people.pedestrian import PedestrianSettings, pedestrian_rules, pedestrian_state
from app.sim.primitives.kernels import script
from app.sim.primitives.kernels.primitives import empty_primitive_library, new_segment_state
from app.sim.robot.capsules import levers, load_robot_capsules, self_pairs
from app.sim.robot.kernels.arm import Arm
from app.sim.robot.kernels.joints import JointLimits
from app.sim.robot.ur10 import Robot

HumanKind = Literal["worker", "walker", "constant", "fixed-speed"]
HUMAN_KINDS: tuple[HumanKind, ...] = ("worker", "walker", "constant", "fixed-speed")
"""An 18-DoF person at work; a cylinder that walks (docs/method.md 2.1), with speed and radius
that vary, that are constant per episode, or with a given speed."""
NO_CYLINDERS = np.zeros((0, 3))
"""Cylinders of a cell without walkers."""
STANDING_TOP = 2.0
"""Height above the floor of the cylinders of people whose height the cell does not state; reach
policies observe workers as such cylinders [m]."""
FAR_AWAY = (0.0, 4.0, -np.pi / 2.0)
"""Pelvis of the person assumed in an empty cell, out of reach [m, rad]."""


def require_finite(name: str, values: NDArray[np.floating]) -> None:
    """Raise SimulationError for NaN and infinity, which contact tests do not detect."""
    if not np.isfinite(values).all():
        raise SimulationError(f"{name} = {values.tolist()} must be finite")


def require_shape(name: str, values: NDArray[Any], shape: tuple[int, ...]) -> None:
    """Raise InvalidInput for an array of another shape: kernels would read beyond its end."""
    if values.shape != shape:
        raise InvalidInput(name, values.shape, f"must have the shape {shape}")


def env_numbers(envs: NDArray[Any], n_envs: int) -> NDArray[np.int64]:
    """Return the numbers of environments as kernels take them, shape (k,).

    Raises:
        InvalidInput: They are no numbers, as a mask is none, or an environment does not exist.
    """
    given = np.asarray(envs)
    if given.ndim != 1 or (given.size and given.dtype.kind not in "iu"):
        found = f"{given.dtype} of shape {given.shape}"
        raise InvalidInput("envs", found, "must be numbers of environments, shape (k,)")
    wrong = given[(given < 0) | (given >= n_envs)]
    if wrong.size:
        raise InvalidInput("envs", int(wrong[0]), f"must be one of {n_envs} environments")
    return as_kernel_index(given.astype(np.int64))


def check_people(kinds: Sequence[str]) -> None:
    """Check a list of people.

    Raises:
        InvalidInput: An unknown kind, or more people than a cell holds.
    """
    for kind in kinds:
        if kind not in HUMAN_KINDS:
            raise InvalidInput("people", kind, "must be a kind of person", HUMAN_KINDS)
    if len(kinds) > MAX_PEOPLE:
        raise InvalidInput("people", list(kinds), f"must be at most {MAX_PEOPLE}")


def kinds_of(cell: Cell) -> tuple[HumanKind, ...]:
    """Return the kinds of a cell's people, workers first, as the kernels number them."""
    return tuple(person.kind for person in (*cell.workers, *cell.cylinders))


def with_people(cell: Cell, kinds: Sequence[HumanKind]) -> Cell:
    """Return a cell with other people in it.

    People that the cell describes are reused, in order and as often as requested; other kinds
    walk in the area of the cell's people, with the constants of docs/method.md 2.1.

    Raises:
        InvalidInput: An unknown kind, too many people, or a worker where the cell has none.
    """
    check_people(kinds)
    found = {kind: [p for p in cell.people if p.kind == kind] for kind in HUMAN_KINDS}
    people: list[Worker | CylinderPerson] = []
    for kind in kinds:
        known = found[kind]
        if not known and kind == "worker":
            raise InvalidInput(
                "people", kind, f"must be described in the cell {cell.name}: it has no worker"
            )
        if known:
            people.append(known[sum(p.kind == kind for p in people) % len(known)])
        else:
            people.append(_cylinder_of(cell, kind))
    return cell.model_copy(update={"people": tuple(people)})


def _cylinder_of(cell: Cell, kind: HumanKind) -> CylinderPerson:
    """Return a cylinder as tall as those of the cell, in the area of its first person."""
    where = cell.people[0] if cell.people else PedestrianSettings()
    area = {name: getattr(where, name) for name in ("x_min", "x_max", "y_min", "y_max")}
    if cell.cylinders:
        area["height"] = max(one.height for one in cell.cylinders)
    if kind == "walker":
        return Walker(kind=kind, **area)
    if kind == "constant":
        return ConstantWalker(kind=kind, **area)
    return FixedSpeedWalker(kind="fixed-speed", speed=0.5, **area)


_WALKER_FIELDS = {
    "speed_min": "v_min",
    "speed_max": "v_max",
    "radius_min": "r_min",
    "radius_max": "r_max",
    "speed_frequency_max": "f_speed_max",
    "radius_frequency_max": "f_radius_max",
    "target_tolerance": "tolerance",
    "speed": "fixed_speed",
}


def pedestrian_settings(person: CylinderPerson) -> PedestrianSettings:
    """Return the motion settings of a cell's cylinder."""
    values = person.model_dump(exclude={"height"})
    return PedestrianSettings(
        **{_WALKER_FIELDS.get(name, name): v for name, v in values.items()}
    )


@lru_cache(maxsize=8)
def arm_of(cell: Cell) -> Arm:
    """Return the kernel data of a cell's robot."""
    mount = cell.robot
    capsules = load_robot_capsules(mount.tool_length, mount.tool_radius)
    pairs, span = self_pairs(capsules), capsules.p1 - capsules.p0
    return Arm(
        limits=JointLimits(
            q_min=np.array(mount.q_min),
            q_max=np.array(mount.q_max),
            qd_max=np.array(mount.qd_max),
            qdd_max=np.array(mount.qdd_max),
            jerk_max=np.array(mount.jerk_max),
        ),
        home=np.array(mount.home_q),
        dt=mount.dt,
        lengths=Robot(mount.tool_length).lengths(),
        link=as_kernel_index(capsules.link),
        p0=as_kernel_array(capsules.p0),
        span=as_kernel_array(span),
        capsules=new_capsules(len(capsules.link), capsules.radius, (span**2).sum(axis=1)),
        first=as_kernel_index(pairs[:, 0]),
        second=as_kernel_index(pairs[:, 1]),
        lever=levers(mount.tool_length, mount.tool_radius),
        boxes=boxes_of(cell),
    )


def boxes_of(cell: Cell) -> Vec:
    """Return a cell's fixed obstacles: centre, half sizes [m], yaw [rad], shape (n, 7)."""
    rows = [(*box.center, *box.half_size, box.yaw) for box in cell.obstacles]
    return np.array(rows, dtype=np.float64).reshape(-1, 7)


def people_of(cell: Cell, work: HumanMotionConfig | None = None) -> People:
    """Return the kernel data of a cell's people.

    Args:
        cell: Work cell with 0 to 4 people.
        work: Motion of the workers; None: they stand where they are placed.

    Raises:
        InvalidInput: The cell has more people than the kernels hold.
    """
    check_people(kinds_of(cell))
    workers = len(cell.workers)
    heights = [STANDING_TOP] * bool(workers) + [one.height for one in cell.cylinders]
    shared = People(
        bodies=as_kernel_array(cell.body[None]),
        floor_z=cell.floor_z,
        top_z=cell.floor_z + max(heights, default=STANDING_TOP),
        capsules=body.new_body_capsules(workers),
        postures=np.zeros((1, 18)),
        hands=np.zeros((1, 2, 3)),
        of_station=np.zeros((1, 1, 2, 2), dtype=np.int64),
        n_cubes=0,
        source=people.REACHES,
        track_share=0.0,
        absent_share=0.0,
        rest_share=0.0,
        primitive_library=empty_primitive_library(),
        tracks=NO_TRACKS,
        limits=np.stack([human.Q_MIN, human.Q_MAX]),
        yielding=0.0,
        pace=1.0,
        pace_max=1.0,
        walkers=pedestrian_rules([pedestrian_settings(person) for person in cell.cylinders]),
        no_person=human.rest_posture(*FAR_AWAY),
    )
    return with_human_motion(shared, cell, work) if workers and work is not None else shared


def new_people_state(cell: Cell, shared: People, n_envs: int) -> PeopleState:
    """Return rows for the people of ``n_envs`` cells, not started yet."""
    workers, walkers = len(cell.workers), len(cell.cylinders)

    def rows(*shape: int) -> Vec:
        return np.zeros((n_envs, *shape))

    def counts(*shape: int) -> NDArray[np.int64]:
        return np.zeros((n_envs, *shape), dtype=np.int64)

    return PeopleState(
        q=rows(workers, 18),
        qd=rows(workers, 18),
        body=counts(workers),
        size=np.broadcast_to(shared.bodies[0], (n_envs, workers, body.N_SIZE)).copy(),
        capsules=np.repeat(shared.capsules[None], n_envs, axis=0),
        clock=rows(workers),
        pace=rows(workers) + shared.pace,
        rest=rows(workers, 2),
        near=rows(workers),
        lean=rows(workers, 4),
        track=counts(workers) + people.SCRIPTED,
        segments=new_segment_state(n_envs, workers),
        move=counts(workers),
        n_moves=counts(workers),
        start=rows(workers, script.MAX_MOVES),
        duration=rows(workers, script.MAX_MOVES),
        chosen=counts(workers, script.MAX_MOVES + 1),
        walkers=pedestrian_state(n_envs, walkers),
        cylinders=rows(walkers, 3),
    )


def people_geometry_of(
    shared: People, human_q: Vec, cylinders: Vec, sizes: Vec | None = None
) -> people.PeopleGeometry:
    """Return people placed as shapes.

    Args:
        shared: From :func:`people_of`.
        human_q: The workers' joints [m, rad], shape (W, 18).
        cylinders: The walkers' x, y and radius [m], shape (C, 3).
        sizes: The workers' sizes [m], shape (W, body.N_SIZE); None for the cell's person.
    """
    if len(human_q) * body.N_CAPSULES > shared.capsules.shape[1]:  # more than the cell's own
        shared = shared._replace(capsules=body.new_body_capsules(len(human_q)))
    geometry = people.new_people_geometry(shared, len(human_q), len(cylinders))
    if sizes is not None:
        geometry.size[:] = sizes
    people.place_workers(shared, as_kernel_array(human_q), geometry)
    geometry.cylinders[:] = cylinders
    return geometry


def capsule_speeds_of(
    shared: People, placed: people.PeopleGeometry, human_q: Vec, human_qd: Vec
) -> Vec:
    """Return the speed of each capsule of placed workers [m/s], shape (n,).

    Args:
        shared: From :func:`people_of`.
        placed: The workers, placed at ``human_q``.
        human_q: Their joint positions [m, rad], shape (W, 18).
        human_qd: Their joint speeds [m/s, rad/s], shape (W, 18).
    """
    capsules, out = placed.capsules, np.zeros(placed.capsules.shape[1])
    if len(human_q) == 0:
        return out
    moved = people.new_people_geometry(shared._replace(capsules=capsules), len(human_q), 0)
    moved.size[:] = placed.size
    q, qd = as_kernel_array(human_q), as_kernel_array(human_qd)
    speeds.capsule_speeds(shared, q, qd, capsules, moved, out)
    return out
