"""What passes as key-points: what is missing, what one point costs, who cannot stand here."""

import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.human.kernels.kinematics import PELVIS_Z
from app.sim.mocap.importer import read_motion
from app.sim.perception.keypoint_check import check_keypoints
from app.sim.perception.keypoints import BODY_25, K, keypoints_of
from tests.sim.mocap.test_importer import CLIPS
from tests.sim.postures import FRAMES, POSTURES, posture
from tests.sim.tracked_person import CELL, seen, work

FLOOR = CELL.floor_z
NAN, INF = np.nan, np.inf


def person() -> np.ndarray:
    return seen(work(1, 12.0)[1][100])


@pytest.mark.parametrize("shape", [(24, 3), (25, 2), (25,), (1, 25, 3), (0, 3), (75,)])
def test_another_shape_is_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(InvalidInput, match=r"\(25, 3\)"):
        check_keypoints(np.zeros(shape))


@pytest.mark.parametrize("values", ["what", None, [["a"] * 3] * 25, [[1.0, 2.0], [3.0]], {}])
def test_what_is_not_numbers_is_refused(values: object) -> None:
    with pytest.raises(InvalidInput) as caught:
        check_keypoints(values)  # type: ignore[arg-type]
    assert caught.value.field == "keypoints"


@pytest.mark.parametrize("point", [[NAN] * 3, [0.0] * 3, [-0.0] * 3, [-1.0] * 3])
def test_a_missing_point_costs_that_point_and_needs_no_name(point: list[float]) -> None:
    points = person()
    points[K["wrist_l"]] = point
    frame = check_keypoints(points, floor_z=FLOOR)
    assert np.flatnonzero(~frame.seen).tolist() == [K["wrist_l"]]
    assert np.isnan(frame.points[K["wrist_l"]]).all()
    assert frame.unusable == frame.outliers == ()


@pytest.mark.parametrize("trust", [0.0, 0.05, NAN, -0.005])
def test_a_distrusted_point_is_missing_whatever_its_numbers(trust: float) -> None:
    points, confidences = person(), np.ones(25)
    points[3, 1] = NAN
    confidences[3] = confidences[4] = trust
    frame = check_keypoints(points, confidences, floor_z=FLOOR)
    assert np.flatnonzero(~frame.seen).tolist() == [3, 4] and frame.unusable == ()


@pytest.mark.parametrize(
    "point",
    [[NAN, 1.0, 0.2], [0.1, NAN, NAN], [INF, 1.0, 0.0], [INF] * 3, [-INF, NAN, NAN]]
    + [[1e9, 0.0, 0.0], [-9999.0] * 3, [3.4e38] * 3],
)
def test_a_point_that_cannot_be_used_is_dropped_and_named(point: list[float]) -> None:
    points = person()
    points[K["elbow_r"]] = point
    frame = check_keypoints(points, floor_z=FLOOR)
    assert frame.unusable == ("elbow_r",) and frame.implausible is None
    assert frame.seen.sum() == 24 and np.isnan(frame.points[K["elbow_r"]]).all()


@pytest.mark.parametrize("trust", [-0.1, 1.5, 87.0, INF, -INF])
def test_a_confidence_out_of_range_drops_its_point_and_names_it(trust: float) -> None:
    confidences = np.ones(25)
    confidences[3] = trust
    frame = check_keypoints(person(), confidences, floor_z=FLOOR)
    assert frame.unusable == (BODY_25[3],) and frame.seen.sum() == 24


def test_a_confidence_a_hair_above_one_is_one() -> None:
    frame = check_keypoints(person(), np.full(25, 1.0000001))
    assert (frame.confidences == 1.0).all()


def test_most_points_unusable_leave_the_others() -> None:
    points = person()
    points[K["mid_hip"] :] = -9999.0
    frame = check_keypoints(points, floor_z=FLOOR)
    assert frame.implausible is None and frame.seen.sum() == K["mid_hip"]


