"""Images of one environment: table, robot, people, and targets or blocks."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from app.sim.cells.cell import Cell
from app.sim.cells.colours import (
    ALUMINIUM,
    BLOCKS,
    FAILURES,
    GLOVE,
    JACKET,
    JOINT,
    OBSTACLE,
    ROBOT_PLATE,
    SKIN,
    TABLE_EDGE,
    TABLE_FRAME,
    TABLE_TOP,
    TARGET,
    TOOL,
    TRAY,
    TROUSERS,
    VESTS,
    Rgb,
    blend,
)
from app.sim.cells.parts import Station, TableGeometry
from app.sim.cells.support import support_height
from app.sim.core.arrays import Vec, as_kernel_array
from app.sim.envs.raycast import Image, Point, Raycaster
from app.sim.envs.solids import Box, Capsule, Cylinder, Solid
from app.sim.geometry.capsules import RADIUS, ends_of
from app.sim.human import model as human
from app.sim.human.kernels import kinematics as body
from app.sim.people.kernels.people import PeopleState
from app.sim.robot.capsules import load_robot_capsules
from app.sim.robot.kernels import arm as arm_kernel
from app.sim.scenario.kernels.episode import SUCCESS_DISTANCE
from app.sim.scene.scene import arm_of, people_geometry_of, people_of
from app.sim.sorting.layout import block_height, half_size, is_sorting
from app.sim.sorting.state import NULL, SortingShape, SortingState

WIDTH, HEIGHT = 480, 360
"""Size of the images [px]."""

STATION: Rgb = (150, 164, 182)
UNNAMED: tuple[Rgb, ...] = (*BLOCKS.values(), *VESTS[:2])
"""Colours of towers without a named colour."""
_JOINTS = ("shoulder", "upper_arm_low", "forearm_low", "wrist_1", "wrist_2")
_VEST = (body.C_ABDOMEN, body.C_CHEST)
_PARTS = {
    body.C_PELVIS: TROUSERS,
    body.C_LEG_R: TROUSERS,
    body.C_LEG_L: TROUSERS,
    body.C_HEAD: SKIN,
    body.C_HAND_R: GLOVE,
    body.C_HAND_L: GLOVE,
}
"""Colours of a worker's capsules besides arms and trunk."""


@lru_cache(maxsize=8)
def _raycaster(cell: Cell) -> Raycaster:
    """Return the raycaster of a cell; the camera distance depends on the scenario."""
    if is_sorting(cell):
        position, look_at = (2.05, -1.15, 1.7), (0.0, 0.62, 0.1)
    elif cell.goal_region is not None:
        position, look_at = (2.9, -2.0, 2.2), (-0.2, 0.75, 0.0)
    else:
        position, look_at = (2.4, -1.1, 1.5), (-0.05, 0.6, 0.12)
    return Raycaster(position, look_at, WIDTH, HEIGHT, cell.floor_z, _static_solids(cell))


def picture(cell: Cell, robot_q: Vec, people: Sequence[Solid], task: Sequence[Solid]) -> Image:
    """Return an image of a cell with the robot at joints ``robot_q`` [rad], shape (6,).

    The image is uint8, shape (HEIGHT, WIDTH, 3); ``task`` are targets or blocks.
    """
    empty = cell.model_copy(update={"people": ()})  # the raycaster does not depend on people
    return _raycaster(empty).draw([*_robot_solids(cell, robot_q), *people, *task])


def _static_solids(cell: Cell) -> tuple[Solid, ...]:
    """Return table, robot plate, obstacles and the objects at pick stations."""
    solids: list[Solid] = [*_table_solids(cell.table)]
    solids.append(Box(center=(0, 0, 0.004), half_size=(0.15, 0.15, 0.004), colour=ROBOT_PLATE))
    for box in cell.obstacles:
        half = box.half_size
        solids.append(Box(center=box.center, half_size=half, yaw=box.yaw, colour=OBSTACLE))
    for kind, side, height in (("cube", 0.035, 0.07), ("dock", 0.075, 0.012)):
        for station in cell.stations_of(kind):
            x, y, base = _foot(cell, station)
            middle = (x, y, base + 0.5 * height)
            half = (side, side, 0.5 * height)
            solids.append(Box(center=middle, half_size=half, colour=STATION))
    return tuple(solids)


def _table_solids(table: TableGeometry) -> list[Solid]:
    x, y = 0.5 * (table.x_min + table.x_max), 0.5 * (table.y_min + table.y_max)
    half = (0.5 * (table.x_max - table.x_min), 0.5 * (table.y_max - table.y_min))
    middle, thick = (x, y, -0.5 * table.thickness), 0.5 * table.thickness
    solids: list[Solid] = [
        Box(center=middle, half_size=(*half, thick), colour=TABLE_TOP),
        Box(
            center=middle,
            half_size=(half[0] + 0.003, half[1] + 0.003, 0.7 * thick),
            colour=TABLE_EDGE,
        ),
    ]
    length = 0.5 * (table.height - table.thickness)
    for sx in (-1.0, 1.0):
        for sy in (-1.0, 1.0):
            at = (x + sx * (half[0] - 0.11), y + sy * (half[1] - 0.11))
            foot = (*at, -table.thickness - length)
            solids.append(
                Box(center=foot, half_size=(0.035, 0.035, length), colour=TABLE_FRAME)
            )
    return solids


