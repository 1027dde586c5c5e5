"""Training range of a pick policy, to flag inputs outside it."""

import numpy as np
from numpy.typing import NDArray

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.checkpoints.training_range import KnownRange
from app.policies.inference.value_networks import pick_preset_of
from app.policies.networks.pick import STATE_SIZES
from app.sim.core.arrays import Vec
from app.sim.core.kernels.bounds import are_inside
from app.sim.core.out_of_range import OutOfRangeValue
from app.sim.human import model as human
from app.sim.human.person import Person
from app.sim.robot import ur10 as robot

ROBOT = tuple(f"robot.{part}.{name}" for part in ("q", "qd") for name in robot.JOINT_NAMES)
PERSON = tuple(f"{part}.{name}" for part in ("q", "qd") for name in human.JOINT_NAMES)
GOAL = ("position.x", "position.y", "position.z")
"""Names of the variables in messages; those of a person follow ``people[i]``."""


class PickTrainingRange:
    """Training range of a checkpoint, to flag inputs outside it."""

    def __init__(self, checkpoint: Checkpoint) -> None:
        preset, ranges = pick_preset_of(checkpoint), checkpoint.manifest["trained_range"]
        self._trained_without_people = preset.people.human_absent > 0.0
        self._time_limit_s = preset.episode.time_limit_s
        self._robot, self._person, self._goal = (
            KnownRange(ranges, dict(sizes))
            for sizes in (STATE_SIZES[:2], STATE_SIZES[2:4], STATE_SIZES[4:])
        )

    def of_robot(self, q: Vec, qd: Vec) -> tuple[OutOfRangeValue, ...]:
        """Return the joint positions and speeds of the robot outside the range.

        Args:
            q: Joint positions [rad], shape (6,).
            qd: Joint speeds [rad/s], shape (6,).
        """
        return self._robot.outside(np.concatenate([q, qd]), ROBOT)

    def of_person(self, person: Person, index: int | None) -> tuple[OutOfRangeValue, ...]:
        """Return the joint angles and speeds of an observed person outside the range.

        Args:
            person: The person.
            index: Index of that person; None: a person far away, in an empty cell.
        """
        if index is None and self._trained_without_people:
            return ()
        values = np.concatenate([person.q, person.qd])
        return self._person.outside(values, PERSON, f"people[{index or 0}].")

    def are_postures_outside(self, q: Vec) -> NDArray[np.bool_]:
        """Return which postures of a person are outside the range, shape (m,).

        Args:
            q: Joint positions [m, rad], shape (m, 18).
        """
        low, high = (bound[: q.shape[1]] for bound in (self._person.least, self._person.most))
        return np.asarray(((q < low) | (q > high)).any(axis=1))

    def of_time(self, time_left_s: float) -> tuple[OutOfRangeValue, ...]:
        """Return the observed time left [s], where no episode of the training had it."""
        limit = self._time_limit_s
        if time_left_s <= limit:
            return ()
        return (OutOfRangeValue(field="time_left_s", value=time_left_s, low=0.0, high=limit),)

    def of_goals(self, goals: Vec) -> tuple[tuple[OutOfRangeValue, ...], ...]:
        """Return the coordinates of each target outside the range, shape (n, 3) [m]."""
        if are_inside(goals.ravel(), self._goal.least, self._goal.most):
            return ((),) * len(goals)
        return tuple(self._goal.outside(goal, GOAL) for goal in goals)
