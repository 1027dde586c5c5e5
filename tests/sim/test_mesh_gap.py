"""Exact distances to triangles, and what the capsules add to the UR10's meshes."""

import numpy as np
import pytest
import trimesh

from app.sim.cells.cell import load_cell
from app.sim.geometry.box import box_clearance
from app.sim.geometry.capsules import capsules_soa
from app.sim.robot.capsules import TOOL
from app.sim.scene.scene import arm_of
from tests.sim.mesh_gap import gaps, segment_to_triangles

GOAL = 0.015
"""Mean gap of capsules and meshes that the fit is held to [m]."""


def test_distance_to_a_boxs_triangles_is_that_to_the_box() -> None:
    rng, half = np.random.default_rng(71), np.array([0.2, 0.3, 0.1])
    corners = np.asarray(trimesh.creation.box(2.0 * half).triangles)
    box, n_apart = np.array([[0.0, 0.0, 0.0, *half, 0.0]]), 0
    for ends in rng.uniform(-0.7, 0.7, (2000, 2, 3)):
        d, _, _ = box_clearance(capsules_soa(ends[None], np.zeros(1)), 0, box)
        assert segment_to_triangles(*ends, corners) == pytest.approx(max(d, 0.0), abs=1e-9)
        n_apart += d > 0.0
    assert 500 < n_apart < 1900


def test_distance_to_one_triangle_is_never_above_that_of_sampled_points() -> None:
    rng, share = np.random.default_rng(72), np.linspace(0.0, 1.0, 30)
    a, b = (grid.ravel()[:, None] for grid in np.meshgrid(share, share))
    inside = (a + b <= 1.0)[:, 0]
    for _ in range(300):
        corners, (p0, p1) = rng.uniform(-1, 1, (3, 3)), rng.uniform(-1, 1, (2, 3))
        face = (corners[0] + a * (corners[1] - corners[0]) + b * (corners[2] - corners[0]))[
            inside
        ]
        line = p0 + share[:, None] * (p1 - p0)
        sampled = np.linalg.norm(face[:, None] - line, axis=2).min()
        d = segment_to_triangles(p0, p1, corners[None])
        assert d <= sampled + 1e-9
        assert sampled - d < 0.12


def test_capsules_are_never_farther_than_the_meshes_and_on_average_not_much_nearer() -> None:
    cell = load_cell()
    found = gaps(cell, arm_of(cell), 250, 73)
    gap = np.array([one.meshes - one.capsules for one in found])
    links = gap[[one.nearest != TOOL for one in found]]
    assert len(links) > 80
    assert gap.min() > -1e-9
    assert links.mean() < GOAL
