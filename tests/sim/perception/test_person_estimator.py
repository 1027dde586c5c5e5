"""From noisy, incomplete key-points to a person: the numbers, and how it degrades."""

import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.human import model as human
from app.sim.perception.bounding_cylinder import safety_cylinder
from app.sim.perception.keypoint_sensor_model import (
    KeypointSensorModel,
    KeypointSensorSettings,
)
from app.sim.perception.keypoints import K, swap_sides
from app.sim.perception.person_estimator import UNFIT, PersonEstimator
from app.sim.scene.scene import capsule_speeds_of, people_geometry_of, people_of
from tests.sim.perception.cylinder_contents import holds
from tests.sim.postures import POSTURES, kneeling_and_looking_down, posture
from tests.sim.tracked_person import CELL, seen, work
from tests.sim.tracker_errors import errors, follow

DT = 1.0 / 30.0
UNSEEN = np.full((25, 3), np.nan)


NOISY = KeypointSensorSettings(noise=0.02, missing=0.2, latency_s=0.0)
LATE = KeypointSensorSettings(noise=0.02, missing=0.2, missing_s=0.2, lost=0.1, latency_s=0.1)


def test_center_of_noisy_incomplete_people_is_within_50_mm() -> None:
    assert np.median(errors(NOISY).center) <= 0.05
    assert np.percentile(errors(NOISY).center, 95) <= 0.06


def test_cylinder_of_noisy_incomplete_people_contains_them_in_95_percent_of_frames() -> None:
    assert np.mean(errors(NOISY).contains) >= 0.95


def test_wrists_of_noisy_incomplete_people_are_within_40_mm() -> None:
    assert np.median(errors(NOISY).wrist) <= 0.04
    assert np.percentile(errors(NOISY).wrist, 95) <= 0.07


@pytest.mark.parametrize("percentile", [5.0, 95.0])
def test_small_and_large_people_of_known_size_keep_to_the_numbers(percentile: float) -> None:
    found = errors(NOISY, percentile)
    assert np.median(found.center) <= 0.05
    assert np.mean(found.contains) >= 0.95 and np.mean(found.surface) >= 0.95
    assert np.median(found.wrist) <= 0.04


@pytest.mark.parametrize("percentile", [5.0, 95.0])
def test_small_and_large_people_taken_for_the_median_keep_to_the_numbers(
    percentile: float,
) -> None:
    found = errors(NOISY, percentile, assumed=50.0)
    assert np.median(found.center) <= 0.05
    assert np.mean(found.contains) >= 0.95
    assert np.median(found.wrist) <= 0.04


def test_late_frames_and_long_gaps_keep_to_the_same_numbers() -> None:
    found = errors(LATE)
    assert np.median(found.center) <= 0.05
    assert np.mean(found.contains) >= 0.95
    assert np.median(found.wrist) <= 0.05


def test_speeds_of_a_person_seen_exactly_are_the_true_ones() -> None:
    found = errors(KeypointSensorSettings(noise=0.0, missing=0.0, latency_s=0.0))
    assert np.median(found.qd) < 0.05
    assert np.percentile(found.velocity, 50) < 0.08


def test_speeds_of_noisy_people_are_noise_of_a_fraction_of_a_radian() -> None:
    found = errors(NOISY)
    assert np.median(found.qd) < 0.4
    assert np.median(found.velocity) < 0.15


@pytest.mark.parametrize("missing", [0.0, 0.2])
def test_noise_is_hardly_ever_taken_for_a_part_faster_than_safety_layers_assume(
    missing: float,
) -> None:
    """A person at rest, 12 s each with 20 mm of noise: below 1.6 m/s in 99 % of the frames."""
    rest, shared = human.rest_posture(0.3, 1.2, -1.57), people_of(CELL)
    noisy = KeypointSensorSettings(noise=0.02, missing=missing, latency_s=0.0)
    fastest = []
    for seed in (1, 2, 3):
        sensor = KeypointSensorModel(noisy, seed, CELL.body, CELL.floor_z)
        times = np.arange(0.0, 12.0, DT).tolist()
        for one in follow(lambda _: rest, times, sensor, PersonEstimator(CELL.body)):
            if one.person is not None:
                q, qd = one.person.q[None], one.person.qd[None]
                placed = people_geometry_of(shared, q, np.zeros((0, 3)))
                fastest.append(capsule_speeds_of(shared, placed, q, qd).max())
    assert len(fastest) > 1000
    assert 0.05 < np.median(fastest) < 0.5
    assert np.mean(np.array(fastest) > 1.6) < 0.01


