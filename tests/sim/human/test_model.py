"""The 18-DoF person: forward kinematics by hand, inverse kinematics by forward."""

import numpy as np
import pytest

from app.sim.cells.cell import load_cell
from app.sim.human import model as human
from app.sim.human.anthropometry import MEDIAN
from app.sim.human.kernels import kinematics as body

SIZE = load_cell().body
FLOOR_Z = load_cell().floor_z


def index(name: str) -> int:
    return human.JOINT_NAMES.index(name)


def standing(**joints: float) -> np.ndarray:
    """Arms hanging straight, facing +x at the origin, but for the given joints."""
    q = np.zeros(18)
    for name, value in joints.items():
        q[index(name)] = value
    return q


def random_postures(n: int) -> np.ndarray:
    return np.random.default_rng(91).uniform(human.Q_MIN, human.Q_MAX, (n, 18))


def test_straight_arms_hang_below_the_shoulders_left_to_the_left() -> None:
    points = human.joint_points(standing(), SIZE)
    arm = MEDIAN.arm("r")
    for side, sign in (("r", -1), ("l", 1)):
        shoulder = points[f"shoulder_{side}"]
        np.testing.assert_allclose(shoulder[:2], [0, sign * MEDIAN.clavicle_r], atol=1e-12)
        np.testing.assert_allclose(shoulder - points[f"hand_{side}"], [0, 0, arm], atol=1e-12)


@pytest.mark.parametrize("side", ["r", "l"])
def test_shoulder_flexion_lifts_the_arm_to_the_front(side: str) -> None:
    points = human.joint_points(standing(**{f"shoulder_{side}_flex": np.pi / 2}), SIZE)
    reach = points[f"hand_{side}"] - points[f"shoulder_{side}"]
    np.testing.assert_allclose(reach, [MEDIAN.arm("r"), 0, 0], atol=1e-12)


@pytest.mark.parametrize(("side", "sign"), [("r", -1), ("l", 1)])
def test_shoulder_abduction_lifts_the_arm_to_its_side(side: str, sign: int) -> None:
    points = human.joint_points(standing(**{f"shoulder_{side}_abduct": np.pi / 2}), SIZE)
    reach = points[f"hand_{side}"] - points[f"shoulder_{side}"]
    np.testing.assert_allclose(reach, [0, sign * MEDIAN.arm("r"), 0], atol=1e-12)


def test_bent_elbow_brings_the_hand_to_the_front_and_up() -> None:
    points = human.joint_points(standing(elbow_r=np.pi / 2), SIZE)
    fore = points["hand_r"] - points["elbow_r"]
    np.testing.assert_allclose(fore, [MEDIAN.forearm_r + MEDIAN.hand, 0, 0], atol=1e-12)


def test_flexed_abdomen_leans_to_the_front_and_twist_turns_left() -> None:
    leaning = human.joint_points(standing(abdomen_flex=0.5), SIZE)
    assert leaning["neck"][0] == pytest.approx(MEDIAN.trunk * np.sin(0.5))
    twisted = human.joint_points(standing(abdomen_twist=np.pi / 2), SIZE)
    assert twisted["shoulder_l"][0] < -0.1 < 0.1 < twisted["shoulder_r"][0]


def test_pelvis_joints_move_and_turn_the_whole_person() -> None:
    q = random_postures(1)[0]
    moved = q.copy()
    moved[:3] += [0.3, -0.2, 0.7]
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    before, after = human.joint_points(q, SIZE), human.joint_points(moved, SIZE)
    for name, point in before.items():
        offset = turn @ (point - before["pelvis"])
        np.testing.assert_allclose(after[name] - after["pelvis"], offset, atol=1e-12)


def test_capsules_keep_their_lengths_and_join_at_the_joints() -> None:
    rest = human.capsules(standing(), SIZE, FLOOR_Z)
    length = np.linalg.norm(rest[:, 1] - rest[:, 0], axis=1)
    for q in random_postures(50):
        ends = human.capsules(q, SIZE, FLOOR_Z)
        same = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        chest = human.CAPSULE_NAMES.index("head")
        np.testing.assert_allclose(np.delete(same, chest), np.delete(length, chest), atol=1e-9)
        points = human.joint_points(q, SIZE)
        for side in "rl":
            upper = ends[human.CAPSULE_NAMES.index(f"upper_arm_{side}")]
            fore = ends[human.CAPSULE_NAMES.index(f"forearm_{side}")]
            np.testing.assert_allclose(upper[1], points[f"elbow_{side}"], atol=1e-12)
            np.testing.assert_allclose(fore[0], points[f"elbow_{side}"], atol=1e-12)


