"""The safety cylinder: smallest around the box, and wide enough for what is unseen."""

import numpy as np
import pytest

from app.sim.human import model as human
from app.sim.human.anthropometry import percentile_body
from app.sim.perception.bounding_cylinder import bounding_box, safety_cylinder
from app.sim.perception.keypoints import GROUPS, K, keypoints_of
from tests.sim.perception.cylinder_contents import holds
from tests.sim.tracked_person import CELL, seen, work


def test_box_of_a_turned_box_is_that_box() -> None:
    rng = np.random.default_rng(5)
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    inside = rng.uniform(0.0, 1.0, (50, 3))
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    unit = np.concatenate([signs, *(inside * sign for sign in signs)])
    points = unit * [0.2, 0.4, 0.9] @ turn + [1.0, 2.0, 3.0]
    corners = bounding_box(points)
    edges = np.linalg.norm(corners[[1, 2, 4]] - corners[0], axis=1)
    np.testing.assert_allclose(sorted(edges), [0.4, 0.8, 1.8], atol=1e-9)
    np.testing.assert_allclose(corners.mean(axis=0), [1.0, 2.0, 3.0], atol=1e-9)


def test_no_smaller_cylinder_holds_the_box() -> None:
    rng = np.random.default_rng(6)
    for q in work(1, 12.0)[1][::20]:
        corners = bounding_box(seen(q))[:, :2]
        found = safety_cylinder(seen(q), flesh_margin=0.0)
        assert found is not None
        for center in found.center + 0.2 * rng.standard_normal((200, 2)):
            radius = np.linalg.norm(corners - center, axis=1).max()
            assert radius >= found.radius / 1.1 - 1e-9


def test_cylinder_holds_all_keypoints_and_the_whole_surface_of_the_body() -> None:
    for seed in (1, 2, 3):
        for q in work(seed, 12.0)[1][::5]:
            points = seen(q)
            found = safety_cylinder(points)
            assert found is not None and holds(found, points)
            ends = human.capsules(q, CELL.body, CELL.floor_z)
            radii = human.CAPSULE_RADII[:, None]
            away = np.linalg.norm(ends[:, :, :2] - found.center, axis=2) + radii
            assert away.max() <= found.radius
            assert (ends[:, :, 2] + radii).max() <= found.top


@pytest.mark.parametrize("percentile", [5.0, 50.0, 95.0])
def test_cylinder_holds_the_body_in_any_posture_of_the_model(percentile: float) -> None:
    """Among them arms stretched up, whose fingertips no key-point shows."""
    size = percentile_body(percentile, percentile, percentile).vector(CELL.floor_z)
    radii = human.capsule_radii(size)[:, None]
    for q in np.random.default_rng(7).uniform(human.Q_MIN, human.Q_MAX, (400, 18)):
        found = safety_cylinder(keypoints_of(q, size, CELL.floor_z))
        assert found is not None
        ends = human.capsules(q, size, CELL.floor_z)
        away = np.linalg.norm(ends[:, :, :2] - found.center, axis=2) + radii
        assert away.max() <= found.radius
        assert (ends[:, :, 2] + radii).max() <= found.top


def test_an_arm_never_seen_is_inside_wherever_it_is() -> None:
    for seed in (1, 2, 3):
        for q in work(seed, 12.0)[1][::5]:
            points = seen(q)
            partial = points.copy()
            partial[[K[n] for n in ("elbow_r", "wrist_r", "wrist_l", "nose")]] = np.nan
            partial[GROUPS["face"]] = np.nan
            found = safety_cylinder(partial)
            assert found is not None and holds(found, points)


@pytest.mark.parametrize("hidden", [["wrist_r"], ["wrist_r", "elbow_r"]])
def test_the_hand_of_an_unseen_stretched_arm_is_inside(hidden: list[str]) -> None:
    size = percentile_body(95.0, 95.0, 50.0, CELL.human.pelvis_height).vector(CELL.floor_z)
    radii = human.capsule_radii(size)[:10, None]  # the legs are taken to stand below the hips
    for lean, lift in ((0.0, 0.0), (0.3, 0.5), (0.6, 1.5)):
        q = human.rest_posture(0.0, 1.45, -np.pi / 2.0)
        q[[3, 10, 11, 13]] = lean, 1.57, lift, 0.0
        points = keypoints_of(q, size, CELL.floor_z)
        points[[K[name] for name in hidden]] = np.nan
        found = safety_cylinder(points)
        assert found is not None
        ends = human.capsules(q, size, CELL.floor_z)[:10, :, :2]
        away = np.linalg.norm(ends - found.center, axis=2) + radii
        assert away.max() <= found.radius


@pytest.mark.parametrize("names", [["neck"], ["wrist_r"], ["mid_hip", "nose"], ["ankle_l"]])
def test_one_keypoint_alone_bounds_the_whole_person(names: list[str]) -> None:
    for q in work(3, 12.0)[1][::20]:
        partial = np.full((25, 3), np.nan)
        members = [K[name] for name in names]
        partial[members] = seen(q)[members]
        found = safety_cylinder(partial)
        points = np.array(list(human.joint_points(q, CELL.body).values()))
        assert found is not None and holds(found, points)


def test_nothing_seen_gives_no_cylinder() -> None:
    assert safety_cylinder(np.full((25, 3), np.nan)) is None