def tracked(n: int = 30, seed: int = 1) -> tuple[PersonEstimator, np.ndarray]:
    """An estimator that has seen the first frames of a person at work, and the motion."""
    q, estimator = work(seed, 12.0)[1], PersonEstimator(CELL.body)
    for k in range(n):
        assert estimator.update(k * DT, seen(q[k])).flags == ()
    return estimator, q


def test_before_the_first_frame_no_person_is_estimated_and_it_is_reported() -> None:
    estimator = PersonEstimator(CELL.body)
    for estimate in (estimator.at(0.0), estimator.update(1.0, UNSEEN)):
        assert estimate.cylinder is None and estimate.person is None
        assert estimate.flags == ("never-seen",) and estimate.stale
        assert estimate.age_s == np.inf


def test_all_missing_is_carried_on_then_held_then_grown_and_named() -> None:
    estimator, _ = tracked(30)
    last = 29 * DT
    before = estimator.at(last)
    soon = estimator.update(last + 0.1, UNSEEN)
    assert soon.flags == () and soon.held == ()
    late = estimator.update(last + 0.4, UNSEEN)
    assert late.stale and late.age_s == pytest.approx(0.4)
    gone = estimator.update(last + 1.5, UNSEEN)
    assert gone.stale and set(gone.held) == set(human.JOINT_NAMES) and len(gone.missing) == 25
    assert (
        before.cylinder is not None and gone.cylinder is not None and late.cylinder is not None
    )
    assert gone.cylinder.radius == pytest.approx(before.cylinder.radius + 1.6, abs=0.05)
    assert gone.person is not None and (gone.person.qd == 0.0).all()


def test_a_person_who_comes_back_after_long_is_a_new_person() -> None:
    estimator, q = tracked(30)
    estimate = estimator.update(60 * DT, seen(q[60]))
    assert estimate.flags == ("restarted",) and not estimate.stale
    assert estimate.person is not None
    joints = human.joint_points(estimate.person.q, CELL.body)
    assert np.linalg.norm(joints["wrist_r"] - seen(q[60])[K["wrist_r"]]) < 1e-6


def test_a_limb_unseen_for_long_is_held_and_the_cylinder_widens() -> None:
    estimator, q = tracked(30)
    for k in range(30, 60):
        points = seen(q[k])
        points[[K["elbow_r"], K["wrist_r"]]] = np.nan
        estimate = estimator.update(k * DT, points)
        arm = human.joint_points(q[k], CELL.body)
        assert estimate.cylinder is not None
        assert holds(estimate.cylinder, np.array([arm["wrist_r"], arm["elbow_r"]]))
    assert estimate.missing == ("elbow_r", "wrist_r")
    assert {"elbow_r", "shoulder_r_flex"} <= set(estimate.held)
    assert "elbow_l" not in estimate.held


@pytest.mark.parametrize(
    ("group", "flag"), [("arms", "arms-swapped"), ("legs", "legs-swapped")]
)
def test_exchanged_sides_are_exchanged_back_and_named(group: str, flag: str) -> None:
    (one, q), (other, _) = tracked(30), tracked(30)
    right = one.update(30 * DT, seen(q[30]))
    wrong = other.update(30 * DT, swap_sides(seen(q[30]), group))
    assert wrong.flags == (flag,)
    assert right.person is not None and wrong.person is not None
    np.testing.assert_allclose(wrong.person.q, right.person.q)


def test_a_hand_that_turns_back_unseen_is_within_reach_of_its_prediction() -> None:
    speed, swing = 1.6, 2.385  # of the hand [m/s] and of the shoulder [rad/s]
    estimator, short, bare = PersonEstimator(CELL.body), [], []
    for k in range(25):
        q = human.rest_posture(0.0, 1.45, -np.pi / 2.0)
        q[[10, 13]] = 0.1 + swing / 30.0 * (k if k < 14 else 28 - k), 0.5
        points = seen(q)
        if k > 14:
            points[[K["elbow_r"], K["wrist_r"]]] = np.nan
        found = estimator.update(k / 30.0, points)
        assert found.person is not None and not found.held
        tip = human.capsules(q, CELL.body, CELL.floor_z)[8, 1]
        hand = human.capsules(found.person.q, CELL.body, CELL.floor_z)[8]
        away = np.linalg.norm(hand[1] - tip)
        assert (found.displaced_m > 0.0) == (k > 14)
        if k > 14:
            bare.append(away - speed * found.carried_s)
            short.append(bare[-1] - found.displaced_m)
    assert max(short) < 0.0 < 0.1 < max(bare)


