import numpy as np
import pinocchio as pin

from web.viewer.poses import interpolate_rotation, orientation, upright, yaw_of


def rotations(n: int) -> np.ndarray:
    rng = np.random.default_rng(4)
    axes = rng.normal(size=(n, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return np.stack(
        [pin.exp3(a * t) for a, t in zip(axes, rng.uniform(0, np.pi, n), strict=True)]
    )


def test_orientation_is_pinocchios_quaternion_with_w_first() -> None:
    matrices = rotations(200)
    for matrix, wxyz in zip(matrices, orientation(matrices), strict=True):
        x, y, z, w = pin.Quaternion(matrix).coeffs()
        assert abs(abs(np.dot(wxyz, [w, x, y, z])) - 1.0) < 1e-9


def test_yaw_survives_conversion_to_viser_and_back() -> None:
    for yaw in np.linspace(-3.1, 3.1, 25):
        assert abs(yaw_of(upright(yaw)) - yaw) < 1e-12


def test_interpolate_rotation_divides_the_angle() -> None:
    for matrix in rotations(50):
        third = interpolate_rotation(np.eye(3), matrix, 1.0 / 3.0)
        assert np.allclose(third @ third @ third, matrix, atol=1e-9)
