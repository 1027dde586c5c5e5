"""Poses of robot and people, recorded and checked again with FCL.

Evaluations of picking and reaching keep the poses of some episodes and test with FCL on the raw
meshes whether the kernels missed a contact.
"""

from collections.abc import Sequence

import numpy as np

from app.policies.evaluation.statistics import Index
from app.sim.cells.cell import Cell
from app.sim.collision.fcl_recheck import Recheck, Trajectory
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.pick.batch import PickBatch
from app.sim.reach.batch import ReachBatch
from app.sim.robot.trajectory_segment import executed_coefficients
from app.sim.scenario.kernels.episode import COLLISION
from app.sim.scene.scene import FAR_AWAY


class Trace:
    """Record robot and people of the first environments ``parts`` times per control period."""

    def __init__(self, batch: PickBatch | ReachBatch, n_recorded: int, parts: int = 5) -> None:
        self._batch, self._n, self._parts = batch, n_recorded, parts
        self._robot: list[list[Vec]] = [[] for _ in range(n_recorded)]
        self._people: list[list[tuple[Vec, ...]]] = [[] for _ in range(n_recorded)]

    def before(self, rows: Index) -> None:
        """Store the states before a step of the environments ``rows``, shape (k,)."""
        state, n = self._batch.state, self._n
        self._rows = rows[rows < n]
        self._q0, self._qd0 = state.q[:n].copy(), state.qd[:n].copy()
        self._qdd0 = state.qdd[:n].copy()
        self._touched0 = state.touched[:n].copy()
        self._people0 = tuple(part[:n].copy() for part in self._of_people())

    def after(self) -> None:
        """Add the poses of the period, except where there was a contact in it."""
        state, dt, n = self._batch.state, self._batch.arm.dt, self._n
        contact = (state.outcome[:n] == COLLISION) | (state.touched[:n] > self._touched0)
        rows = self._rows[~contact[self._rows]]
        ends = (self._qd0, state.qd[:n]), (self._qdd0, state.qdd[:n])
        c, d = executed_coefficients(self._batch.settings.action.degree, dt, *ends)
        for part in range(1, self._parts + 1):
            x, blend = dt * part / self._parts, part / self._parts
            q = self._q0 + x * (self._qd0 + x * (c + x * d))
            people = [
                before + blend * (now[:n] - before)
                for before, now in zip(self._people0, self._of_people(), strict=True)
            ]
            for row in rows:
                self._robot[row].append(q[row])
                self._people[row].append(tuple(one[row] for one in people))

    def _of_people(self) -> tuple[Vec, Vec, Vec]:
        """Return joints and sizes of the workers, and the cylinders."""
        people = self._batch.state.people
        return people.q, people.size, people.cylinders

    def trajectories(self) -> tuple[Trajectory, ...]:
        """Return one trajectory per worker of each recorded episode, or one without a worker.

        The first trajectory of an episode contains its cylinders.
        """
        found = []
        for q, people in zip(self._robot, self._people, strict=True):
            if not q:
                continue
            joints, sizes, cylinders = (np.array(part) for part in zip(*people, strict=True))
            sized = joints.shape[1] > 0
            if not sized:
                joints = np.tile(human.rest_posture(*FAR_AWAY), (len(q), 1, 1))
            for w in range(joints.shape[1]):
                found.append(
                    Trajectory(
                        q_robot=np.array(q),
                        q_human=joints[:, w],
                        sizes=sizes[:, w] if sized else None,
                        cylinders=cylinders if w == 0 else None,
                    )
                )
        return tuple(found)


def recheck(cell: Cell, trajectories: Sequence[Trajectory]) -> dict[str, int]:
    """Check every recorded pose without a reported contact with FCL on the raw meshes."""
    meshes = Recheck(cell)
    found = [meshes.first_contact(trajectory) for trajectory in trajectories]
    return {
        "episodes": len(trajectories),
        "poses": sum(len(trajectory.q_robot) for trajectory in trajectories),
        "missed_contacts": sum(contact is not None for contact in found),
    }
