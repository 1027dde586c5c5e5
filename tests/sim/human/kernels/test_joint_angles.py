"""Formulas of limbs: the inverse of the person's forward kinematics, for one and for many."""

import numpy as np

from app.sim.human import model as human
from app.sim.human.anthropometry import percentile_body
from app.sim.human.kernels import joint_angles
from app.sim.perception.kernels import pose_fit as keypoint_fit
from app.sim.perception.keypoints import BODY_25, K, keypoints_of


def turned(q: np.ndarray) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    frames = human.body_frames(q, percentile_body().vector(0.0))
    return frames["torso"][:3, :3], {name: frame[:3, :3] for name, frame in frames.items()}


def postures(n: int, seed: int) -> np.ndarray:
    q = np.random.default_rng(seed).uniform(human.Q_MIN, human.Q_MAX, (n, 18))
    q[:, 2], q[:, [11, 15]] = 0.0, np.clip(q[:, [11, 15]], -0.8, 1.5)
    return q


def test_torsos_give_their_angles_back() -> None:
    q, out = postures(50, 3), np.empty((50, 3))
    joint_angles.turns_to_angles(np.array([turned(row)[0] for row in q]), out)
    np.testing.assert_allclose(out, q[:, 3:6], atol=1e-12)


def test_arms_of_either_side_give_their_angles_back() -> None:
    q = postures(50, 4)
    for hand, side, first in (("r", -1.0, 10), ("l", 1.0, 14)):
        upper, toward = np.empty((50, 3)), np.empty((50, 3))
        for k, row in enumerate(q):
            torso, frames = turned(row)
            arm = torso.T @ frames[f"upper_arm_{hand}"]
            upper[k], toward[k] = -arm[:, 2], 0.3 * arm[:, 0]
        out = np.empty((50, 3))
        joint_angles.arms_to_angles(upper, toward, side, out)
        turns = (out - q[:, first : first + 3]) / (2.0 * np.pi)
        np.testing.assert_allclose(turns, np.rint(turns), atol=1e-9)


def test_clavicles_of_either_side_give_their_angles_back() -> None:
    angles = np.random.default_rng(5).uniform(-0.5, 0.5, (20, 2))
    a, b = angles.T
    for side in (-1.0, 1.0):
        directions = np.column_stack(
            [np.cos(b) * np.sin(a), side * np.cos(b) * np.cos(a), np.sin(b)]
        )
        out = np.empty((20, 2))
        joint_angles.clavicles_to_angles(directions, side, out)
        np.testing.assert_allclose(out, angles, atol=1e-12)


def test_person_whose_left_is_y_heads_along_x() -> None:
    across = np.array([[0.0, 0.3], [-0.3, 0.0], [0.0, -0.3]])
    np.testing.assert_allclose(joint_angles.headings(across), [0.0, np.pi / 2, -np.pi])


def test_the_fit_counts_key_points_in_the_order_of_body_25() -> None:
    assert (K["neck"], K["mid_hip"], K["hip_r"], K["hip_l"]) == (
        keypoint_fit.NECK,
        keypoint_fit.MID_HIP,
        keypoint_fit.HIP_R,
        keypoint_fit.HIP_L,
    )
    for first, hand in zip(keypoint_fit.SHOULDERS, "rl", strict=True):
        names = BODY_25[first : first + 3]
        assert names == (f"shoulder_{hand}", f"elbow_{hand}", f"wrist_{hand}")


def test_people_of_any_size_are_fitted_when_their_size_is_known() -> None:
    rng, held = np.random.default_rng(6), np.empty(18, dtype=np.bool_)
    for _ in range(50):
        size = percentile_body(*rng.uniform(5.0, 95.0, 3)).vector(-0.75)
        q = human.rest_posture(*rng.uniform(-1.0, 1.0, 3))
        q[10:18] += rng.uniform(-0.15, 0.6, 8)
        found = human.rest_posture(0.0, 0.0, 0.0)
        keypoint_fit.fit_joints(
            keypoints_of(q, size, -0.75),
            size,
            human.Q_MIN.copy(),
            human.Q_MAX.copy(),
            keypoint_fit.new_fit_space(),
            found,
            held,
        )
        one, other = (human.joint_points(each, size) for each in (q, found))
        for name in human.POINT_NAMES:
            assert np.linalg.norm(one[name] - other[name]) < 0.03
        assert np.linalg.norm(one["wrist_r"] - other["wrist_r"]) < 1e-6
        assert not held.any()
