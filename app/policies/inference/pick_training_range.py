"""Training range of a pick policy, to flag inputs outside it."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.checkpoints.training_range import TOLERANCE
from app.policies.inference.value_networks import pick_preset_of
from app.policies.networks.pick import STATE_SIZES
from app.sim.core.arrays import Vec
from app.sim.core.kernels.bounds import are_inside
from app.sim.core.out_of_range import OutOfRangeValue
from app.sim.human import model as human
from app.sim.human.person import Person
from app.sim.robot import ur10 as robot


class PickTrainingRange:
    """Training range of a checkpoint, to flag inputs outside it."""

    def __init__(self, checkpoint: Checkpoint) -> None:
        ranges = checkpoint.manifest["trained_range"]
        preset = pick_preset_of(checkpoint)
        self._trained_without_people = preset.people.human_absent > 0.0
        self._time_limit_s = preset.episode.time_limit_s
        self._low = {name: np.array(entry["low"]) for name, entry in ranges.items()}
        self._high = {name: np.array(entry["high"]) for name, entry in ranges.items()}
        self._robot, self._person, self._goal = (
            tuple(
                np.concatenate([self._bound(name, n, low) for name, n in sizes])
                for low in (True, False)
            )
            for sizes in (STATE_SIZES[:2], STATE_SIZES[2:4], STATE_SIZES[4:])
        )

    def _bound(self, key: str, n: int, low: bool) -> Vec:
        """Return the least or greatest values of a variable, infinite where unknown."""
        bounds = self._low if low else self._high
        if key not in bounds or len(bounds[key]) != n:
            return np.full(n, -np.inf if low else np.inf)
        return bounds[key] - TOLERANCE if low else bounds[key] + TOLERANCE

    def of_robot(self, q: Vec, qd: Vec) -> tuple[OutOfRangeValue, ...]:
        """Return the joint positions and speeds of the robot outside the range.

        Args:
            q: Joint positions [rad], shape (6,).
            qd: Joint speeds [rad/s], shape (6,).
        """
        if are_inside(np.concatenate([q, qd]), *self._robot):
            return ()
        return (
            *self._outside("q", q, "robot.q", robot.JOINT_NAMES),
            *self._outside("qd", qd, "robot.qd", robot.JOINT_NAMES),
        )

    def of_person(self, person: Person, index: int | None) -> tuple[OutOfRangeValue, ...]:
        """Return the joint angles and speeds of an observed person outside the range.

        Args:
            person: The person.
            index: Index of that person; None: a person far away, in an empty cell.
        """
        if index is None and self._trained_without_people:
            return ()
        if are_inside(np.concatenate([person.q, person.qd]), *self._person):
            return ()
        path = f"people[{index or 0}]"
        return (
            *self._outside("human_q", person.q, f"{path}.q", human.JOINT_NAMES),
            *self._outside("human_qd", person.qd, f"{path}.qd", human.JOINT_NAMES),
        )

    def are_postures_outside(self, q: Vec) -> NDArray[np.bool_]:
        """Return which postures of a person are outside the range, shape (m,).

        Args:
            q: Joint positions [m, rad], shape (m, 18).
        """
        low, high = (bound[: q.shape[1]] for bound in self._person)
        return np.asarray(((q < low) | (q > high)).any(axis=1))

    def of_time(self, time_left_s: float) -> tuple[OutOfRangeValue, ...]:
        """Return the observed time left [s], where no episode of the training had it."""
        limit = self._time_limit_s
        if time_left_s <= limit:
            return ()
        return (OutOfRangeValue(field="time_left_s", value=time_left_s, low=0.0, high=limit),)

    def of_goals(self, goals: Vec) -> tuple[tuple[OutOfRangeValue, ...], ...]:
        """Return the coordinates of each target outside the range, shape (n, 3) [m]."""
        low, high = self._goal
        if are_inside(goals.ravel(), low, high):
            return ((),) * len(goals)
        found: list[tuple[OutOfRangeValue, ...]] = [()] * len(goals)
        for i in np.flatnonzero(((goals < low) | (goals > high)).any(axis=1)).tolist():
            found[i] = self._outside("goal", goals[i], "position", ("x", "y", "z"))
        return tuple(found)

    def _outside(
        self, key: str, values: Vec, path: str, names: Sequence[str]
    ) -> tuple[OutOfRangeValue, ...]:
        if key not in self._low or len(self._low[key]) != len(values):
            return ()
        low, high = self._low[key], self._high[key]
        beyond = (values < self._bound(key, len(values), True)) | (
            values > self._bound(key, len(values), False)
        )
        return tuple(
            OutOfRangeValue(
                field=f"{path}.{names[i]}",
                value=float(values[i]),
                low=float(low[i]),
                high=float(high[i]),
            )
            for i in np.flatnonzero(beyond).tolist()
        )