@pytest.mark.parametrize(
    ("point", "trust", "text"),
    [
        ([0.1, 1.0, 0.2], 87.0, "all confidences are outside [0, 1]: 87 to 87 (are these perc"),
        ([0.1, 1.0, 0.2], -1.0, "all confidences are outside [0, 1]: -1 to -1"),
        ([320.0, 240.0, NAN], 1.0, "no key-point has three finite coordinates within 100 m"),
        ([INF] * 3, 87.0, "all confidences are outside [0, 1]"),
    ],
)
@pytest.mark.parametrize("n_missing", [0, 20])
def test_a_person_without_a_usable_point_is_not_taken_for_an_absent_one(
    point: list[float], trust: float, text: str, n_missing: int
) -> None:
    points, confidences = np.tile(point, (25, 1)), np.full(25, trust)
    points[:n_missing], confidences[:n_missing] = NAN, 1.0
    frame = check_keypoints(points, confidences, floor_z=FLOOR)
    assert not frame.seen.any() and frame.unusable == BODY_25[n_missing:]
    assert frame.outliers == () and text in str(frame.implausible)


@pytest.mark.parametrize("other", [[NAN] * 3, [INF] * 3, [0.0] * 3])
def test_a_person_of_low_confidences_is_not_taken_for_an_absent_one(
    other: list[float],
) -> None:
    points, confidences = person(), np.full(25, 0.04)
    points[20:], confidences[5] = other, 0.09
    frame = check_keypoints(points, confidences, floor_z=FLOOR)
    assert not frame.seen.any() and frame.outliers == ()
    assert "confidence of 0.1 or more: the greatest is 0.09" in str(frame.implausible)
    confidences[7] = 0.1
    frame = check_keypoints(points, confidences, floor_z=FLOOR)
    assert frame.seen.sum() == 1 and frame.implausible is None


def test_all_missing_is_a_frame_without_anybody() -> None:
    for points in (np.full((25, 3), NAN), np.zeros((25, 3)), np.full((25, 3), -1.0)):
        frame = check_keypoints(points, floor_z=FLOOR)
        assert not frame.seen.any() and frame.implausible is None


def test_a_keypoint_far_from_the_others_is_dropped_and_named() -> None:
    points = person()
    points[K["ankle_r"]] = [50.0, 0.0, 0.0]
    frame = check_keypoints(points)
    assert frame.outliers == ("ankle_r",)
    assert frame.seen.sum() == 24


def test_no_person_at_work_has_outliers_or_is_implausible() -> None:
    for seed in (1, 2, 3):
        for q in work(seed, 12.0)[1][::10]:
            frame = check_keypoints(seen(q), floor_z=FLOOR)
            assert frame.seen.all() and frame.implausible is None


@pytest.mark.parametrize("scale", [0.85, 1.0, 1.15])
@pytest.mark.parametrize("name", POSTURES)
def test_every_posture_of_a_person_in_the_cell_is_plausible(name: str, scale: float) -> None:
    rng = np.random.default_rng(3)
    points = posture(name, FLOOR, scale)
    for hidden in ((), range(K["mid_hip"], 25), range(8), [*range(8, 15), *range(19, 25)]):
        partial = points + 0.03 * rng.standard_normal(points.shape)
        partial[list(hidden)] = NAN
        assert check_keypoints(partial, floor_z=FLOOR).implausible is None


def test_the_feet_alone_or_the_face_alone_are_plausible() -> None:
    points = posture("standing", FLOOR)
    for part in ("ankle", "eye"):
        alone = np.full((25, 3), NAN)
        alone[[K[f"{part}_r"], K[f"{part}_l"]]] = points[[K[f"{part}_r"], K[f"{part}_l"]]]
        assert check_keypoints(alone, floor_z=FLOOR).implausible is None


@pytest.mark.parametrize("name", ["standing", "reaching forward", "bent by 90 degrees"])
@pytest.mark.parametrize("frame", FRAMES)
def test_a_person_in_another_frame_is_implausible_and_the_numbers_are_reported(
    frame: str, name: str
) -> None:
    camera = np.array([0.2, -1.0, 0.8])
    points = (posture(name, FLOOR) - camera) @ FRAMES[frame].T
    found = check_keypoints(points, floor_z=FLOOR)
    assert found.implausible is not None and "over the floor" in found.implausible
    assert not found.seen.any() and np.isnan(found.points).all()


