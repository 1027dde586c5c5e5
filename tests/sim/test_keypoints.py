"""What passes as key-points, and the key-points of our own body."""

import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim import human
from app.sim.keypoints import (
    BODY_25,
    GROUPS,
    MIRROR,
    K,
    check_keypoints,
    faces_backward,
    swap_sides,
    swapped_against,
)
from tests.sim.tracked_person import CELL, seen, work


def someone() -> np.ndarray:
    return seen(work(1, 12.0)[1][100])


def test_joints_of_the_model_are_its_keypoints() -> None:
    q = work(1, 12.0)[1][200]
    points, joints = seen(q), human.joint_points(q, CELL.body)
    names = [f"{part}_{s}" for part in ("shoulder", "elbow", "wrist") for s in "rl"]
    for name in ["neck", *names]:
        np.testing.assert_array_equal(points[K[name]], joints[name])
    np.testing.assert_array_equal(points[K["mid_hip"]], joints["pelvis"])


def test_feet_stand_on_the_floor_and_point_where_the_pelvis_faces() -> None:
    q = human.rest_posture(0.3, 1.0, 0.7)
    points = seen(q)
    heading = np.array([np.cos(0.7), np.sin(0.7), 0.0])
    for s in "rl":
        toe, heel = points[K[f"big_toe_{s}"]], points[K[f"heel_{s}"]]
        assert (toe - heel) @ heading > 0.15
        assert CELL.floor_z < heel[2] < points[K[f"ankle_{s}"]][2] < points[K[f"knee_{s}"]][2]
    assert points[K["big_toe_l"]] @ [-np.sin(0.7), np.cos(0.7), 0] > points[K["mid_hip"]] @ [
        -np.sin(0.7),
        np.cos(0.7),
        0,
    ]


def test_mirror_pairs_right_with_left_and_the_middle_with_itself() -> None:
    assert (MIRROR[MIRROR] == np.arange(25)).all()
    middle = {BODY_25[k] for k in np.flatnonzero(MIRROR == np.arange(25))}
    assert middle == {"nose", "neck", "mid_hip"}
    assert sum(len(members) for members in GROUPS.values()) == 22


@pytest.mark.parametrize("units", [1000.0, 100.0, 0.01])
def test_other_units_than_metres_are_refused_with_the_rule(units: float) -> None:
    with pytest.raises(InvalidInput, match="m") as caught:
        check_keypoints(units * someone())
    assert caught.value.field == "keypoints"
    assert "unit" in caught.value.rule or "millimetres" in caught.value.rule


def test_a_single_keypoint_in_millimetres_is_refused() -> None:
    points = np.full((25, 3), np.nan)
    points[K["neck"]] = [100.0, 1400.0, 500.0]
    with pytest.raises(InvalidInput, match="millimetres"):
        check_keypoints(points)


@pytest.mark.parametrize("shape", [(24, 3), (25, 2), (25,), (1, 25, 3), (0, 3), (75,)])
def test_another_shape_is_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(InvalidInput, match=r"\(25, 3\)"):
        check_keypoints(np.zeros(shape))


@pytest.mark.parametrize("values", ["what", None, [["a"] * 3] * 25, [[1.0, 2.0], [3.0]], {}])
def test_what_is_not_numbers_is_refused(values: object) -> None:
    with pytest.raises(InvalidInput) as caught:
        check_keypoints(values)  # type: ignore[arg-type]
    assert caught.value.field == "keypoints"


def test_infinity_is_refused_by_the_name_of_its_keypoint() -> None:
    points = someone()
    points[K["wrist_l"], 1] = -np.inf
    with pytest.raises(InvalidInput, match="finite") as caught:
        check_keypoints(points)
    assert caught.value.field == "keypoints.wrist_l"


@pytest.mark.parametrize("trust", [-0.1, 1.5, np.inf])
def test_confidences_outside_their_range_are_refused(trust: float) -> None:
    confidences = np.ones(25)
    confidences[3] = trust
    with pytest.raises(InvalidInput) as caught:
        check_keypoints(someone(), confidences)
    assert caught.value.field.startswith("confidences")


def test_missing_is_nan_or_zero_or_distrusted() -> None:
    points, confidences = someone(), np.ones(25)
    points[2, 1], points[5] = np.nan, 0.0
    confidences[7], confidences[8] = 0.05, np.nan
    frame = check_keypoints(points, confidences)
    assert set(np.flatnonzero(~frame.seen)) == {2, 5, 7, 8}
    assert np.isnan(frame.points[~frame.seen]).all()
    assert frame.strays == ()


def test_all_missing_is_a_frame_without_anybody() -> None:
    for points in (np.full((25, 3), np.nan), np.zeros((25, 3))):
        assert not check_keypoints(points).seen.any()


def test_a_keypoint_far_from_the_others_is_dropped_and_named() -> None:
    points = someone()
    points[K["ankle_r"]] = [1e7, 0.0, 0.0]
    frame = check_keypoints(points)
    assert frame.strays == ("ankle_r",)
    assert frame.seen.sum() == 24


def test_nobody_at_work_has_strays() -> None:
    for seed in (1, 2, 3):
        for q in work(seed, 12.0)[1][::10]:
            assert check_keypoints(seen(q)).seen.all()


@pytest.mark.parametrize("group", ["arms", "legs"])
def test_exchanged_sides_are_found_with_and_without_history(group: str) -> None:
    for q in work(2, 12.0)[1][::10]:
        points = seen(q)
        crossed = swap_sides(points, group)
        assert not swapped_against(points, points, group)
        assert swapped_against(crossed, points, group)
        assert not faces_backward(points, group)
        assert faces_backward(crossed, group)