def test_feet_stand_on_the_floor() -> None:
    ends = human.capsules(standing(), SIZE, FLOOR_Z)
    leg = human.CAPSULE_NAMES.index("leg_r")
    assert ends[leg, 1, 2] - human.CAPSULE_RADII[leg] == pytest.approx(FLOOR_Z)


def test_body_frames_are_rotations() -> None:
    for q in random_postures(50):
        for frame in human.body_frames(q, SIZE).values():
            rotation = frame[:3, :3]
            np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
            assert np.linalg.det(rotation) == pytest.approx(1.0)


@pytest.mark.parametrize("hand", ["r", "l"])
def test_reach_puts_the_palm_where_it_says_it_does(hand: human.Hand) -> None:
    rng, cell = np.random.default_rng(92), load_cell()
    rest, count = human.rest_posture(*cell.human.home), 0
    for target in rng.uniform([-0.5, 0.6, 0.05], [0.5, 1.0, 0.6], (200, 3)):
        pelvis = (float(target[0]), 1.2, -np.pi / 2)
        posture = human.reach(hand, target, rest, SIZE, pelvis=pelvis)
        error = human.joint_points(posture.q, SIZE)[f"hand_{hand}"] - target
        assert posture.reached == (np.linalg.norm(error) < 0.01)
        assert (posture.q >= human.Q_MIN).all() and (posture.q <= human.Q_MAX).all()
        count += posture.reached
    assert count > 160


@pytest.mark.parametrize(
    "target", [[0.0, 0.0, 50.0], [0.0, 1.3, 0.2], [0.0, 1.45, -0.2], [3.0, 1.45, -0.6]]
)
def test_impossible_targets_give_a_posture_inside_the_limits(target: list[float]) -> None:
    rest = human.rest_posture(*load_cell().human.home)
    posture = human.reach("r", np.array(target), rest, SIZE)
    assert np.isfinite(posture.q).all()
    assert (posture.q >= human.Q_MIN).all() and (posture.q <= human.Q_MAX).all()


@pytest.mark.parametrize(("upper", "fore"), [(0.25, 0.325), (0.26, 0.345), (0.34, 0.2)])
def test_hand_beside_the_shoulder_of_an_uneven_arm_is_a_posture(
    upper: float, fore: float
) -> None:
    size, rng = SIZE.copy(), np.random.default_rng(4)
    size[[body.UPPER_ARM_R, body.UPPER_ARM_R + 1]] = upper
    size[[body.FOREARM_R, body.FOREARM_R + 1]] = fore
    start = human.rest_posture(0.0, 1.2, -np.pi / 2.0)
    shoulder = human.joint_points(start, size)["shoulder_r"]
    for offset in rng.uniform(-0.12, 0.12, (100, 3)):
        q = human.solve_hands(start, size, right=shoulder + offset).q
        assert np.isfinite(q).all() and (q[10:14] <= human.Q_MAX[10:14] + 1e-9).all()


def test_dragging_both_hands_moves_the_person_without_jumps() -> None:
    cell = load_cell()
    q = human.rest_posture(*cell.human.home)
    share, previous = np.linspace(0.0, 1.0, 200)[:, None], None
    rights = [-0.15, 1.1, 0.2] + share * ([0.25, 0.75, 0.1] - np.array([-0.15, 1.1, 0.2]))
    lefts = [0.2, 1.1, 0.3] + share * ([0.45, 0.85, 0.2] - np.array([0.2, 1.1, 0.3]))
    for right, left in zip(rights, lefts, strict=True):
        q = human.solve_hands(q, SIZE, right=right, left=left).q
        points = human.joint_points(q, SIZE)
        now = np.array([points[name] for name in ("hand_r", "hand_l", "elbow_r", "head")])
        if previous is not None:
            assert np.abs(now - previous).max() < 0.03
        previous = now
