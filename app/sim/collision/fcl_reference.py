"""Reference collision checker: python-fcl on the UR10's collision meshes.

Slow and exact, where the kernels are fast and conservative. Tests, the rechecks of evaluations
(``fcl_recheck.py``) and the validation of work cells use it. Meshes are triangles in a bounding
volume tree: surfaces, so that a body wholly inside a link is not found.
"""

import math
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal

import fcl
import numpy as np
import pinocchio as pin

from app.sim.cells.cell import Cell
from app.sim.cells.parts import Obstacle
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.robot.capsules import TOOL, tool_capsule
from app.sim.robot.ur10 import LINK_NAMES, Robot, package_dir, urdf_path

if TYPE_CHECKING:
    import trimesh

Kind = Literal["human", "cell", "self"]

BODY_NAMES = (*LINK_NAMES, TOOL)
"""The robot's bodies: base, six links and the tool."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeshContact:
    """Two things that touch."""

    kind: Kind
    """Kind of contact: with the person, the cell or the robot itself."""
    link: str
    """Body of the robot, one of BODY_NAMES."""
    body: str
    """The other one: a capsule of the person, ``walker`` and the number of a cylinder,
    ``table``, ``floor``, ``obstacle`` and its id, or a body of the robot."""


def collision_mesh(link: str) -> "trimesh.Trimesh":
    """Load one link's collision mesh in the link's frame [m].

    The URDF's ``ee_link`` carries a box without a mesh file, so links are read by name.
    """
    model = pin.buildModelFromUrdf(str(urdf_path()))
    geometry = pin.buildGeomFromUrdf(
        model, str(urdf_path()), pin.GeometryType.COLLISION, package_dirs=[str(package_dir())]
    )
    shape = geometry.geometryObjects[geometry.getGeometryId(f"{link}_0")]
    # Loaded here: it takes half a second, and every process that reads a cell imports this.
    mesh: trimesh.Trimesh = import_module("trimesh").load_mesh(shape.meshPath)
    frame = model.frames[model.getFrameId(link)]
    mesh.apply_transform(frame.placement.inverse().act(shape.placement).homogeneous)
    return mesh


def tree_of(mesh: "trimesh.Trimesh") -> Any:
    """Return the mesh as fcl's bounding volume tree of triangles."""
    tree = fcl.BVHModel()
    tree.beginModel(len(mesh.vertices), len(mesh.faces))
    tree.addSubModel(mesh.vertices, mesh.faces)
    tree.endModel()
    return tree


def place_capsule(body: Any, p0: Vec, p1: Vec) -> None:
    """Place an ``fcl.Capsule`` between two points [m], shape (3,) each."""
    x, y, z = (p1 - p0 if p1[2] >= p0[2] else p0 - p1).tolist()
    length = math.hypot(x, y, z)
    # Quaternion (w, x, y, z) of the shortest turn from z to the axis.
    turn = np.array((length + z, -y, x, 0.0) if length > 0.0 else (1.0, 0.0, 0.0, 0.0))
    body.setTransform(fcl.Transform(turn / math.hypot(*turn), 0.5 * (p0 + p1)))


def make_capsule(radius: float, p0: Vec, p1: Vec) -> Any:
    """Return a capsule with a radius [m] between two points [m], shape (3,), placed in fcl."""
    body = fcl.CollisionObject(fcl.Capsule(radius, float(np.linalg.norm(p1 - p0))))
    place_capsule(body, p0, p1)
    return body


def make_box(low: Vec, high: Vec) -> Any:
    """Return an axis-aligned box between two corners [m], shape (3,), placed in fcl."""
    transform = fcl.Transform(np.eye(3), 0.5 * (low + high))
    return fcl.CollisionObject(fcl.Box(*(high - low)), transform)


def obstacle_box(obstacle: Obstacle, shrink: float = 0.0) -> Any:
    """Return an obstacle as a placed fcl object, smaller by ``shrink`` [m] on every side."""
    sides = np.maximum(2.0 * (np.array(obstacle.half_size) - shrink), 1e-6)
    c, s = math.cos(obstacle.yaw), math.sin(obstacle.yaw)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return fcl.CollisionObject(
        fcl.Box(*sides), fcl.Transform(turn, np.array(obstacle.center, dtype=np.float64))
    )


