"""Augmentation: each item changes what it says and keeps the rest."""

import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.cells.cell import load_cell
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.primitives.augmentation import (
    SETTLE_S,
    Augmentation,
    Pause,
    augment,
    change_duration,
    draw_pauses,
    draw_swivel,
    insert_pauses,
    start_anywhere,
    turn_back,
    vary_elbow,
)
from app.sim.primitives.via_points import points_of
from tests.sim.demonstrations import reaches

POINTS = points_of(load_cell().body)
DT = 1.0 / 60.0


def motion(i: int = 0) -> Vec:
    return reaches()[0][i]


def places(q: Vec, name: str) -> Vec:
    return np.array([POINTS(posture)[name] for posture in q])


def peak_speed(q: Vec) -> Vec:
    return np.abs(np.diff(q, axis=0)).max(axis=0) / DT


@pytest.mark.parametrize("factor", [0.4, 0.77, 1.0, 2.5])
def test_execution_time_changes_and_the_path_does_not(factor: float) -> None:
    q = motion()
    slower = change_duration(q, factor)
    assert len(slower) - 1 == round(factor * (len(q) - 1))
    np.testing.assert_allclose(slower[[0, -1]], q[[0, -1]], atol=1e-12)
    middle = change_duration(slower, (len(q) - 1) / (len(slower) - 1))
    np.testing.assert_allclose(middle, q, atol=5e-3)


@pytest.mark.parametrize("factor", [0.0, -1.0, np.nan, np.inf])
def test_impossible_execution_time_is_named(factor: float) -> None:
    with pytest.raises(InvalidInput, match="factor"):
        change_duration(motion(), factor)


def test_pause_stands_still_for_its_length_where_it_was_asked_for() -> None:
    q = motion()
    paused = insert_pauses(q, DT, [Pause(at_s=0.6, length_s=1.0)])
    assert len(paused) - len(q) == pytest.approx((1.0 + SETTLE_S) / DT, abs=1)
    still = np.abs(np.diff(paused, axis=0)).max(axis=1) < 1e-9
    assert still.sum() == pytest.approx(1.0 / DT, abs=4)
    np.testing.assert_allclose(paused[int(0.7 / DT) + 30], q[36], atol=1e-6)


def test_pauses_keep_the_path_its_ends_and_its_peak_speeds() -> None:
    q = motion()
    pauses = [Pause(at_s=1.0, length_s=0.3), Pause(at_s=0.4, length_s=0.6)]
    paused = insert_pauses(q, DT, pauses)
    np.testing.assert_allclose(paused[[0, -1]], q[[0, -1]], atol=1e-12)
    assert (peak_speed(paused) <= peak_speed(q) * 1.01 + 1e-9).all()
    away = np.abs(paused[:, None] - q[None]).max(axis=2).min(axis=1)
    assert away.max() <= 0.5 * np.abs(np.diff(q, axis=0)).max() + 1e-9


def test_pause_is_reached_and_left_without_a_jerk() -> None:
    fine = change_duration(motion(), 20.0)
    paused = insert_pauses(fine, DT / 20.0, [Pause(at_s=0.6, length_s=0.5)])
    before, after = (np.diff(q, n=2, axis=0) / (DT / 20.0) ** 2 for q in (fine, paused))
    # Braking from speed v within SETTLE_S asks for 1.875 v / SETTLE_S.
    speed = np.abs(np.diff(fine, axis=0)).max() / (DT / 20.0)
    assert np.abs(after).max() <= np.abs(before).max() + 1.875 * speed / SETTLE_S * 1.05


def test_no_pause_changes_nothing() -> None:
    np.testing.assert_allclose(insert_pauses(motion(), DT, []), motion(), atol=1e-12)


def test_drawn_pauses_always_have_room_and_are_as_many_as_asked_for() -> None:
    rng, counts = np.random.default_rng(3), []
    for _ in range(2000):
        pauses = draw_pauses(20.0, rng, mean_number=0.4)
        counts.append(len(pauses))
        assert all(0.2 <= pause.length_s <= 1.5 for pause in pauses)
    assert np.mean(counts) == pytest.approx(0.4, abs=0.05)
    for _ in range(50):
        insert_pauses(motion(), DT, draw_pauses(DT * (len(motion()) - 1), rng, mean_number=4.0))
    assert draw_pauses(0.2, rng, mean_number=9.0) == []


@pytest.mark.parametrize(
    "pauses",
    [
        [Pause(at_s=0.01, length_s=1.0)],
        [Pause(at_s=99.0, length_s=1.0)],
        [Pause(at_s=0.5, length_s=1.0), Pause(at_s=0.6, length_s=1.0)],
        [Pause(at_s=0.5, length_s=-1.0)],
        [Pause(at_s=np.nan, length_s=1.0)],
    ],
)
def test_pause_without_room_is_named(pauses: list[Pause]) -> None:
    with pytest.raises(InvalidInput, match=r"pauses\["):
        insert_pauses(motion(), DT, pauses)


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


def test_motion_started_anywhere_is_the_rest_of_the_motion() -> None:
    q = motion()
    rest = start_anywhere(q, 0.5)
    np.testing.assert_allclose(rest, q[(len(q) - 1) // 2 :], atol=1e-12)
    between = start_anywhere(q, 0.503)
    np.testing.assert_allclose(between[-1], q[-1], atol=1e-12)
    assert (between[0] >= q[48:50].min(axis=0)).all()
    assert (between[0] <= q[48:50].max(axis=0)).all()


@pytest.mark.parametrize("phase", [-0.1, 1.0, np.nan])
def test_start_outside_the_motion_is_named(phase: float) -> None:
    with pytest.raises(InvalidInput, match="phase"):
        start_anywhere(motion(), phase)


def test_motion_turned_back_goes_the_same_way_backward() -> None:
    q = motion()
    np.testing.assert_array_equal(turn_back(q), q[::-1])
    turn_back(q)[0] = 0.0
    np.testing.assert_array_equal(turn_back(turn_back(q)), q)


def test_augmented_motions_differ_stay_inside_the_limits_and_never_jump() -> None:
    rng, how = np.random.default_rng(11), Augmentation(latest_start=0.8)
    q = motion(2)
    lengths = set()
    for _ in range(25):
        made = augment(q, DT, rng, how, POINTS)
        lengths.add(len(made))
        assert (made >= human.Q_MIN).all() and (made <= human.Q_MAX).all()
        assert np.abs(np.diff(made, axis=0)).max() < 0.4
    assert len(lengths) > 15


def test_augmentation_of_nothing_is_the_motion_itself() -> None:
    how = Augmentation(
        pace_spread=0.0, pauses_per_motion=0.0, swivel_spread=0.0, p_reversed=0.0
    )
    made = augment(motion(), DT, np.random.default_rng(0), how, POINTS)
    np.testing.assert_allclose(made, motion(), atol=1e-12)
