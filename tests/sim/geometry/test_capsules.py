"""Distances of capsules against python-fcl and against brute force."""

import fcl
import numpy as np
import pytest

from app.sim.cells.cell import load_cell
from app.sim.collision.fcl_recheck import robot_ends, segment_distances
from app.sim.collision.fcl_reference import make_capsule, touch
from app.sim.geometry import capsules as columns
from app.sim.geometry import segments as geometry
from app.sim.geometry.capsules import capsules_soa, ends_of
from app.sim.robot.capsules import load_robot_capsules
from app.sim.robot.kernels import arm as arm_kernel
from app.sim.robot.ur10 import Robot
from app.sim.scene.scene import arm_of

KINDS = ("random", "parallel", "crossing", "points", "collinear", "one point")


def segments(kind: str, n: int = 300) -> tuple[np.ndarray, np.ndarray]:
    """Two arrays of segments (n, 2, 3) [m], of a kind that is hard for one branch."""
    rng = np.random.default_rng(41)
    a, b = rng.uniform(-0.6, 0.6, (2, n, 2, 3))
    if kind == "parallel":
        b[:, 1] = b[:, 0] + rng.uniform(-2, 2, (n, 1)) * (a[:, 1] - a[:, 0])
    elif kind == "crossing":
        b += a.mean(axis=1, keepdims=True) - b.mean(axis=1, keepdims=True)
    elif kind == "points":
        a[:, 1], b[:, 1] = a[:, 0], b[:, 0]
    elif kind == "collinear":
        b = a[:, :1] + rng.uniform(-3, 3, (n, 2, 1)) * (a[:, 1:] - a[:, :1])
    elif kind == "one point":
        a[:, 1] = a[:, 0]
    return a, b


def distance(a: np.ndarray, radius_a: float, b: np.ndarray, radius_b: float) -> float:
    """Distance of two capsules, by the kernel for sets."""
    out = np.empty(1)
    columns.distances(
        capsules_soa(a[None], np.array([radius_a])),
        0,
        capsules_soa(b[None], np.array([radius_b])),
        out,
    )
    return float(out[0])


@pytest.mark.parametrize("kind", KINDS)
def test_capsule_distance_equals_fcls_where_they_are_apart(kind: str) -> None:
    request = fcl.DistanceRequest(gjk_solver_type=fcl.GJKSolverType.GST_INDEP)
    for a, b in zip(*segments(kind), strict=True):
        d = distance(a, 0.05, b, 0.04)
        one, two = make_capsule(0.05, *a), make_capsule(0.04, *b)
        if d > 1e-3:
            assert abs(fcl.distance(one, two, request, fcl.DistanceResult()) - d) < 1e-6


@pytest.mark.parametrize("kind", KINDS)
def test_capsules_overlap_exactly_where_fcl_says_so(kind: str) -> None:
    for a, b in zip(*segments(kind), strict=True):
        d = distance(a, 0.12, b, 0.11)
        if abs(d) > 1e-5:
            assert touch(make_capsule(0.12, *a), make_capsule(0.11, *b)) == (d < 0)


@pytest.mark.parametrize("kind", KINDS)
def test_capsule_distance_is_symmetric_and_never_above_that_of_sampled_points(
    kind: str,
) -> None:
    share = np.linspace(0.0, 1.0, 41)[:, None]
    for a, b in zip(*segments(kind, 100), strict=True):
        d = distance(a, 0.0, b, 0.0)
        assert distance(b, 0.0, a, 0.0) == pytest.approx(d, abs=1e-9)
        points_a, points_b = a[0] + share * (a[1] - a[0]), b[0] + share * (b[1] - b[0])
        sampled = np.linalg.norm(points_a[:, None] - points_b, axis=2).min()
        assert d <= sampled + 1e-9
        assert sampled - d < 0.06


