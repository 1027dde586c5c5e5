"""Distances of capsules to a standing cylinder against python-fcl and by hand."""

import fcl
import numpy as np
import pytest

from app.sim.core.jit import FAR
from app.sim.geometry.capsules import capsules_soa, new_capsules
from app.sim.geometry.cylinder import cylinder_clearance, swept_clearance
from tests.sim.fcl_capsules import KINDS, check_against_fcl, random_ends

HEIGHT = 6.0
"""Height of fcl's cylinder, whose foot is out of reach [m]."""


def distance(ends: list[list[float]], radius: float, cylinder: tuple[float, ...]) -> float:
    return cylinder_clearance(capsules_soa(np.array([ends]), np.array([radius])), 0, *cylinder)[
        0
    ]


@pytest.mark.parametrize("kind", KINDS)
def test_distance_and_overlap_are_fcls(kind: str) -> None:
    rng = np.random.default_rng(12)
    over_the_top = 0
    for ends in random_ends(KINDS[kind], 11, kind):
        x, y, r, top = rng.uniform([-0.6, -0.6, 0.2, 0.3], [0.6, 0.6, 0.5, 1.4])
        d, _ = cylinder_clearance(capsules_soa(ends[None], np.array([0.05])), 0, x, y, r, top)
        middle = fcl.Transform(np.array([x, y, top - HEIGHT / 2]))
        cylinder = fcl.CollisionObject(fcl.Cylinder(r, HEIGHT), middle)
        check_against_fcl(ends, 0.05, cylinder, d)
        over_the_top += ends[:, 2].max() > top
    assert over_the_top > 0.3 * KINDS[kind]


@pytest.mark.parametrize(
    ("ends", "radius", "cylinder", "expected"),
    [  # beside it, over the disc, beyond the rim, out over the top, the same downward, inside
        ([[1.0, -1.0, 0.2], [1.0, 1.0, 0.7]], 0.1, (0.2, 0.0, 0.3, 2.0), 0.8 - 0.3 - 0.1),
        ([[-0.2, 0.0, 1.5], [0.2, 0.1, 1.4]], 0.1, (0.0, 0.0, 0.4, 1.0), 0.4 - 0.1),
        ([[0.7, 0.0, 1.4], [2.0, 0.0, 1.4]], 0.1, (0.0, 0.0, 0.4, 1.0), 0.5 - 0.1),
        ([[0.5, 0.0, 0.5], [0.5, 0.0, 3.0]], 0.05, (0.0, 0.0, 0.4, 1.0), 0.05),
        ([[0.5, 0.0, 3.0], [0.5, 0.0, 0.5]], 0.05, (0.0, 0.0, 0.4, 1.0), 0.05),
        ([[0.1, -1.0, 0.5], [0.1, 1.0, 0.5]], 0.05, (0.0, 0.0, 0.4, 1.0), 0.1 - 0.4 - 0.05),
    ],
)
def test_distance_is_that_to_the_nearest_part_of_the_cylinder(
    ends: list[list[float]], radius: float, cylinder: tuple[float, ...], expected: float
) -> None:
    assert distance(ends, radius, cylinder) == pytest.approx(expected)


def test_nearest_column_is_named_and_earlier_ones_are_passed_over() -> None:
    ends = np.array([[[0.5, y, 0.0], [0.5, y, 1.0]] for y in (0.0, 2.0, 1.0)])
    capsules = capsules_soa(ends, np.full(3, 0.1))
    near, column = cylinder_clearance(capsules, 0, 0.0, 0.0, 0.3, 2.0)
    later, after = cylinder_clearance(capsules, 1, 0.0, 0.0, 0.3, 2.0)
    assert (column, after) == (0, 2)
    assert near == pytest.approx(0.1) and later == pytest.approx(np.hypot(0.5, 1.0) - 0.4)


def test_columns_that_only_fill_up_are_far() -> None:
    assert cylinder_clearance(new_capsules(8, np.zeros(0)), 2, 0.0, 0.0, 0.5, 1.0) == (FAR, 2)


def test_least_of_many_is_the_least_of_each() -> None:
    rng = np.random.default_rng(3)
    radii = rng.uniform(0.02, 0.2, 12)
    for top in np.linspace(0.0, 1.6, 200):
        capsules = capsules_soa(random_ends(12, int(1000 * top), "any"), radii)
        each = [
            cylinder_clearance(np.ascontiguousarray(capsules[:, [k]]), 0, 0.1, 0.2, 0.3, top)[0]
            for k in range(12)
        ]
        d, k = cylinder_clearance(capsules, 0, 0.1, 0.2, 0.3, top)
        assert d == min(each) and k == np.argmin(each)
        for within in (d - 0.01, d + 0.01):
            found, _ = cylinder_clearance(capsules, 0, 0.1, 0.2, 0.3, top, within)
            assert found == min(d, within)


@pytest.mark.parametrize("kind", KINDS)
def test_swept_distance_is_the_least_along_the_path(kind: str) -> None:
    rng = np.random.default_rng(13)
    for ends in random_ends(60, 14, kind):
        robot = capsules_soa(ends[None], np.array([0.05]))
        x, y, sx, sy = rng.uniform(-0.8, 0.8, 4)
        along = [
            cylinder_clearance(robot, 0, x + s * sx, y + s * sy, 0.2, 10.0)[0]
            for s in np.linspace(0.0, 1.0, 401)
        ]
        found = swept_clearance(robot, x, y, sx, sy, 0.2)
        assert min(along) - 0.5 * np.hypot(sx, sy) / 400 <= found <= min(along) + 1e-9


def test_swept_distance_is_never_more_than_over_the_top() -> None:
    robot = capsules_soa(np.array([[[0.0, 0.0, 2.0], [0.3, 0.0, 2.2]]]), np.array([0.05]))
    over, _ = cylinder_clearance(robot, 0, 0.1, 0.0, 0.3, 1.3)
    assert swept_clearance(robot, 0.1, 0.0, 1e-3, 0.0, 0.3) < over
