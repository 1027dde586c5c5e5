"""What passes as key-points, and the key-points of our own body."""

import numpy as np
import pytest

from app.sim.human import model as human
from app.sim.perception.keypoints import (
    BODY_25,
    GROUPS,
    MIRROR,
    K,
    faces_backward,
    swap_sides,
    swapped_against,
)
from tests.sim.postures import kneeling_and_looking_down, looking_down, posture
from tests.sim.tracked_person import CELL, seen, work


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


@pytest.mark.parametrize("group", ["arms", "legs"])
def test_exchanged_sides_are_found_with_and_without_history(group: str) -> None:
    for q in work(2, 12.0)[1][::10]:
        points = seen(q)
        crossed = swap_sides(points, group)
        assert not swapped_against(points, points, group)
        assert swapped_against(crossed, points, group)
        assert not faces_backward(points, group)
        assert faces_backward(crossed, group)


@pytest.mark.parametrize("pitch", [0.0, 0.6, 1.8, 2.3])
def test_a_person_who_looks_down_does_not_face_backward(pitch: float) -> None:
    assert not faces_backward(looking_down("bent by 90 degrees", CELL.floor_z, pitch), "arms")


def test_a_person_who_looks_up_with_the_head_back_does_not_face_backward() -> None:
    points = looking_down("standing", CELL.floor_z, -1.2)
    head = [K[name] for name in ("nose", "eye_r", "eye_l", "ear_r", "ear_l")]
    points[head] += [0.0, 0.15, -0.05]
    assert not faces_backward(points, "arms")
    assert faces_backward(swap_sides(points, "arms"), "arms")


def test_toes_of_a_kneeling_person_do_not_tell_where_the_person_faces() -> None:
    assert not faces_backward(kneeling_and_looking_down(CELL.floor_z), "legs")
    assert faces_backward(swap_sides(posture("standing", CELL.floor_z), "legs"), "legs")
    hidden = posture("standing", CELL.floor_z)
    hidden[[K["knee_r"], K["knee_l"]]] = np.nan
    assert faces_backward(swap_sides(hidden, "legs"), "legs")
