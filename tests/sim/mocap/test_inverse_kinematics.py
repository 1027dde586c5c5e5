import numpy as np
import pytest

from app.sim.core.arrays import Vec
from app.sim.human.anthropometry import BodySize
from app.sim.human.kernels import kinematics as body
from app.sim.human.model import Q_MAX, Q_MIN
from app.sim.mocap.inverse_kinematics import MIN_BEND, body_angles, euler_angles
from app.sim.mocap.joint_centres import ELBOW_R, NECK, PELVIS, WRIST_R, BodyTrack, model_points
from tests.sim.recorded_person import working

SIZE = BodySize(trunk=0.5, clavicle_l=0.15, upper_arm_r=0.33, forearm_r=0.24)
SHOULDERS = [10, 11, 12, 14, 15, 16]


def track_of(q: Vec, dt: float = 0.02) -> BodyTrack:
    """The joint centres of a person of size SIZE; hips turn with the pelvis."""
    hips = np.stack([-np.sin(q[:, 2]), np.cos(q[:, 2]), np.zeros(len(q))], axis=1)
    points = model_points(q, np.full(len(q), 0.9), SIZE)
    return BodyTrack(times=dt * np.arange(len(q)), points=points, hips=0.2 * hips)


@pytest.mark.parametrize("seed", range(20))
def test_angles_of_a_still_person_are_found_again(seed: int) -> None:
    q = np.random.default_rng(seed).uniform(Q_MIN, Q_MAX)
    q[2] = 0.4
    q[6:10] = 0.0  # shoulders level, so that the line across them is the torso's own
    q[[11, 15]] = np.clip(q[[11, 15]], -0.8, 1.5)
    q[[13, 17]] = np.maximum(q[[13, 17]], 0.2)
    frames = np.tile(q, (20, 1))
    found, height = body_angles(track_of(frames), SIZE)
    np.testing.assert_allclose(height, 0.9, atol=1e-9)
    error = model_points(found, height, SIZE) - track_of(frames).points
    assert np.abs(error).max() < 1e-9
    np.testing.assert_allclose(found[:, :6], frames[:, :6], atol=1e-9)


def test_wrists_of_a_moving_person_are_met_within_a_millimetre() -> None:
    track = track_of(working(400))
    found, height = body_angles(track, SIZE)
    error = np.linalg.norm(model_points(found, height, SIZE) - track.points, axis=2)
    assert error.max() < 1e-3
    assert error[:, [PELVIS, NECK, ELBOW_R]].max() < 1e-9


def test_straight_arm_keeps_the_plane_it_had() -> None:
    q = working(300)
    q[:, 10:14] = 0.3, 0.4, 0.5, 0.6
    q[100:200, 13] = 0.5 * MIN_BEND
    noisy = track_of(q)
    noisy.points[100:200, WRIST_R] += np.random.default_rng(3).normal(0.0, 0.002, (100, 3))
    found, _ = body_angles(noisy, SIZE)
    assert np.abs(found[120:180, 12] - found[50, 12]).max() < 0.15


def test_arm_that_never_bends_gives_finite_angles_and_its_wrist() -> None:
    q = working(50)
    q[:, [13, 17]] = 0.0
    found, height = body_angles(track_of(q), SIZE)
    error = model_points(found, height, SIZE)[:, WRIST_R] - track_of(q).points[:, WRIST_R]
    assert np.abs(error).max() < 1e-6


def test_arm_raised_sideways_past_the_level_leaps_nowhere() -> None:
    q = working(200)
    q[:, 6:10] = 0.0
    q[:, 10:18] = [0.1, 0.0, 0.2, 0.8] * 2
    q[:, 11] = q[:, 15] = np.linspace(0.5, 2.4, 200)
    found, _ = body_angles(track_of(q), SIZE)
    assert np.abs(np.diff(found[:, SHOULDERS], axis=0)).max() < 0.1
    np.testing.assert_allclose(found[:, 11], q[:, 11], atol=0.03)


def test_yaw_goes_round_without_a_leap() -> None:
    q = working(300)
    q[:, 2] = np.linspace(0.0, 9.0, 300)
    found, _ = body_angles(track_of(q), SIZE)
    np.testing.assert_allclose(found[:, 2], q[:, 2], atol=1e-9)


def test_spine_that_shortens_moves_the_pelvis_and_not_the_hands() -> None:
    track = track_of(working(100))
    up = track.points[:, NECK] - track.points[:, PELVIS]
    track.points[:, PELVIS] += 0.1 * up
    found, height = body_angles(track, SIZE)
    error = np.linalg.norm(model_points(found, height, SIZE) - track.points, axis=2)
    assert error[:, [ELBOW_R, WRIST_R]].max() < 1e-3
    np.testing.assert_allclose(error[:, PELVIS], 0.05, atol=1e-6)


def test_angles_of_a_rotation_give_it_back() -> None:
    rng = np.random.default_rng(5)
    a, b, c = rng.uniform(-1.0, 1.0, 3)
    turn = np.empty((3, 3))
    sines, cosines = np.sin([a, b, c]), np.cos([a, b, c])
    body._turn(cosines[0], sines[0], cosines[1], sines[1], cosines[2], sines[2], turn)
    np.testing.assert_allclose(euler_angles(turn[None])[0], [a, b, c])
