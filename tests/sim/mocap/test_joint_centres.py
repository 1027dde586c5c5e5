import numpy as np

from app.sim.human.anthropometry import BodySize, percentile_body
from app.sim.human.model import Q_MAX, Q_MIN, joint_points
from app.sim.mocap.joint_centres import TRACK_NAMES, measure, model_points, trunk_frame


def test_points_are_those_of_the_compiled_person() -> None:
    q = np.random.default_rng(1).uniform(Q_MIN, Q_MAX, (20, 18))
    size = percentile_body(80.0, 20.0, 60.0, pelvis=0.3)
    found = model_points(q, np.full(20, size.pelvis), size)
    for points, one in zip(found, q, strict=True):
        expected = joint_points(one, size.vector(0.0))
        np.testing.assert_allclose(points, [expected[name] for name in TRACK_NAMES], atol=1e-9)


def test_lengths_are_measured_from_the_points() -> None:
    size = BodySize(
        trunk=0.5,
        clavicle_r=0.15,
        clavicle_l=0.16,
        upper_arm_r=0.30,
        upper_arm_l=0.31,
        forearm_r=0.25,
        forearm_l=0.24,
    )
    q = np.random.default_rng(2).uniform(Q_MIN, Q_MAX, (5, 18))
    measured = measure(model_points(q, np.zeros(5), size)).lengths()
    np.testing.assert_allclose(list(measured.values()), list(size.lengths().values()))


def test_trunk_frame_points_up_and_to_the_left() -> None:
    pelvis, neck = np.zeros((1, 3)), np.array([[0.0, 0.0, 0.4]])
    frame = trunk_frame(pelvis, neck, np.array([[0.0, 0.3, 0.1]]))
    np.testing.assert_allclose(frame[0], np.eye(3), atol=1e-12)
