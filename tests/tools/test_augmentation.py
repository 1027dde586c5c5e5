"""Varied elbows keep the palm paths, the joint limits and the ends of a motion."""

from functools import partial

import numpy as np
import pytest

from app.sim.cells.cell import load_cell
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from tests.sim.demonstrations import reaches
from tools.augmentation import draw_swivel, vary_elbow

POINTS = partial(human.joint_points, size=load_cell().body)


def motion(i: int = 0) -> Vec:
    return reaches()[0][i]


def places(q: Vec, name: str) -> Vec:
    return np.array([POINTS(posture)[name] for posture in q])


@pytest.mark.parametrize("hand", ["r", "l"])
def test_elbow_moves_while_the_palms_keep_their_trajectories(hand: human.Hand) -> None:
    for i in range(6):
        q = motion(i)
        turned = vary_elbow(q, hand, 0.6 * np.sin(np.pi * np.linspace(0, 1, len(q))), POINTS)
        for palm in ("hand_r", "hand_l"):
            away = np.linalg.norm(places(turned, palm) - places(q, palm), axis=1)
            assert away.max() < 1e-6
        moved = np.linalg.norm(
            places(turned, f"elbow_{hand}") - places(q, f"elbow_{hand}"), axis=1
        )
        assert moved.max() > 0.005 and moved[0] < 1e-9 and moved[-1] < 1e-9


@pytest.mark.parametrize("seed", range(5))
def test_varied_elbows_stay_inside_the_limits_without_a_jump(seed: int) -> None:
    rng, q = np.random.default_rng(seed), motion(seed)
    turned = vary_elbow(q, "r", draw_swivel(len(q), rng, spread=2.0), POINTS)
    assert (turned >= human.Q_MIN).all() and (turned <= human.Q_MAX).all()
    assert np.abs(np.diff(turned, axis=0)).max() < 0.3


def test_turned_elbow_is_turned_by_the_asked_for_angle() -> None:
    q = motion()[-1:]
    turned = vary_elbow(q, "r", np.array([0.2]), POINTS)
    before, after = POINTS(q[0]), POINTS(turned[0])
    line = before["hand_r"] - before["shoulder_r"]
    line /= np.linalg.norm(line)
    poles = []
    for named in (before, after):
        offset = named["elbow_r"] - named["shoulder_r"]
        poles.append(offset - (offset @ line) * line)
    angle = np.arctan2(line @ np.cross(*poles), poles[0] @ poles[1])
    assert angle == pytest.approx(0.2, abs=1e-9)


def test_arm_raised_beyond_the_horizontal_keeps_its_branch_of_the_shoulder() -> None:
    q = np.tile(human.rest_posture(0.0, 1.0, -1.5), (30, 1))
    q[:, 10:14] = 0.3, 2.0, 0.2, 1.0
    turned = vary_elbow(q, "r", 0.3 * np.sin(np.pi * np.linspace(0, 1, 30)), POINTS)
    assert np.abs(turned[:, 11] - 2.0).max() < 0.4
    np.testing.assert_allclose(places(turned, "hand_r"), places(q, "hand_r"), atol=1e-9)