def make_cylinder(x: float, y: float, radius: float, low: float, high: float) -> Any:
    """Return an upright cylinder between two heights [m] as a placed fcl object."""
    middle = np.array([x, y, 0.5 * (low + high)])
    return fcl.CollisionObject(
        fcl.Cylinder(radius, high - low), fcl.Transform(np.eye(3), middle)
    )


def walker_name(number: int) -> str:
    """Return the name of a walking cylinder in a contact."""
    return f"walker {number}"


def touch(a: Any, b: Any) -> bool:
    """Return whether two fcl objects touch."""
    return bool(fcl.collide(a, b, fcl.CollisionRequest(), fcl.CollisionResult()))


class CollisionReference:
    """Robot, person and cell as fcl bodies; keeps the last pose, so one per thread."""

    def __init__(self, cell: Cell) -> None:
        self._cell = cell
        self._robot = Robot(cell.robot.tool_length)
        self._bodies = {
            name: fcl.CollisionObject(tree_of(collision_mesh(name))) for name in LINK_NAMES
        }
        self._tool = tool_capsule(cell.robot.tool_length, cell.robot.tool_radius)
        self._bodies[TOOL] = make_capsule(cell.robot.tool_radius, *self._tool)
        self._obstacles = _obstacles(cell)
        self._walkers: dict[str, Any] = {}
        self.set_person(cell.body)

    def set_person(self, size: Vec) -> None:
        """Set the size of the person [m], shape (12,)."""
        self._size = size
        ends = human.capsules(np.zeros(18), size, self._cell.floor_z)
        self._person = {
            name: make_capsule(radius, p0, p1)
            for name, radius, (p0, p1) in zip(
                human.CAPSULE_NAMES, human.capsule_radii(size), ends, strict=True
            )
        }

    def place_robot(self, q: Vec) -> None:
        """Move the robot's bodies to joint positions ``q`` [rad], shape (6,)."""
        poses = self._robot.link_poses(q)
        for name, pose in zip(LINK_NAMES, poses, strict=True):
            self._bodies[name].setTransform(fcl.Transform(pose[:3, :3], pose[:3, 3]))
        p0, p1 = (poses[-1, :3, :3] @ end + poses[-1, :3, 3] for end in self._tool)
        place_capsule(self._bodies[TOOL], p0, p1)

    def place_person(self, human_q: Vec, size: Vec | None = None) -> None:
        """Move the person's capsules to joint positions ``human_q``, shape (18,).

        Another size [m], shape (12,), exchanges the person first (:meth:`set_person`).
        """
        if size is not None and not np.array_equal(size, self._size):
            self.set_person(size)
        ends = human.capsules(human_q, self._size, self._cell.floor_z)
        for body, (p0, p1) in zip(self._person.values(), ends, strict=True):
            place_capsule(body, p0, p1)

    def place_walkers(self, cylinders: Vec) -> None:
        """Place the walking cylinders: x, y and radius [m], shape (C, 3).

        As in the kernels they stand on the floor, all as high as the highest of the cell.
        """
        low = self._cell.floor_z
        high = low + max([one.height for one in self._cell.cylinders], default=2.0)
        self._walkers = {
            walker_name(k): make_cylinder(x, y, r, low, high)
            for k, (x, y, r) in enumerate(cylinders.tolist())
        }

    def touching(self, link: str, body: str) -> bool:
        """Return whether two bodies, as :class:`MeshContact` names them, touch where placed."""
        for group in (self._person, self._walkers, self._obstacles, self._bodies):
            if body in group:
                return touch(self._bodies[link], group[body])
        raise KeyError(body)


def _obstacles(cell: Cell) -> dict[str, Any]:
    table, floor = cell.table, cell.floor_z
    boxes = {f"obstacle {one.id}": obstacle_box(one) for one in cell.obstacles}
    return boxes | {
        "table": make_box(
            np.array([table.x_min, table.y_min, -table.thickness]),
            np.array([table.x_max, table.y_max, 0.0]),
        ),
        "floor": make_box(np.array([-5.0, -5.0, floor - 1.0]), np.array([5.0, 5.0, floor])),
    }
