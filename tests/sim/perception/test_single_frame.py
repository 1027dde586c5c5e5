"""One frame without history: what it tells, what it holds, what it refuses."""

import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.human import model as human
from app.sim.perception.keypoints import BODY_25, K, keypoints_of, swap_sides
from app.sim.perception.observed_people import as_monitored, person_from_estimate
from app.sim.perception.single_frame import estimate_once
from tests.sim.perception.cylinder_contents import holds
from tests.sim.postures import FRAMES, POSTURES, posture
from tests.sim.tracked_person import CELL, seen, work

Q, QD = (values[100] for values in work(1, 12.0)[1:])
POINTS = seen(Q)


def velocities() -> np.ndarray:
    return (seen(Q + 1e-4 * QD) - seen(Q - 1e-4 * QD)) / 2e-4


def test_a_whole_frame_gives_the_posture_at_rest() -> None:
    estimate = estimate_once(POINTS, CELL.body)
    assert estimate.person is not None and estimate.flags == () and estimate.held == ()
    joints, true = (human.joint_points(q, CELL.body) for q in (estimate.person.q, Q))
    for name in ("wrist_r", "wrist_l", "elbow_r", "neck"):
        assert np.linalg.norm(joints[name] - true[name]) < 0.02
    assert not estimate.person.qd.any()


def test_velocities_of_keypoints_give_joint_speeds_and_the_cylinders() -> None:
    estimate = estimate_once(POINTS, CELL.body, velocities=velocities())
    assert estimate.person is not None and estimate.cylinder is not None
    np.testing.assert_allclose(estimate.person.qd, QD, atol=0.1)
    assert np.linalg.norm(estimate.cylinder.velocity) > 0.0


def test_velocities_follow_exchanged_sides() -> None:
    wrong = [swap_sides(each, "arms") for each in (POINTS, velocities())]
    estimate = estimate_once(wrong[0], CELL.body, velocities=wrong[1])
    assert estimate.flags == ("arms-swapped",) and estimate.person is not None
    np.testing.assert_allclose(estimate.person.qd, QD, atol=0.1)


def test_a_missing_arm_rests_and_is_named() -> None:
    points = POINTS.copy()
    points[[K["elbow_r"], K["wrist_r"]]] = np.nan
    estimate = estimate_once(points, CELL.body, velocities=velocities())
    assert estimate.missing == ("elbow_r", "wrist_r")
    assert "elbow_r" in estimate.held and "elbow_l" not in estimate.held
    assert estimate.person is not None
    np.testing.assert_allclose(estimate.person.q[10:14], human.REST_ARM)
    assert estimate.cylinder is not None
    arm = human.joint_points(Q, CELL.body)
    assert holds(estimate.cylinder, np.array([arm["elbow_r"], arm["wrist_r"]]))


def test_without_a_trunk_the_person_is_as_good_as_the_cylinder() -> None:
    points = np.full((25, 3), np.nan)
    points[[K["wrist_l"], K["elbow_l"]]] = POINTS[[K["wrist_l"], K["elbow_l"]]]
    estimate = estimate_once(points, CELL.body)
    assert estimate.person is None and estimate.cylinder is not None
    person = person_from_estimate(estimate)
    assert person is not None and person.cylinder is not None
    assert not person.measured
    np.testing.assert_allclose(person.q[:2], estimate.cylinder.center)


@pytest.mark.parametrize(
    ("points", "flag"),
    [
        (np.full((25, 3), np.nan), "never-seen"),
        (np.zeros((25, 3)), "never-seen"),
        (1000.0 * POINTS, "foreign-frame"),
        (POINTS @ FRAMES["a camera's, y down and z ahead"].T, "foreign-frame"),
        (POINTS + [0.0, 0.0, 2.0], "foreign-frame"),
    ],
)
def test_a_person_of_unknown_place_may_be_anywhere(points: np.ndarray, flag: str) -> None:
    velocities = np.ones((25, 3))
    estimate = estimate_once(points, CELL.body, velocities=velocities, floor_z=CELL.floor_z)
    assert flag in estimate.flags and estimate.person is None
    assert (estimate.implausible is not None) is (flag == "foreign-frame")
    person = person_from_estimate(estimate)
    assert person is not None and person.cylinder is not None
    x, y, r = person.cylinder
    assert r - np.hypot(x, y) > 2.0  # the robot is inside, wherever it reaches