def test_exchanged_sides_in_the_first_frame_are_seen_by_the_direction_the_person_faces() -> (
    None
):
    q = work(1, 12.0)[1][0]
    estimate = PersonEstimator(CELL.body).update(0.0, swap_sides(seen(q), "arms"))
    assert estimate.flags == ("arms-swapped",)
    assert estimate.person is not None
    np.testing.assert_allclose(estimate.person.q, q, atol=0.05)


def test_sides_taken_wrong_at_first_are_put_right_when_that_goes_on() -> None:
    q, estimator = human.rest_posture(0.0, 1.2, -1.5), PersonEstimator(CELL.body)
    faceless = seen(q)
    faceless[[K[name] for name in ("nose", "ear_r", "ear_l")]] = np.nan
    first = estimator.update(0.0, swap_sides(faceless, "arms"))
    assert "arms-swapped" not in first.flags
    flags = [estimator.update(k * DT, seen(q)).flags for k in range(1, 40)]
    assert "arms-swapped" in flags[0] and sum("sides-restarted" in each for each in flags) == 1
    assert flags[-1] == ()
    person = estimator.at(40 * DT).person
    assert person is not None
    np.testing.assert_allclose(person.q, q, atol=0.1)


def test_another_person_in_place_of_this_one_is_refused_and_then_accepted() -> None:
    estimator, q = tracked(30)
    away = np.array([0.8, 0.5, 0.0])
    before, flags = estimator.at(29 * DT), []
    for k in range(30, 50):
        estimate = estimator.update(k * DT, seen(q[30]) + away)
        flags.append(estimate.flags)
        if "jump" in estimate.flags:
            assert estimate.cylinder is not None and before.cylinder is not None
            moved = estimate.cylinder.center - before.cylinder.center
            assert np.linalg.norm(moved) < 0.1
    assert flags[0] == ("jump",) and flags[-1] == ()
    assert sum("restarted" in each for each in flags) == 1
    found = estimator.at(50 * DT).cylinder
    true = safety_cylinder(seen(q[30]) + away)
    assert found is not None and true is not None
    assert np.linalg.norm(found.center - true.center) < 1e-6
    assert np.linalg.norm(found.velocity) < 0.1


def test_one_keypoint_that_leaps_is_an_outlier_and_moves_nothing() -> None:
    (one, q), (other, _) = tracked(30), tracked(30)
    points, without = seen(q[30]), seen(q[30])
    points[K["wrist_l"]] += [0.0, -0.7, 0.0]
    without[K["wrist_l"]] = np.nan
    leap, missing = one.update(30 * DT, points), other.update(30 * DT, without)
    assert leap.flags == ("outliers",)
    assert leap.person is not None and missing.person is not None
    np.testing.assert_array_equal(leap.person.q, missing.person.q)


def test_a_person_the_model_does_not_fit_is_named() -> None:
    points = seen(human.rest_posture(0.0, 1.2, -1.5))
    root = points[K["mid_hip"]]
    estimate = PersonEstimator(CELL.body).update(0.0, root + 1.55 * (points - root))
    assert "misfit" in estimate.flags and estimate.misfit_m > 0.1


@pytest.mark.parametrize("name", POSTURES)
def test_joint_angles_are_given_only_where_the_model_fits(name: str) -> None:
    points = posture(name, CELL.floor_z)
    estimator = PersonEstimator(CELL.body, floor_z=CELL.floor_z)
    estimate = estimator.update(0.0, points)
    assert estimate.cylinder is not None and holds(estimate.cylinder, points)
    assert "foreign-frame" not in estimate.flags
    if estimate.person is None:
        later = estimator.at(1.0)  # nothing is known any more, and the last fit was bad
        assert later.stale and later.person is None and later.cylinder is not None
    else:
        joints = human.joint_points(estimate.person.q, CELL.body)
        near = np.linalg.norm(joints["neck"] - points[K["neck"]])
        assert near < 1.1 * UNFIT


def test_people_who_stand_are_given_joint_angles_and_those_who_lie_are_not() -> None:
    for name, fits in (("standing", True), ("bent by 90 degrees", True), ("kneeling", False)):
        estimator = PersonEstimator(CELL.body, floor_z=CELL.floor_z)
        estimate = estimator.update(0.0, posture(name, CELL.floor_z))
        assert (estimate.person is not None) is fits


def test_a_frame_in_another_frame_is_unseen_and_reported() -> None:
    estimator, q = tracked(30)
    estimate = estimator.update(30 * DT, 1000.0 * seen(q[30]))
    assert estimate.flags == ("foreign-frame",) and "millimetres" in str(estimate.implausible)
    assert estimate.age_s == pytest.approx(DT)
    for k in range(31, 40):
        estimate = estimator.update(k * DT, 1000.0 * seen(q[k]))
    assert estimate.stale and estimate.age_s == pytest.approx(10 * DT)
    assert estimator.update(40 * DT, seen(q[40])).flags == ()


