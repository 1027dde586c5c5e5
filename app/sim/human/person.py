"""One person in the cell: state of the human model, or a cylinder."""

import math
from dataclasses import dataclass

from app.sim.core.arrays import Vec


@dataclass(frozen=True, slots=True, kw_only=True)
class Person:
    """One person in the cell: the 18-DoF model of docs/method.md 3.4, or a cylinder.

    Positions are in the robot's base frame.
    """

    q: Vec
    """Joint positions [m, rad], shape (18,), order of ``human.JOINT_NAMES``."""
    qd: Vec
    """Joint speeds [m/s, rad/s], shape (18,)."""
    size: Vec | None = None
    """Body dimensions, shape (12,), from ``BodySize.vector``: height of the standing pelvis in
    the cell's frame [m], lengths [m], girth relative to the median; None: the cell's person."""
    cylinder: Vec | None = None
    """x, y and radius [m], shape (3,), of a person known only as a cylinder
    (``observed_people.person_from_cylinder``); distances are then to the cylinder. None: a body
    of 18 joints."""
    top: float = -math.inf
    """z of the top of that cylinder [m] for the safety layer, where it is above that of the
    cell's tallest pedestrian or 2 m over the floor."""
    growth: float = 0.0
    """Growth rate of that cylinder's radius [m/s]; 0 if unknown."""
    past: Vec | None = None
    """Radius [m] and walking speed [m/s] of that cylinder 0.1 s, 0.2 s, ... ago, shape (n, 2),
    n at most ``pedestrian.N_PAST - 1``; None without a history."""
    measured: bool = False
    """Whether the velocity of that cylinder was measured, so that a safety layer may use it."""
