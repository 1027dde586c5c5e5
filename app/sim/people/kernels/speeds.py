"""Speeds of the people in a cell (compiled)."""

import math

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.geometry.capsules import displacements, greatest_displacement
from app.sim.people.kernels.people import People, PeopleGeometry, place_workers

SPEED_STEP = 1e-5
"""Step of the difference quotient of speeds of capsules [s]."""


@kernel()
def capsule_speeds(
    people: People, q: Vec, qd: Vec, capsules: Vec, geometry: PeopleGeometry, out: Vec
) -> None:
    """Write the speed of the faster end of each of the workers' capsules [m/s].

    No point of the axis between its ends is faster.

    Args:
        q: Joint positions [m, rad], shape (W, 18).
        qd: Joint speeds [m/s, rad/s], shape (W, 18).
        capsules: The capsules at ``q``, shape (9, n).
        geometry: Work space with the workers' sizes; its pose changes.
        out: Filled, shape (n,).
    """
    for w in range(q.shape[0]):
        for j in range(18):
            geometry.q[w, j] = q[w, j] + SPEED_STEP * qd[w, j]
    place_workers(people, geometry.q, geometry)
    displacements(capsules, geometry.capsules, out)
    for k in range(out.shape[0]):
        out[k] /= SPEED_STEP


@kernel()
def people_speed_bound(before: Vec, after: Vec, start: Vec, end: Vec, dt: float) -> float:
    """Return a bound on the speed of any point of the people in a period [m/s].

    Workers: chords of the capsules' ends plus 5 % for the arc, sufficient for rotations up to
    one radian per period. Pedestrians: displacement plus growth of the radius.

    Args:
        before: The workers' capsules at the start, shape (9, n).
        after: Their capsules at the end, shape (9, n).
        start: x, y and radius of the pedestrians at the start [m], shape (C, 3).
        end: The same at the end [m], shape (C, 3).
        dt: Period [s].
    """
    longest = 1.05 * greatest_displacement(before, after)
    for k in range(start.shape[0]):
        moved = math.hypot(end[k, 0] - start[k, 0], end[k, 1] - start[k, 1])
        longest = max(longest, moved + abs(end[k, 2] - start[k, 2]))
    return longest / dt