def test_a_mirrored_frame_counts_as_unseen_until_it_is_right() -> None:
    estimator, q = tracked(30)
    for k in range(30, 90):
        mirrored = seen(q[k]) * [-1.0, 1.0, 1.0]
        estimate = estimator.update(k * DT, seen(q[k]) if k == 45 else mirrored)
    assert {"mirrored", "foreign-frame", "stale"} <= set(estimate.flags)
    assert "mirrored" in str(estimate.implausible) and estimate.age_s > 0.5
    estimate = estimator.update(90 * DT, seen(q[90]))
    assert estimate.flags == ("restarted",) and estimate.implausible is None


def test_a_frame_with_both_sides_exchanged_now_and_then_is_used() -> None:
    estimator, q = tracked(30)
    for k in range(30, 90):
        points = seen(q[k])
        if k % 3:
            points = swap_sides(swap_sides(points, "arms"), "legs")
        estimate = estimator.update(k * DT, points)
        assert estimate.age_s == 0.0 and "foreign-frame" not in estimate.flags


def test_a_mirrored_person_is_named() -> None:
    points = seen(human.rest_posture(0.0, 1.2, -1.5))
    for flipped in (points * [-1.0, 1.0, 1.0], points * [1.0, -1.0, 1.0]):
        assert "mirrored" in PersonEstimator(CELL.body).update(0.0, flipped).flags
    assert PersonEstimator(CELL.body).update(0.0, points).flags == ()


def test_single_mirrored_frame_counts_long_after_another_one() -> None:
    mirrored = seen(human.rest_posture(0.0, 1.2, -1.5)) * [-1.0, 1.0, 1.0]
    estimator = PersonEstimator(CELL.body)
    first = estimator.update(0.0, mirrored)
    again = estimator.update(10.0, mirrored)
    assert first.flags == ("mirrored", "arms-swapped", "legs-swapped")
    assert "mirrored" in again.flags and "foreign-frame" not in again.flags


def test_a_kneeling_person_who_looks_down_stays_seen() -> None:
    estimator = PersonEstimator(CELL.body, floor_z=CELL.floor_z)
    points = kneeling_and_looking_down(CELL.floor_z)
    for k in range(60):
        estimate = estimator.update(k * DT, points)
        assert estimate.flags == ("misfit",) and estimate.age_s == 0.0


@pytest.mark.parametrize("t", [np.nan, np.inf, 29 * DT, 0.0])
def test_a_frame_without_a_later_time_is_refused(t: float) -> None:
    estimator, q = tracked(30)
    with pytest.raises(InvalidInput, match="later"):
        estimator.update(t, seen(q[30]))


def test_a_refused_frame_leaves_no_trace() -> None:
    (one, q), (other, _) = tracked(30), tracked(30)
    for wrong in (np.zeros((3, 25)), np.zeros((24, 3)), "nobody"):
        with pytest.raises(InvalidInput):
            one.update(30 * DT, wrong)
    a, b = one.update(31 * DT, seen(q[31])), other.update(31 * DT, seen(q[31]))
    assert a.flags == b.flags == ()
    assert a.person is not None and b.person is not None
    np.testing.assert_array_equal(a.person.q, b.person.q)


def test_the_past_cannot_be_asked_for() -> None:
    estimator, _ = tracked(30)
    for t in (0.0, np.nan):
        with pytest.raises(InvalidInput, match="earlier"):
            estimator.at(t)


def test_any_finite_frames_give_a_finite_estimate() -> None:
    rng, estimator, taken = np.random.default_rng(8), PersonEstimator(CELL.body), 0
    q = human.rest_posture(0.0, 1.2, -1.5)
    for k in range(200):
        points = seen(q) + rng.uniform(-0.3, 0.3, (25, 3))
        points[rng.random(25) < rng.random()] = np.nan
        points[rng.random((25, 3)) < 0.1 * rng.random()] = rng.choice([np.nan, np.inf, 1e300])
        estimate = estimator.update(k * DT, points)
        taken += bool(np.isfinite(estimate.age_s) and estimate.age_s < DT)
        if estimate.person is not None:
            assert (
                np.isfinite(estimate.person.q).all() and np.isfinite(estimate.person.qd).all()
            )
        assert estimate.cylinder is None or np.isfinite(estimate.cylinder.radius)
    assert taken > 100


def test_a_size_without_sense_is_refused_by_name() -> None:
    with pytest.raises(InvalidInput, match="size"):
        PersonEstimator(np.nan)
