"""Collision queries of planners: people as shapes at one time, poses and motions.

The checker uses the compiled capsules of training (``collision/kernels/free.py``), so that
planners and policies have the same robot, table and people.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.errors import InvalidInput
from app.sim.cells.cell import Cell
from app.sim.collision.contact import Clearance
from app.sim.collision.kernels import free
from app.sim.core.arrays import Vec
from app.sim.geometry.capsules import N_ROWS, capsules_soa, padded_size
from app.sim.human import model as human
from app.sim.robot.kernels import arm as arm_kernel
from app.sim.robot.kernels.arm import Arm

CELL_MARGIN = 0.002
"""Distance that plans keep from the cell and of the robot from itself [m]; ours."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Shapes:
    """Shapes of any number of people of any kind at one moment."""

    capsules: Vec
    """Capsules, shape (9, m); see ``geometry/capsules.py``."""
    cylinders: Vec
    """Upright cylinders on the floor: x, y, radius, top [m], shape (n, 4)."""
    going: Vec | None = None
    """Velocities with which the cylinders may be extrapolated: vx, vy and growth of the radius
    [m/s], shape (n, 3); NaN in rows without one, None where none has one."""
    speed: Vec | None = None
    """Observed speed of each capsule [m/s], shape (m,); None where unknown."""
    cylinder_speed: Vec | None = None
    """Observed speed of each cylinder [m/s], shape (n,); None: that of ``going``."""


def greatest_speeds(going: Vec) -> Vec:
    """Return the greatest speed of any point of cylinders by their velocities [m/s]."""
    speeds: Vec = np.hypot(going[:, 0], going[:, 1]) + np.abs(going[:, 2])
    return speeds


def no_people() -> Shapes:
    """Return an empty cell."""
    return Shapes(capsules=np.zeros((N_ROWS, 0)), cylinders=np.zeros((0, 4)))


def capsule_shapes(ends: Vec, radius: Vec) -> Shapes:
    """Return people given by capsules.

    Args:
        ends: Ends of the capsules [m], shape (m, 2, 3).
        radius: Their radii [m], shape (m,).
    """
    return replace(no_people(), capsules=capsules_soa(ends, radius, padded_size(len(radius))))


def shapes_of(
    cell: Cell,
    human_qs: NDArray[np.float64] | None = None,
    cylinders: NDArray[np.float64] | None = None,
) -> Shapes:
    """Return people as shapes.

    Args:
        human_qs: Joint positions of 18-DoF people [m, rad], shape (k, 18).
        cylinders: Walking cylinders: x, y, radius, top [m], shape (n, 4).

    Raises:
        InvalidInput: A number is NaN or infinite, or an array has another shape.
    """
    qs = np.zeros((0, 18)) if human_qs is None else np.array(human_qs, dtype=np.float64)
    tubes = np.zeros((0, 4)) if cylinders is None else np.array(cylinders, dtype=np.float64)
    for name, rows, width in (("human_qs", qs, 18), ("cylinders", tubes, 4)):
        if rows.ndim != 2 or rows.shape[1] != width or not np.isfinite(rows).all():
            raise InvalidInput(name, rows.tolist(), f"must be finite, of shape (n, {width})")
    if len(qs) == 0:
        return Shapes(capsules=np.zeros((N_ROWS, 0)), cylinders=tubes)
    ends = np.concatenate([human.capsules(q, cell.body, cell.floor_z) for q in qs])
    workers = capsule_shapes(ends, np.tile(human.capsule_radii(cell.body), len(qs)))
    return replace(workers, cylinders=tubes)


class Checker:
    """Collision checks of configurations and motions among static people.

    Not thread-safe: it has a work space and counts configurations.

    Args:
        arm: From ``scene.arm_of``.
        people: Shapes of the people.
        margin: Distance to keep from people [m].
        cell_margin: Distance to keep from the cell and of the robot from itself [m].
    """

    def __init__(
        self, arm: Arm, people: Shapes, margin: float = 0.0, cell_margin: float = CELL_MARGIN
    ) -> None:
        self.arm, self.people, self.margin, self.cell_margin = arm, people, margin, cell_margin
        self._obstacles = free.Obstacles(
            people.capsules,
            np.empty(people.capsules.shape[1]),
            people.cylinders,
            float(margin),
            float(cell_margin),
            np.empty(6),
            np.empty(6),
            np.empty(6),
        )
        self._pose = arm_kernel.new_robot_pose(arm)
        self.n_poses = 0

    def is_free(self, q: Vec) -> bool:
        """Return whether all margins hold at ``q`` [rad], shape (6,)."""
        self.n_poses += 1
        return bool(free.free_at(self.arm, q, self._obstacles, self._pose))

    def clearance(self, q: Vec) -> Clearance:
        """Return the distances at ``q`` [rad], shape (6,)."""
        self.n_poses += 1
        people, cell, own = free.clearances_at(self.arm, q, self._obstacles, self._pose)
        return Clearance(people_m=people, cell_m=cell, self_m=own)

    def edge_free(self, q0: Vec, q1: Vec) -> bool:
        """Return whether the straight motion from ``q0`` to ``q1`` [rad], (6,), is free."""
        verdict, looked = free.edge_free(self.arm, q0, q1, self._obstacles, self._pose)
        self.n_poses += looked
        return bool(verdict)

    def path_free(self, path: Vec) -> bool:
        """Return whether a path of straight joint motions, shape (n, 6), is free."""
        return all(self.edge_free(a, b) for a, b in zip(path[:-1], path[1:], strict=True))

    def first_blocked(self, q: Vec, qd: Vec, first: int = 0) -> int:
        """Return the first period of a timed path that is not free; see the kernel.

        Args:
            q: Joint positions between periods [rad], shape (n + 1, 6).
            qd: Joint speeds between periods [rad/s], shape (n + 1, 6).
            first: Period to begin with.
        """
        shared = self._obstacles, self._pose
        return int(free.first_blocked(self.arm, q, qd, self.arm.dt, first, *shared))
