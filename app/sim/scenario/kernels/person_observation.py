"""Motion of an observed person, as both scenarios extrapolate it (compiled).

A person's capsules are placed now and ``TICK`` later; the difference gives the velocity of each
capsule, by which the capsules are extrapolated to ``HORIZONS``.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import FAST, kernel
from app.sim.geometry.capsules import INVERSE, RADIUS, UU, UX, UY, UZ, X
from app.sim.human.kernels import kinematics as body

Obs = NDArray[np.float32]
"""Observations."""

HORIZONS = (0.25, 0.5, 1.0)
"""Times at which clearances are extrapolated at constant velocity [s]."""
BASE_GAIN = 3.0
"""Gain of the base controllers: joint speed per remaining joint difference [1/s]."""
TICK = 1e-3
"""Time step of the finite difference [s]."""


class PersonWorkspace(NamedTuple):
    """Work space for one person: points and capsules, now and extrapolated."""

    trig: Vec
    """Sines, cosines and more, shape (3, 16)."""
    points: Vec
    """Points of the body now [m], shape (N_POINTS, 3)."""
    points_later: Vec
    """The same points one ``TICK`` later [m], shape (N_POINTS, 3)."""
    frames: Vec
    """Orientations, shape (N_FRAMES, 3, 3)."""
    now: Vec
    """Capsules now, shape (9, 16)."""
    later: Vec
    """Capsules one ``TICK`` later, shape (9, 16)."""
    moved: Vec
    """Capsules extrapolated to a horizon, shape (9, 16)."""
    q: Vec
    """Joints one ``TICK`` later [m, rad], shape (18,)."""


def new_person_workspace() -> PersonWorkspace:
    """Return work space with no person placed."""
    capsules = body.new_body_capsules(1)
    return PersonWorkspace(
        trig=np.zeros((3, 16)),
        points=np.zeros((body.N_POINTS, 3)),
        points_later=np.zeros((body.N_POINTS, 3)),
        frames=np.zeros((body.N_FRAMES, 3, 3)),
        now=capsules.copy(),
        later=capsules.copy(),
        moved=capsules.copy(),
        q=np.zeros(18),
    )


@kernel(inline="always")
def place_person(floor_z: float, q: Vec, qd: Vec, size: Vec, person: PersonWorkspace) -> None:
    """Place points and capsules of a person, now and one ``TICK`` later.

    Args:
        floor_z: Height of the floor [m].
        q: The person's joint positions [m, rad], shape (18,).
        qd: The person's joint speeds [m/s, rad/s], shape (18,).
        size: The person's body dimensions [m], shape (body.N_SIZE,).
        person: Filled.
    """
    for j in range(18):
        person.q[j] = q[j] + TICK * qd[j]
    body.points_and_frames(person.q, size, person.trig, person.points_later, person.frames)
    body.capsules(person.points_later, person.frames, size, floor_z, 0, person.later)
    body.points_and_frames(q, size, person.trig, person.points, person.frames)
    body.capsules(person.points, person.frames, size, floor_z, 0, person.now)


@kernel()
def place_predicted(
    floor_z: float, q: Vec, size: Vec, person: PersonWorkspace, capsules: Vec
) -> None:
    """Place the capsules of a person at predicted joint positions.

    Args:
        floor_z: Height of the floor [m].
        q: The predicted joint positions [m, rad], shape (18,).
        size: The person's body dimensions [m], shape (body.N_SIZE,).
        person: Work space; its points one ``TICK`` later are overwritten.
        capsules: Filled, shape (9, 16).
    """
    body.points_and_frames(q, size, person.trig, person.points_later, person.frames)
    body.capsules(person.points_later, person.frames, size, floor_z, 0, capsules)


@kernel(error_model="numpy", fastmath=FAST)
def extrapolate_capsules(now: Vec, later: Vec, horizon: float, moved: Vec) -> None:
    """Extrapolate capsules at constant velocity.

    Args:
        now: Capsules as columns, shape (9, n).
        later: The same capsules one ``TICK`` later, shape (9, n).
        horizon: Time ahead [s].
        moved: Filled, shape (9, n).
    """
    part = horizon / TICK
    for row in range(X, UU):
        for k in range(now.shape[1]):
            moved[row, k] = now[row, k] + part * (later[row, k] - now[row, k])
    for k in range(now.shape[1]):
        ux, uy, uz = moved[UX, k], moved[UY, k], moved[UZ, k]
        square = ux * ux + uy * uy + uz * uz
        moved[UU, k], moved[RADIUS, k] = square, now[RADIUS, k]
        moved[INVERSE, k] = 1.0 / (square if square > 1e-12 else 1e30)