def test_set_distances_are_the_least_of_all_pairs() -> None:
    rng = np.random.default_rng(42)
    for n, m in [(12, 16), (12, 12), (5, 24), (1, 8), (12, 48)]:
        a, b = rng.uniform(-0.6, 0.6, (n, 2, 3)), rng.uniform(-0.6, 0.6, (m, 2, 3))
        radius_a, radius_b = rng.uniform(0.01, 0.1, n), rng.uniform(0.01, 0.1, m)
        expected = segment_distances(a[:, None, 0], a[:, None, 1], b[:, 0], b[:, 1])
        expected = expected - radius_a[:, None] - radius_b
        one, two = capsules_soa(a, radius_a), capsules_soa(b, radius_b)
        out, part = np.empty(m), np.empty(m)
        columns.capsule_clearances(one, two, out)
        np.testing.assert_allclose(out, expected.min(axis=0), atol=1e-12)
        columns.nearest_parts(two, m, one, 0, n - 1, out, part)
        np.testing.assert_allclose(out, expected.min(axis=0), atol=1e-12)
        np.testing.assert_array_equal(part, expected.argmin(axis=0))
        assert columns.least(out)[1] == expected.min(axis=0).argmin()


def test_pairs_of_one_set_are_measured_one_by_one() -> None:
    rng = np.random.default_rng(44)
    ends, radius = rng.uniform(-0.6, 0.6, (12, 2, 3)), rng.uniform(0.01, 0.1, 12)
    first, second = rng.integers(0, 12, (2, 17))
    out = np.empty(17)
    columns.pair_distances(capsules_soa(ends, radius), first, second, out)
    for d, i, j in zip(out, first, second, strict=True):
        assert d == pytest.approx(distance(ends[i], radius[i], ends[j], radius[j]), abs=1e-12)


def test_columns_that_fill_up_a_set_are_nowhere_near() -> None:
    rng = np.random.default_rng(45)
    one = capsules_soa(rng.uniform(-1, 1, (3, 2, 3)), np.full(3, 0.1))
    two = capsules_soa(rng.uniform(-1, 1, (3, 2, 3)), np.full(3, 0.1), columns.padded_size(3))
    out = np.empty(8)
    columns.capsule_clearances(one, two, out)
    assert (out[:3] < 5.0).all() and (out[3:] > 900.0).all()


def test_greatest_displacement_is_that_of_the_farthest_moved_end() -> None:
    rng = np.random.default_rng(46)
    before, after = rng.uniform(-1, 1, (2, 7, 2, 3))
    found = columns.greatest_displacement(
        capsules_soa(before, np.ones(7)), capsules_soa(after, np.ones(7))
    )
    assert found == pytest.approx(np.linalg.norm(after - before, axis=2).max())


def test_nearest_vector_leads_from_one_segment_to_the_other() -> None:
    gap, radius = np.empty(3), np.zeros(1)
    for a, b in zip(*segments("random"), strict=True):
        one, two = capsules_soa(a[None], radius), capsules_soa(b[None], radius)
        length = geometry.segment_nearest(one, 0, two, 0, gap)
        assert length == pytest.approx(np.linalg.norm(gap), abs=1e-12)
        assert distance(a + gap, 0.0, b, 0.0) < 1e-7


def test_placed_capsules_are_those_that_pinocchio_places() -> None:
    robot, capsules, arm = Robot(), load_robot_capsules(), arm_of(load_cell())
    pose = arm_kernel.new_robot_pose(arm)
    for q in np.random.default_rng(43).uniform(-6, 6, (50, 6)):
        arm_kernel.place_robot(arm, q, pose)
        p0, p1 = robot_ends(robot, capsules, q[None])
        ends = ends_of(pose.capsules, len(capsules.name))
        np.testing.assert_allclose(ends[:, 0], p0[0], atol=1e-12)
        np.testing.assert_allclose(ends[:, 1], p1[0], atol=1e-12)
        np.testing.assert_allclose(pose.tcp, robot.tcp_pose(q)[:3, 3], atol=1e-9)