def _robot_solids(cell: Cell, q: Vec) -> list[Solid]:
    arm, mount = arm_of(cell), cell.robot
    capsules = load_robot_capsules(mount.tool_length, mount.tool_radius)
    pose = arm_kernel.new_robot_pose(arm)
    arm_kernel.place_robot(arm, as_kernel_array(q), pose)
    ends = ends_of(pose.capsules, len(capsules.name))
    colours = [JOINT if name in _JOINTS else ALUMINIUM for name in capsules.name[:-1]]
    return _capsules(ends, capsules.radius, [*colours, TOOL])


def _capsules(ends: Vec, radii: Vec, colours: Sequence[Rgb]) -> list[Solid]:
    rows = zip(ends, radii.tolist(), colours, strict=True)
    return [Capsule(start=a, end=b, radius=r, colour=colour) for (a, b), r, colour in rows]


def people_solids(cell: Cell, state: PeopleState, row: int) -> list[Solid]:
    """Return the people of one environment."""
    workers = worker_solids(cell, state.q[row], state.size[row])
    floor = cell.floor_z
    walkers = [
        Cylinder(
            base=(x, y, floor),
            height=person.height,
            radius=r,
            colour=VESTS[(len(state.q[row]) + k) % len(VESTS)],
        )
        for k, (person, (x, y, r)) in enumerate(
            zip(cell.cylinders, state.cylinders[row].tolist(), strict=True)
        )
    ]
    return [*workers, *walkers]


def worker_solids(cell: Cell, q: Vec, sizes: Vec | None = None) -> list[Solid]:
    """Return workers in their postures.

    Args:
        q: Their joints [m, rad], shape (W, 18).
        sizes: Their sizes [m], shape (W, body.N_SIZE); None for the cell's person.
    """
    geometry = people_geometry_of(people_of(cell), q, np.zeros((0, 3)), sizes)
    n = len(q) * body.N_CAPSULES
    colours = [
        VESTS[w % len(VESTS)] if part in _VEST else _PARTS.get(part, JACKET)
        for w in range(len(q))
        for part in range(body.N_CAPSULES)
    ]
    return _capsules(ends_of(geometry.capsules, n), geometry.capsules[RADIUS, :n], colours)


def standing_workers(cell: Cell) -> list[Solid]:
    """Return a cell's workers at rest at their workplaces."""
    postures = [human.rest_posture(*person.home) for person in cell.workers]
    return worker_solids(cell, np.array(postures).reshape(-1, 18))


def target_solids(goal: Vec) -> list[Solid]:
    """Return a target at a position [m], shape (3,), and the sphere of success around it."""
    return [
        Capsule(start=goal, end=goal, radius=0.025, colour=TARGET),
        Capsule(start=goal, end=goal, radius=SUCCESS_DISTANCE, colour=TARGET, opacity=0.45),
    ]


def block_solids(cell: Cell, shape: SortingShape, state: SortingState) -> list[Solid]:
    """Return clutter slots, towers and blocks; blocks of the goal are translucent."""
    level = block_height(cell) or 0.03
    named = [one.colour for one in cell.stations_of("cluster")]
    colours = [BLOCKS.get(one or "", UNNAMED[k]) for k, one in enumerate(named)]

    def block(code: int, foot: Point, stands: int, opacity: float = 1.0) -> Solid:
        colour, size = divmod(int(code) - 1, shape.n_sizes)
        half = half_size(cell, size, shape.n_sizes)
        half[2] = 0.5 * level - 5e-4  # a line between two blocks of one colour
        half[:2] += 0.002 * (opacity < 1.0)
        at = (*foot[:2], foot[2] + _FLAT + (stands + 0.5) * level)
        return Box(center=at, half_size=half, colour=colours[colour], opacity=opacity)

    solids: list[Solid] = []
    for k, station in enumerate(cell.stations_of("clutter")):
        foot = _foot(cell, station)
        solids.append(_tile(foot, blend(FAILURES, float(state.fail[k]))))
        if state.clutter[k] != NULL:
            solids.append(block(state.clutter[k], foot, 0))
    for c, station in enumerate(cell.stations_of("cluster")):
        foot = _foot(cell, station)
        solids.append(_tile(foot, blend(((0.0, TRAY), (1.0, colours[c])), 0.35)))
        for k, (code, wanted) in enumerate(zip(state.towers[c], state.goal[c], strict=True)):
            if code != NULL:
                solids.append(block(code, foot, k))
            if wanted not in (NULL, code):
                solids.append(block(wanted, foot, k, opacity=0.4))
    return solids


_FLAT = 0.004
"""Height of the tiles on which blocks stand [m]."""


def _tile(foot: Point, colour: Rgb) -> Solid:
    middle = (*foot[:2], foot[2] + 0.5 * _FLAT)
    return Box(center=middle, half_size=(0.08, 0.08, 0.5 * _FLAT), colour=colour)


def _foot(cell: Cell, station: Station) -> Point:
    """Return the point of table or obstacle below a station [m]."""
    x, y, _ = station.position
    return x, y, support_height(cell, station.position)
