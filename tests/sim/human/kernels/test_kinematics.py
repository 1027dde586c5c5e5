"""The compiled person, of any size, against a second one in plain numpy."""

import numpy as np

from app.sim.cells.cell import load_cell
from app.sim.geometry.capsules import INVERSE, RADIUS, UU, ends_of
from app.sim.human import model as human
from app.sim.human.anthropometry import MEDIAN, BodySize, percentile_body
from app.sim.human.kernels import kinematics as body
from tests.sim.person_reference import capsule_ends, frames

FLOOR_Z = load_cell().floor_z
SIZES = (
    MEDIAN,
    percentile_body(5.0, 95.0, 20.0),
    percentile_body(95.0, 5.0, 95.0),
    BodySize(upper_arm_r=0.4, forearm_l=0.2, clavicle_l=0.1, hand=0.12, girth=1.3),
)
N = 5_000


def joints(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(human.Q_MIN, human.Q_MAX, (N, 18))


def test_frames_and_hands_are_those_of_the_tree() -> None:
    trig, worst = np.empty((3, 16)), 0.0
    points, rotations = np.empty((body.N_POINTS, 3)), np.empty((body.N_FRAMES, 3, 3))
    for number, size in enumerate(SIZES):
        q, vector, lengths = joints(51 + number), size.vector(FLOOR_Z), size.lengths()
        expected = frames(q, size, FLOOR_Z)
        for k, row in enumerate(q):
            body.points_and_frames(row, vector, trig, points, rotations)
            for name, origin, found in zip(
                human.FRAME_NAMES, human.FRAME_ORIGINS, rotations, strict=True
            ):
                place = points[human.POINT_NAMES.index(origin)]
                worst = max(worst, np.abs(expected[name][k, :3, :3] - found).max())
                worst = max(worst, np.abs(expected[name][k, :3, 3] - place).max())
            for hand, point in (("r", body.HAND_R), ("l", body.HAND_L)):
                fore = expected[f"forearm_{hand}"][k]
                reach = lengths[f"forearm_{hand}"] + size.hand
                palm = fore[:3, 3] - reach * fore[:3, 2]
                worst = max(worst, np.abs(palm - points[point]).max())
    assert worst < 1e-12


def test_capsules_are_those_of_the_tree_wherever_they_stand_among_the_columns() -> None:
    trig, out = np.empty((3, 16)), body.new_body_capsules(2)
    points, rotations = np.empty((body.N_POINTS, 3)), np.empty((body.N_FRAMES, 3, 3))
    for number, (one, other) in enumerate(zip(SIZES, SIZES[::-1], strict=True)):
        q = joints(61 + number)
        pair = [(one, q[::2]), (other, q[1::2])]
        expected = np.stack([capsule_ends(rows, size, FLOOR_Z) for size, rows in pair], 1)
        for k in range(N // 2):
            for first, (size, rows) in zip((0, body.N_CAPSULES), pair, strict=True):
                vector = size.vector(FLOOR_Z)
                body.points_and_frames(rows[k], vector, trig, points, rotations)
                body.capsules(points, rotations, vector, FLOOR_Z, first, out)
            ends = ends_of(out, 2 * body.N_CAPSULES)
            assert np.abs(ends - expected[k].reshape(ends.shape)).max() < 1e-12


def test_columns_know_lengths_and_radii_of_the_person_placed_last() -> None:
    trig, out = np.empty((3, 16)), body.new_body_capsules(1)
    points, rotations = np.empty((body.N_POINTS, 3)), np.empty((body.N_FRAMES, 3, 3))
    for size in SIZES:
        vector, q = size.vector(FLOOR_Z), joints(71)[0]
        body.points_and_frames(q, vector, trig, points, rotations)
        body.capsules(points, rotations, vector, FLOOR_Z, 0, out)
        ends = capsule_ends(q[None], size, FLOOR_Z)[0]
        length2 = ((ends[:, 1] - ends[:, 0]) ** 2).sum(axis=1)
        np.testing.assert_allclose(out[UU, :12], length2, atol=1e-12)
        np.testing.assert_allclose(out[INVERSE, :12], 1.0 / length2)
        np.testing.assert_allclose(out[RADIUS, :12], size.girth * human.CAPSULE_RADII)