def test_a_cameras_axes_are_named() -> None:
    points = (posture("standing", FLOOR) - [0.2, -1.0, 0.8]) @ FRAMES[
        "a camera's, y down and z ahead"
    ].T
    assert "does y point down here: a camera's frame?" in str(
        check_keypoints(points, floor_z=FLOOR).implausible
    )


def test_an_origin_on_the_floor_is_named() -> None:
    for name in ("standing", "kneeling", "lying on the back", "on a step"):
        found = check_keypoints(posture(name, 0.0), floor_z=-0.95)
        assert found.implausible is None or "does z count from the floor" in found.implausible
    found = check_keypoints(posture("standing", 0.0), floor_z=FLOOR)
    assert "does z count from the floor here?" in str(found.implausible)


FEET = [K[f"{part}_{s}"] for part in ("ankle", "heel", "big_toe", "small_toe") for s in "rl"]


@pytest.mark.parametrize("scale", [0.75, 0.85, 1.0, 1.1])
@pytest.mark.parametrize("base", [0.7, 0.75, 0.95])
def test_short_and_tall_people_with_the_floor_as_origin_are_implausible(
    base: float, scale: float
) -> None:
    for name in ("standing", "arms up", "reaching forward", "kneeling on one knee"):
        points = posture(name, 0.0, scale)
        for hidden in ([], FEET):
            points[hidden] = NAN
            found = check_keypoints(points, floor_z=-base)
            assert "does z count from the floor here?" in str(found.implausible), name
    found = check_keypoints(posture("sitting on a chair", 0.0, scale), floor_z=-base)
    assert "does z count from the floor here?" in str(found.implausible)


@pytest.mark.parametrize("scale", [0.75, 0.85, 1.0])
@pytest.mark.parametrize("base", [0.7, 0.75, 0.95])
def test_people_with_the_robot_as_origin_in_a_cell_of_the_floor_are_implausible(
    base: float, scale: float
) -> None:
    points = posture("standing", -base, scale)
    for hidden in ([], FEET):
        points[hidden] = NAN
        found = check_keypoints(points, floor_z=0.0)
        assert "over the floor" in str(found.implausible)


@pytest.mark.parametrize("up", [0.75, 2.0, -0.75, -2.0])
def test_a_person_over_or_under_the_floor_is_implausible(up: float) -> None:
    points = posture("standing", FLOOR) + [0.0, 0.0, up]
    assert "over the floor" in str(check_keypoints(points, floor_z=FLOOR).implausible)


def test_a_person_who_lies_two_metres_over_the_table_is_implausible() -> None:
    points = posture("lying on the table", FLOOR) + [0.0, 0.0, 2.0]
    upper = points.copy()
    upper[K["mid_hip"] :] = NAN
    for some in (points, upper):
        assert check_keypoints(some, floor_z=FLOOR).implausible is not None


@pytest.mark.parametrize(
    ("factor", "unit"),
    [(1000.0, "millimetres"), (100.0, "centimetres"), (39.37, "inches"), (3.281, "feet")],
)
def test_other_units_are_named(factor: float, unit: str) -> None:
    for points in (person(), posture("kneeling", FLOOR)):
        assert f"are these {unit}?" in str(check_keypoints(factor * points).implausible)


@pytest.mark.parametrize("factor", [0.01, 0.001, 0.4, 2.0])
def test_a_skeleton_of_no_persons_size_is_implausible(factor: float) -> None:
    points = person()
    root = points[K["mid_hip"]]
    found = check_keypoints(root + factor * (points - root))
    assert "times those of the median adult" in str(found.implausible)


def test_a_single_keypoint_in_millimetres_is_implausible() -> None:
    points = np.full((25, 3), NAN)
    points[K["neck"]] = [100.0, 1400.0, 500.0]
    assert "millimetres" in str(check_keypoints(points).implausible)


if CLIPS:  # without clips there is no test to skip

    def test_recorded_people_are_plausible() -> None:
        for clip in CLIPS[:6]:
            for run in read_motion(clip.read_bytes(), clip.name).runs:
                for k in range(0, len(run.q), 25):
                    size = run.size.vector(FLOOR)
                    size[PELVIS_Z] += run.pelvis_z[k]
                    points = keypoints_of(run.q[k], size, FLOOR)
                    assert check_keypoints(points, floor_z=FLOOR).implausible is None
