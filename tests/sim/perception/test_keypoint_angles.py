"""Joint angles in closed form: the inverse of the forward kinematics."""

import numpy as np
import pytest

from app.sim.human import model as human
from app.sim.perception.keypoint_angles import joint_angles
from app.sim.perception.keypoints import K
from tests.sim.tracked_person import CELL, seen, work

SIZE = CELL.body
REST = human.rest_posture(0.0, 0.0, 0.0)


def random_postures(n: int) -> np.ndarray:
    """Inside the limits, elbows bent, clavicles protracted alike: what points can tell."""
    q = np.random.default_rng(31).uniform(human.Q_MIN, human.Q_MAX, (n, 18))
    q[:, 2] = (q[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
    q[:, 8], q[:, 9] = q[:, 6], q[:, 7]
    q[:, [13, 17]] = np.clip(q[:, [13, 17]], 0.2, 2.6)
    return q


def without(points: np.ndarray, *names: str) -> np.ndarray:
    out = points.copy()
    out[[K[name] for name in names]] = np.nan
    return out


def test_exact_keypoints_of_random_postures_give_their_joints_back() -> None:
    misses = []
    for q in random_postures(300):
        # The last posture decides between two equal triples of angles, and the pole's weight.
        found, held = joint_angles(seen(q), q, SIZE)
        misses.append(np.abs(found - q).max())
        assert not held.any()
    assert np.max(misses) < 1e-6


def test_arms_and_trunk_of_random_postures_are_found_from_rest() -> None:
    away = []
    for q in random_postures(300):
        found, _ = joint_angles(seen(q), REST, SIZE)
        one, other = (human.joint_points(p, SIZE) for p in (q, found))
        away.append([np.linalg.norm(one[name] - other[name]) for name in human.POINT_NAMES])
    names = [human.POINT_NAMES.index(name) for name in ("neck", "shoulder_r", "shoulder_l")]
    assert np.max(np.array(away)[:, names]) < 1e-9
    assert np.percentile(away, 98) < 0.01 and np.max(away) < 0.03


def test_joints_never_leave_their_limits_whatever_is_seen() -> None:
    rng, q = np.random.default_rng(32), REST
    for _ in range(400):
        points = rng.uniform(-1.0, 1.0, (25, 3))
        points[rng.random(25) < 0.3] = np.nan
        q, held = joint_angles(points, q, SIZE)
        assert np.isfinite(q).all() and held.shape == (18,)
        assert (q >= human.Q_MIN).all() and (q <= human.Q_MAX).all()


@pytest.mark.parametrize("value", [0.0, 1.0])
def test_keypoints_in_one_place_give_a_posture(value: float) -> None:
    q, _ = joint_angles(np.full((25, 3), value), REST, SIZE)
    assert np.isfinite(q).all()


def test_nothing_seen_holds_every_joint() -> None:
    before = work(1, 12.0)[1][50]
    q, held = joint_angles(np.full((25, 3), np.nan), before, SIZE)
    np.testing.assert_allclose(q, before)
    assert held.all()


def test_an_unseen_arm_keeps_its_angles_and_the_other_follows() -> None:
    q = work(1, 12.0)[1][120]
    points = without(seen(q), "elbow_r", "wrist_r")
    found, held = joint_angles(points, REST, SIZE)
    np.testing.assert_array_equal(found[10:14], REST[10:14])
    assert list(np.flatnonzero(held)) == [10, 11, 12, 13]
    joints, truth = (human.joint_points(p, SIZE) for p in (found, q))
    assert np.linalg.norm(joints["wrist_l"] - truth["wrist_l"]) < 1e-6


@pytest.mark.parametrize(
    ("unseen", "other", "unknown"),
    [("wrist_l", "elbow_l", [16, 17]), ("elbow_l", "wrist_l", [16])],
)
def test_an_unseen_point_of_an_arm_leaves_the_other_where_it_is(
    unseen: str, other: str, unknown: list[int]
) -> None:
    q = work(1, 12.0)[1][120]
    found, held = joint_angles(without(seen(q), unseen), REST, SIZE)
    joints, truth = (human.joint_points(p, SIZE) for p in (found, q))
    assert np.linalg.norm(joints[other] - truth[other]) < 1e-6
    assert list(np.flatnonzero(held)) == unknown


def test_sides_stand_in_for_a_missing_middle() -> None:
    q = work(1, 12.0)[1][120]
    found, held = joint_angles(without(seen(q), "mid_hip"), q, SIZE)
    np.testing.assert_allclose(found, q, atol=1e-6)
    assert not held.any()


def test_hidden_hips_hold_place_and_yaw_but_for_the_shoulders_turn() -> None:
    q = work(1, 12.0)[1][120]
    found, held = joint_angles(without(seen(q), "mid_hip", "hip_r", "hip_l"), q, SIZE)
    assert set(np.flatnonzero(held)) == {0, 1, 2, 3, 4, 5}
    np.testing.assert_allclose(found[:2], q[:2])


def test_a_person_of_other_size_has_the_wrists_where_they_are_if_in_reach() -> None:
    for scale in (0.93, 1.07):
        for q in work(1, 12.0)[1][::30]:
            points = seen(q)
            root = points[K["mid_hip"]]
            points = root + scale * (points - root)
            found, _ = joint_angles(points, q, SIZE)
            joints = human.joint_points(found, SIZE)
            for s in "rl":
                assert np.linalg.norm(joints[f"wrist_{s}"] - points[K[f"wrist_{s}"]]) < 0.001


def test_the_yaw_goes_on_past_a_half_turn() -> None:
    q, before = human.rest_posture(0.0, 0.0, 3.0), human.rest_posture(0.0, 0.0, 3.0)
    for yaw in np.arange(3.0, 3.6, 0.05):
        q[2] = yaw
        before, _ = joint_angles(seen(q), before, SIZE)
        assert before[2] == pytest.approx(yaw)
