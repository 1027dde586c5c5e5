"""The compiled person against a second one in plain numpy."""

import numpy as np

from app.sim import human
from app.sim.cells import load_cell
from app.sim.kernels import body
from app.sim.kernels.columns import RADIUS, UU, ends_of
from tests.sim.person_reference import capsule_ends, frames

CELL = load_cell()
N = 20_000


def joints() -> np.ndarray:
    return np.random.default_rng(51).uniform(human.Q_MIN, human.Q_MAX, (N, 18))


def test_frames_and_hands_are_those_of_the_tree() -> None:
    q, trig = joints(), np.empty((3, 16))
    expected = frames(q, CELL.pelvis_z)
    points, rotations = np.empty((body.N_POINTS, 3)), np.empty((body.N_FRAMES, 3, 3))
    worst = 0.0
    for k, row in enumerate(q):
        body.points_and_frames(row, CELL.pelvis_z, trig, points, rotations)
        for name, origin, found in zip(
            human.FRAME_NAMES, human.FRAME_ORIGINS, rotations, strict=True
        ):
            place = points[human.POINT_NAMES.index(origin)]
            worst = max(worst, np.abs(expected[name][k, :3, :3] - found).max())
            worst = max(worst, np.abs(expected[name][k, :3, 3] - place).max())
        for hand, point in (("r", body.HAND_R), ("l", body.HAND_L)):
            fore = expected[f"forearm_{hand}"][k]
            palm = fore[:3, 3] - (body.FOREARM + body.HAND) * fore[:3, 2]
            worst = max(worst, np.abs(palm - points[point]).max())
    assert worst < 1e-12


def test_capsules_are_those_of_the_tree_wherever_they_stand_among_the_columns() -> None:
    q, trig = joints(), np.empty((3, 16))
    expected = capsule_ends(q, CELL.pelvis_z, CELL.floor_z)
    points, rotations = np.empty((body.N_POINTS, 3)), np.empty((body.N_FRAMES, 3, 3))
    out = body.capsule_columns(2, CELL.pelvis_z, CELL.floor_z)
    for k in range(0, N, 2):
        for first, row in ((0, q[k]), (body.N_CAPSULES, q[k + 1])):
            body.points_and_frames(row, CELL.pelvis_z, trig, points, rotations)
            body.capsules(points, rotations, CELL.floor_z, first, out)
        ends = ends_of(out, 2 * body.N_CAPSULES)
        assert np.abs(ends - expected[k : k + 2].reshape(ends.shape)).max() < 1e-12


def test_lengths_and_radii_that_never_change_are_those_of_the_tree() -> None:
    ends = capsule_ends(joints()[:100], CELL.pelvis_z, CELL.floor_z)
    out = body.capsule_columns(1, CELL.pelvis_z, CELL.floor_z)
    length2 = ((ends[:, :, 1] - ends[:, :, 0]) ** 2).sum(axis=2)
    np.testing.assert_allclose(length2, np.tile(out[UU, :12], (100, 1)), atol=1e-12)
    np.testing.assert_array_equal(out[RADIUS, :12], human.CAPSULE_RADII)