def test_another_number_of_points_is_refused_with_its_place() -> None:
    with pytest.raises(InvalidInput, match="shape") as refused:
        estimate_once(POINTS[:24], CELL.body, place="people[2].")
    assert refused.value.field == "people[2].keypoints"


def test_velocities_that_cannot_be_are_named_and_count_as_zero() -> None:
    wrong, unknown = velocities(), velocities()
    for k, value in enumerate(([np.inf] * 3, [1e6, 0.0, 0.0], [np.nan, 1.0, 0.0])):
        wrong[k], unknown[k] = value, np.nan
    named = tuple(f"velocity of {name}" for name in BODY_25[:3])
    estimate = estimate_once(POINTS, CELL.body, velocities=wrong)
    same = estimate_once(POINTS, CELL.body, velocities=unknown)
    assert estimate.unusable == named and same.unusable == ()
    assert estimate.person is not None and same.person is not None
    np.testing.assert_array_equal(estimate.person.qd, same.person.qd)


@pytest.mark.parametrize("name", POSTURES)
def test_a_persons_cylinder_holds_every_posture(name: str) -> None:
    points = posture(name, CELL.floor_z)
    estimate = estimate_once(points, CELL.body, floor_z=CELL.floor_z)
    assert estimate.cylinder is not None and holds(estimate.cylinder, points)
    assert estimate.implausible is None and estimate.cylinder.radius < 2.0


def test_velocities_of_another_shape_are_refused() -> None:
    with pytest.raises(InvalidInput, match="shape") as refused:
        estimate_once(POINTS, CELL.body, velocities=np.zeros((3, 25)), place="people[0].")
    assert refused.value.field == "people[0].velocities"


def test_a_person_of_another_size_is_found_in_that_size() -> None:
    size = 1.1 * CELL.body
    points = keypoints_of(Q, size, CELL.floor_z)
    estimate = estimate_once(points, size)
    assert estimate.person is not None and estimate.person.size is not None
    np.testing.assert_array_equal(estimate.person.size, size)
    assert estimate.misfit_m < 0.01


def hand_behind_the_head() -> np.ndarray:
    """Return key-points of a standing person who stretches the right arm up and backward."""
    points = posture("standing", CELL.floor_z)
    points[K["elbow_r"]] = points[K["shoulder_r"]] + [0.05, 0.1, 0.26]
    points[K["wrist_r"]] = points[K["elbow_r"]] + [0.0, 0.1, 0.24]
    return points


@pytest.mark.parametrize(
    "points", [posture("leaning over the table", CELL.floor_z), hand_behind_the_head()]
)
def test_a_hand_beyond_the_joint_limits_is_monitored_where_it_is_seen(
    points: np.ndarray,
) -> None:
    estimate = estimate_once(points, CELL.body, floor_z=CELL.floor_z)
    monitored = as_monitored(estimate)
    assert estimate.person is not None and not estimate.held and "misfit" in estimate.flags
    assert monitored is not None and monitored.cylinder is not None
    x, y, r = monitored.cylinder
    wrists = points[[K["wrist_r"], K["wrist_l"]]]
    assert (np.hypot(wrists[:, 0] - x, wrists[:, 1] - y) < r).all()


@pytest.mark.parametrize("name", ["standing", "arms up", "arms wide", "reaching forward"])
def test_hands_within_the_joint_limits_are_monitored_by_joint_angles(name: str) -> None:
    estimate = estimate_once(posture(name, CELL.floor_z), CELL.body, floor_z=CELL.floor_z)
    monitored = as_monitored(estimate)
    assert monitored is not None and monitored.cylinder is None
    assert estimate.wrist_misfit_m < 0.1
