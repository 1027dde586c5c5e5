"""Distances of capsules to turned boxes against python-fcl and by hand."""

import fcl
import numpy as np
import pytest

from app.sim.core.jit import FAR
from app.sim.geometry.box import box_clearance
from app.sim.geometry.capsules import capsules_soa, new_capsules
from tests.sim.fcl_capsules import KINDS, check_against_fcl, random_ends

TABLE = np.array([[0.0, 0.4, -0.02, 1.0, 0.5, 0.02, 0.0]])


def fcl_box(box: np.ndarray) -> fcl.CollisionObject:
    c, s = np.cos(box[6]), np.sin(box[6])
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return fcl.CollisionObject(fcl.Box(*(2.0 * box[3:6])), fcl.Transform(turn, box[:3]))


def random_boxes(n: int, seed: int) -> np.ndarray:
    low, high = [-0.5, -0.5, 0.0, 0.02, 0.02, 0.02, -3.2], [0.5, 0.5, 1.0, 0.6, 0.6, 0.6, 3.2]
    boxes = np.random.default_rng(seed).uniform(low, high, (n, 7))
    boxes[::3, 6] = 0.0
    return boxes


@pytest.mark.parametrize("kind", KINDS)
def test_distance_and_overlap_are_fcls(kind: str) -> None:
    n = KINDS[kind]
    for ends, box in zip(random_ends(n, 21, kind), random_boxes(n, 22), strict=True):
        d, _, _ = box_clearance(capsules_soa(ends[None], np.array([0.05])), 0, box[None])
        check_against_fcl(ends, 0.05, fcl_box(box), d)


def test_capsule_over_a_table_is_measured_upward() -> None:
    ends = np.array([[[-0.3, 0.2, 0.3], [0.4, 0.8, 0.25]]])
    d, _, _ = box_clearance(capsules_soa(ends, np.array([0.1])), 0, TABLE)
    assert d == pytest.approx(0.15)


def test_capsule_past_a_turned_corner_is_measured_to_the_edge() -> None:
    box = np.array([[0.0, 0.0, 0.0, 0.5, 0.5, 1.0, np.pi / 4]])
    ends = np.array([[[1.0, -0.4, 0.0], [1.0, 0.9, 0.3]]])
    d, _, _ = box_clearance(capsules_soa(ends, np.array([0.1])), 0, box)
    assert d == pytest.approx(1.0 - np.sqrt(0.5) - 0.1)


def test_segment_inside_a_box_counts_as_its_radius_deep() -> None:
    ends = np.array([[[0.0, 0.4, -0.3], [0.1, 0.4, 0.5]]])
    d, _, _ = box_clearance(capsules_soa(ends, np.array([0.1])), 0, TABLE)
    assert d == pytest.approx(-0.1)


def test_least_of_many_is_the_least_of_each_and_is_named() -> None:
    radii = np.random.default_rng(3).uniform(0.02, 0.2, 12)
    for seed in range(200):
        capsules = capsules_soa(random_ends(12, seed, "any") + [0.0, 1.2, 0.0], radii)
        boxes = random_boxes(4, seed)
        each = np.array(
            [
                [
                    box_clearance(np.ascontiguousarray(capsules[:, [k]]), 0, boxes[[b]])[0]
                    for b in range(4)
                ]
                for k in range(2, 12)
            ]
        )
        d, k, b = box_clearance(capsules, 2, boxes)
        assert d == each.min() and each[k - 2, b] == d


def test_nothing_is_far() -> None:
    assert box_clearance(new_capsules(8, np.zeros(0)), 1, TABLE) == (FAR, 1, 0)
    capsule = capsules_soa(np.zeros((1, 2, 3)), np.array([0.1]))
    assert box_clearance(capsule, 0, np.zeros((0, 7))) == (FAR, 0, 0)
