"""The capsules contain the meshes, and the list of pairs misses no self-collision."""

import numpy as np
import pytest

from app.sim.cells.cell import load_cell
from app.sim.collision.fcl_recheck import robot_ends, segment_distances
from app.sim.collision.fcl_reference import collision_mesh
from app.sim.robot import capsules as shapes
from app.sim.robot.ur10 import LINK_NAMES, Robot
from tests.sim.mesh_reference import MeshReference
from tools.fit_capsules import clip_slab, fit_capsule, segment_distance


def halve(triangles: np.ndarray) -> np.ndarray:
    """Split each triangle (n, 3, 3) at the middle of its longest edge."""
    edges = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2)
    first = edges.argmax(axis=1)
    order = (first[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(triangles, order[..., None], axis=1).transpose(1, 0, 2)
    middle = 0.5 * (a + b)
    return np.concatenate([np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)])


def uncovered(triangles: np.ndarray, capsules: shapes.RobotCapsules, link: int) -> np.ndarray:
    """Triangles that no single convex capsule of the link contains."""
    inside = np.zeros(len(triangles), dtype=bool)
    for i in np.flatnonzero(capsules.link == link):
        reach = segment_distance(triangles.reshape(-1, 3), capsules.p0[i], capsules.p1[i])
        inside |= (reach.reshape(-1, 3) <= capsules.radius[i]).all(axis=1)
    return triangles[~inside]


@pytest.mark.parametrize("link", LINK_NAMES)
def test_every_triangle_of_the_mesh_lies_inside_the_links_capsules(link: str) -> None:
    capsules = shapes.load_robot_capsules()
    left = np.asarray(collision_mesh(link).triangles)
    for _ in range(40):
        left = uncovered(left, capsules, LINK_NAMES.index(link))
        if not len(left):
            break
        left = halve(left)
    assert len(left) == 0


def test_capsules_add_at_most_the_corners_that_a_capsule_must_add() -> None:
    capsules = shapes.load_robot_capsules()
    for link, most in zip(LINK_NAMES, (0.05, 0.04, 0.04, 0.04, 0.03, 0.03, 0.02), strict=True):
        points = collision_mesh(link).sample(2000, seed=5)
        depth = np.max(
            [
                capsules.radius[i] - segment_distance(points, capsules.p0[i], capsules.p1[i])
                for i in np.flatnonzero(capsules.link == LINK_NAMES.index(link))
            ],
            axis=0,
        )
        assert depth.mean() < most


def test_tool_capsule_ends_exactly_at_the_tcp() -> None:
    robot, capsules = Robot(0.15), shapes.load_robot_capsules(0.15, 0.03)
    q = np.array([0.3, -1.2, 0.9, -1.0, -1.5, 0.4])
    p0, p1 = robot_ends(robot, capsules, q[None])
    tcp = robot.tcp_pose(q)
    np.testing.assert_allclose(p1[0, -1] + 0.03 * tcp[:3, 2], tcp[:3, 3], atol=1e-9)
    np.testing.assert_allclose(p0[0, -1], tcp[:3, 3] - 0.15 * tcp[:3, 2], atol=1e-9)


def test_fitted_capsule_contains_its_points_and_is_not_larger_than_the_known_one() -> None:
    rng = np.random.default_rng(3)
    direction = rng.normal(size=(400, 3))
    ball = 0.1 * direction / np.linalg.norm(direction, axis=1)[:, None]
    points = ball + np.linspace([-0.2, 0, 0], [0.2, 0.1, 0], 400)
    p0, p1, radius = fit_capsule(points)
    assert segment_distance(points, p0, p1).max() <= radius
    assert radius <= 0.1 + 1e-3


def test_clipped_slab_has_corners_on_both_planes() -> None:
    triangle = np.array([[[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0]]])
    points = clip_slab(triangle, 0.25, 0.5)
    assert points[:, 2].min() == 0.25 and points[:, 2].max() == 0.5
    assert len(points) == 4


@pytest.mark.parametrize("tool", [(0.12, 0.04), (0.12, 0.08), (0.2, 0.08), (0.6, 0.05)])
def test_capsule_pairs_report_every_self_collision_of_the_meshes(
    tool: tuple[float, float],
) -> None:
    cell = load_cell()
    mount = cell.robot.model_copy(update={"tool_length": tool[0], "tool_radius": tool[1]})
    cell = cell.model_copy(update={"robot": mount})
    reference, robot = MeshReference(cell), Robot(tool[0])
    capsules = shapes.load_robot_capsules(*tool)
    n = 6000 if tool == shapes.SMALL_TOOL else 2000
    q = np.random.default_rng(7).uniform(cell.robot.q_min, cell.robot.q_max, (n, 6))
    p0, p1 = robot_ends(robot, capsules, q)
    i, j = shapes.self_pairs(capsules).T
    gap = segment_distances(p0[:, i], p1[:, i], p0[:, j], p1[:, j])
    reported = (gap <= capsules.radius[i] + capsules.radius[j]).any(axis=1)
    collides = np.array(
        [any(one.kind == "self" for one in reference.contacts(row)) for row in q]
    )
    assert collides.mean() > 0.08
    assert not (collides & ~reported).any()
    assert (reported & ~collides).mean() < (0.03 if tool == shapes.SMALL_TOOL else 0.12)


def test_capsules_are_free_of_each_other_in_all_working_postures() -> None:
    cell, robot, capsules = load_cell(), Robot(), shapes.load_robot_capsules()
    limits = np.array(cell.robot.q_min), np.array(cell.robot.q_max)
    positions = np.random.default_rng(8).uniform([-0.7, 0.35, 0.05], [0.7, 0.85, 0.4], (500, 3))
    postures = [robot.ik_vertical(position, *limits) for position in positions]
    q = np.array([posture for posture in postures if posture is not None])
    assert len(q) > 450
    p0, p1 = robot_ends(robot, capsules, q)
    i, j = shapes.self_pairs(capsules).T
    gap = segment_distances(p0[:, i], p1[:, i], p0[:, j], p1[:, j])
    assert (gap - capsules.radius[i] - capsules.radius[j]).min() > 0.02


def test_loaded_capsules_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="read-only"):
        shapes.load_robot_capsules().radius[0] = 0.0


def test_no_point_of_the_robot_is_farther_from_an_axis_than_its_lever() -> None:
    robot, capsules = Robot(0.2), shapes.load_robot_capsules(0.2, 0.05)
    most = shapes.levers(0.2, 0.05)
    stretched = np.zeros((5, 6))
    stretched[:, 3] = np.linspace(-0.7, 0.7, 5)
    q = np.vstack([stretched, np.random.default_rng(9).uniform(-np.pi, np.pi, (1500, 6))])
    ends = np.stack(robot_ends(robot, capsules, q))
    for joint, axis in enumerate((2, 1, 1, 1, 2, 1)):
        poses = np.stack([robot.link_poses(row)[joint + 1] for row in q])
        moved = capsules.link > joint
        offset = ends[:, :, moved] - poses[None, :, None, :3, 3]
        across = np.cross(offset, poses[None, :, None, :3, axis])
        reach = np.linalg.norm(across, axis=-1) + capsules.radius[moved]
        assert reach.max() <= most[joint]
        assert reach.max() > 0.85 * most[joint]
