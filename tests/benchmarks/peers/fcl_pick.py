"""The peer of ``bench_sim_steps``: the pick scenario as a single environment on FCL.

What is usual in Python: Pinocchio for the robot, python-fcl for distances, numpy in between,
one environment. It moves by the same bounded polynomial, on the same capsules, pairs and table
as the kernels, and gives reward, end and a plain observation. Where it could be made to look
slow it is treated kindly: broad-phase managers, one pose per step where the kernels sweep the
whole period, the person's capsules looked up and not computed, no features, resets for nothing.
"""

from typing import Any

import fcl
import numpy as np
from numpy.typing import NDArray

from app.sim.cells.cell import Cell
from app.sim.collision.fcl_reference import make_box, make_capsule
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.robot.capsules import TOOL_AXIS, load_robot_capsules, self_pairs
from app.sim.robot.ur10 import Robot

Array = NDArray[np.float64]


class FclPick:
    """One pick cell on Pinocchio and python-fcl.

    Args:
        cell: Work cell.
        people: The person's joints at each step, over and over [m, rad], shape (n, 18).
        target: What the tcp is to reach [m], shape (3,).
    """

    def __init__(self, cell: Cell, people: Array, target: Vec) -> None:
        mount = cell.robot
        self._home, self._dt = np.array(mount.home_q), mount.dt
        self._limits = tuple(
            np.array(limit) for limit in (mount.q_min, mount.q_max, mount.qd_max, mount.qdd_max)
        )
        self._target, self._people = target, people
        self._robot = Robot(mount.tool_length)
        lengths = self._robot.lengths()
        self._tcp = np.append((lengths.flange + lengths.tool) * TOOL_AXIS, 1.0)
        capsules = load_robot_capsules(mount.tool_length, mount.tool_radius)
        self._pairs, self._link = self_pairs(capsules), capsules.link
        parts = zip(capsules.radius, capsules.p0, capsules.p1, strict=True)
        self._bodies = [make_capsule(radius, p0, p1) for radius, p0, p1 in parts]
        self._in_link = np.stack([_pose(body) for body in self._bodies])
        scenes = [self._person_at(cell, q) for q in people]
        self._person = scenes[0]
        self._placed = [[body.getTransform() for body in scene] for scene in scenes]
        table = cell.table
        self._table = make_box(
            np.array([table.x_min, table.y_min, -table.thickness]),
            np.array([table.x_max, table.y_max, 0.0]),
        )
        # Base and shoulder stand on the table.
        self._moving = _manager(self._bodies[2:])
        self._all = _manager(self._bodies)
        self._set_layers = _manager(self._person)
        self._tick = 0
        self.n_ends = 0
        self.reset()

    def reset(self) -> None:
        """Put the robot home, at rest."""
        self._q, self._qd = self._home.copy(), np.zeros(6)
        self._distance = 0.0

    def step(self, act: Array) -> tuple[Array, float, bool]:
        """Move through one control period.

        Args:
            act: Wanted joint speeds over their limits, in [-1, 1], shape (5,).

        Returns:
            Observation, reward, and whether the episode ended.
        """
        self._q, self._qd = self._after(act)
        self._tick = (self._tick + 1) % len(self._people)
        tcp = self.place(self._q)
        collision = min(self.clearances()) <= 0.0
        distance = float(np.linalg.norm(tcp - self._target))
        reward = 0.5 * (self._distance - distance) - 1.0 * collision - 0.02
        self._distance = distance
        obs = np.concatenate([self._q, self._qd, self._people[self._tick], tcp])
        ended = collision or distance < 0.1
        if ended:
            self.n_ends += 1
            self.reset()
        return obs, reward, ended

    def clearances(self) -> tuple[float, float, float]:
        """Return the distances to the person, to the table and to itself [m]."""
        to_self = min(fcl.distance(self._bodies[a], self._bodies[b]) for a, b in self._pairs)
        return (
            _distance(self._all, self._set_layers),
            _distance(self._moving, self._table),
            to_self,
        )

    def _after(self, act: Array) -> tuple[Array, Array]:
        q_min, q_max, qd_max, acc = self._limits
        dt, q, qd = self._dt, self._q, self._qd
        step = acc * dt

        def end_speed(room: Array, speed: Array) -> Array:
            root = np.sqrt(np.maximum(step**2 + 2.0 * acc * room - step * speed, 0.0))
            return np.asarray(root - step)

        high = np.minimum(np.minimum(qd_max, end_speed(q_max - q, qd)), qd + step)
        low = np.maximum(np.maximum(-qd_max, -end_speed(q - q_min, -qd)), qd - step)
        wanted = np.append(act, 0.0) * qd_max
        after = np.clip(wanted, low, np.maximum(low, high))
        return q + 0.5 * dt * (qd + after), after

    def place(self, q: Array) -> Vec:
        """Move bodies to joints ``q`` [rad] and the person to its step; return the tcp [m]."""
        poses = self._robot.link_poses(q)
        for body, pose in zip(self._bodies, poses[self._link] @ self._in_link, strict=True):
            body.setTransform(fcl.Transform(pose[:3, :3], pose[:3, 3]))
        for body, transform in zip(self._person, self._placed[self._tick], strict=True):
            body.setTransform(transform)
        for manager in (self._all, self._moving, self._set_layers):
            manager.update()
        return np.asarray((poses[-1] @ self._tcp)[:3])

    @staticmethod
    def _person_at(cell: Cell, q: Vec) -> list[Any]:
        ends = human.capsules(q, cell.body, cell.floor_z)
        return [
            make_capsule(radius, p0, p1)
            for radius, (p0, p1) in zip(human.CAPSULE_RADII, ends, strict=True)
        ]


def _pose(body: Any) -> Array:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = body.getRotation(), body.getTranslation()
    return pose


def _manager(bodies: list[Any]) -> Any:
    manager = fcl.DynamicAABBTreeCollisionManager()
    manager.registerObjects(bodies)
    manager.setup()
    return manager


def _distance(manager: Any, other: Any) -> float:
    data = fcl.DistanceData()
    manager.distance(other, data, fcl.defaultDistanceCallback)
    return float(data.result.min_distance)
