"""Distances of capsules against python-fcl and against brute force."""

import fcl
import numpy as np
import pytest

from app.sim.collision import make_capsule, touch
from app.sim.kernels import geometry
from app.sim.recheck import robot_ends
from app.sim.robot import Robot
from app.sim.shapes import load_robot_capsules

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


@pytest.mark.parametrize("kind", KINDS)
def test_capsule_distance_equals_fcls_where_they_are_apart(kind: str) -> None:
    request = fcl.DistanceRequest(gjk_solver_type=fcl.GJKSolverType.GST_INDEP)
    for a, b in zip(*segments(kind), strict=True):
        d = geometry.capsule_distance(a, 0.05, b, 0.04)
        one, two = make_capsule(0.05, *a), make_capsule(0.04, *b)
        if d > 1e-3:
            assert abs(fcl.distance(one, two, request, fcl.DistanceResult()) - d) < 1e-6


@pytest.mark.parametrize("kind", KINDS)
def test_capsules_overlap_exactly_where_fcl_says_so(kind: str) -> None:
    for a, b in zip(*segments(kind), strict=True):
        d = geometry.capsule_distance(a, 0.12, b, 0.11)
        if abs(d) > 1e-5:
            assert touch(make_capsule(0.12, *a), make_capsule(0.11, *b)) == (d < 0)


@pytest.mark.parametrize("kind", KINDS)
def test_capsule_distance_is_symmetric_and_never_above_that_of_sampled_points(
    kind: str,
) -> None:
    share = np.linspace(0.0, 1.0, 41)[:, None]
    for a, b in zip(*segments(kind, 100), strict=True):
        d = geometry.capsule_distance(a, 0.0, b, 0.0)
        assert geometry.capsule_distance(b, 0.0, a, 0.0) == pytest.approx(d, abs=1e-9)
        points_a, points_b = a[0] + share * (a[1] - a[0]), b[0] + share * (b[1] - b[0])
        sampled = np.linalg.norm(points_a[:, None] - points_b, axis=2).min()
        assert d <= sampled + 1e-9
        assert sampled - d < 0.06


def test_clearance_of_sets_is_the_least_of_all_pairs() -> None:
    rng = np.random.default_rng(42)
    for _ in range(200):
        a, b = rng.uniform(-0.6, 0.6, (12, 2, 3)), rng.uniform(-0.6, 0.6, (12, 2, 3))
        b += rng.uniform(0, 1.5)
        radius_a, radius_b = rng.uniform(0.01, 0.1, (2, 12))
        d, k, h = geometry.set_clearance(a, radius_a, b, radius_b, 2, 9, geometry.FAR)
        pairs = [
            (geometry.capsule_distance(a[i], radius_a[i], b[j], radius_b[j]), i, j)
            for i in range(12)
            for j in range(2, 10)
        ]
        least, i, j = min(pairs)
        assert (k, h) == (i, j)
        assert d == pytest.approx(least, abs=1e-12)


def test_clearance_beyond_the_cap_is_the_cap() -> None:
    a, b = np.zeros((1, 2, 3)), np.full((1, 2, 3), 2.0)
    radius = np.array([0.1])
    assert geometry.set_clearance(a, radius, b, radius, 0, 0, 1.5)[0] == 1.5


def test_nearest_vector_leads_from_one_segment_to_the_other() -> None:
    gap = np.empty(3)
    for a, b in zip(*segments("random"), strict=True):
        length = geometry.segment_nearest(a, b, gap)
        assert length == pytest.approx(np.linalg.norm(gap), abs=1e-12)
        assert geometry.capsule_distance(a + gap, 0.0, b, 0.0) < 1e-7


def test_placed_capsules_are_those_that_pinocchio_places() -> None:
    robot, capsules = Robot(), load_robot_capsules()
    out = np.empty((len(capsules.name), 2, 3))
    for q in np.random.default_rng(43).uniform(-6, 6, (50, 6)):
        poses = robot.link_poses(q)
        rot, pos = poses[:, :3, :3].copy(), poses[:, :3, 3].copy()
        geometry.place_capsules(rot, pos, capsules.link, capsules.p0, capsules.p1, 0, out)
        p0, p1 = robot_ends(robot, capsules, q[None])
        np.testing.assert_allclose(out[:, 0], p0[0], atol=1e-12)
        np.testing.assert_allclose(out[:, 1], p1[0], atol=1e-12)
