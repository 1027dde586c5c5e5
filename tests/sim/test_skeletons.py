import numpy as np
import pytest

from app.errors import BadMotion
from app.sim.body_size import BodySize
from app.sim.body_track import model_points
from app.sim.bvh import read_bvh
from app.sim.read_options import UNITS, ReadOptions
from app.sim.skeletons import body_track, skeleton_joints
from tests.sim.recorded_person import SKELETONS, TUM, bvh_text, working

NECK = "OFFSET 0.0 440.0 0.0"
TRUTH = model_points(working(10), np.full(10, 0.95), BodySize())


def fault(text: str) -> str:
    with pytest.raises(BadMotion) as caught:
        body_track(read_bvh(text))
    return caught.value.faults[0].text


@pytest.mark.parametrize("names", SKELETONS.values(), ids=SKELETONS)
def test_joints_of_every_common_skeleton_are_found(names: dict[str, str]) -> None:
    track, _ = body_track(read_bvh(bvh_text(working(10), names=names)))
    np.testing.assert_allclose(track.points, TRUTH, atol=1e-6)
    assert (track.hips is not None) == ("thigh" in names)


@pytest.mark.parametrize("unit", UNITS)
def test_unit_is_found_from_the_length_of_the_arm(unit: str) -> None:
    text = bvh_text(working(10), unit=UNITS[unit])
    track, found = body_track(read_bvh(text))
    assert found == unit
    np.testing.assert_allclose(track.points, TRUTH, atol=1e-5)


def test_file_with_z_up_is_read_as_it_stands() -> None:
    lines = bvh_text(working(10)).splitlines()
    # The same person lies in a file whose z is up: turn everything at the root.
    start = lines.index("Frame Time: 0.02") + 1
    head = "\n".join(lines[:start])
    rows = np.array([[float(word) for word in line.split()] for line in lines[start:]])
    x, y, z = rows[:, :3].T.copy()
    rows[:, :3] = np.column_stack([x, -z, y])
    head = head.replace("6 Xposition Yposition Zposition", "6 Xposition Yposition Zposition", 1)
    head = head.replace("Zrotation Xrotation Yrotation", "Xrotation Yrotation Zrotation", 1)
    yaw = rows[:, 5].copy()
    rows[:, 3:6] = np.column_stack([np.full(10, 90.0), yaw, np.zeros(10)])
    body = "\n".join(" ".join(repr(float(one)) for one in row) for row in rows)
    track, _ = body_track(read_bvh(f"{head}\n{body}\n"))
    np.testing.assert_allclose(track.points, TRUTH, atol=1e-6)


def test_pelvis_before_the_trunk_does_not_make_the_person_lean() -> None:
    text = bvh_text(working(10), names=TUM)
    forward_marker = text.replace(NECK, "OFFSET -60.0 440.0 0.0")
    assert forward_marker != text
    track, _ = body_track(read_bvh(forward_marker))
    expected = np.arctan2(60.0, 440.0)
    assert np.arccos(track.upright[2, 2]) == pytest.approx(expected)


def test_side_may_stand_before_or_behind_the_name() -> None:
    sides = ["Arm.L", "ForeArm.L", "Hand.L", "arm_r", "forearm_r", "hand_r"]
    found = skeleton_joints(["Root", "Neck", *sides])
    assert [found[name] for name in ("shoulder_l", "wrist_l", "elbow_r")] == [2, 4, 6]


def test_missing_joint_is_named_beside_those_the_file_has() -> None:
    told = fault(bvh_text(working(10)).replace("left_hand", "left_tentacle"))
    assert "HIERARCHY has no joint that is known as wrist_l" in told
    assert "left_tentacle" in told


def test_body_of_no_known_unit_is_refused() -> None:
    assert "must be 0.4 to 0.75 m in one of the units" in fault(bvh_text(working(10), unit=3.0))


def test_angles_in_radians_are_refused() -> None:
    lines = bvh_text(working(10)).splitlines()
    start = lines.index("Frame Time: 0.02") + 1
    for k in range(start, len(lines)):
        row = np.array([float(word) for word in lines[k].split()])
        row[3:] = np.radians(row[3:])
        lines[k] = " ".join(f"{one:.6f}" for one in row)
    told = fault("\n".join(lines))
    assert told.startswith(f"frames from line {start + 1}")
    assert "looks like radians" in told


def test_positions_in_another_unit_than_the_skeleton_are_refused() -> None:
    q = working(10)
    q[:, :2] *= 1000.0
    assert "positions and offsets are probably in two units" in fault(bvh_text(q))


def test_root_path_in_a_unit_of_its_own_is_read_where_it_is_stated() -> None:
    lines = bvh_text(working(10), unit=0.01).splitlines()
    start = lines.index("Frame Time: 0.02") + 1
    for k in range(start, len(lines)):
        place, rest = lines[k].split()[:3], lines[k].split()[3:]
        lines[k] = " ".join([*(repr(float(one) / 100.0) for one in place), *rest])
    options = ReadOptions(unit="cm", root_unit="m")
    track, _ = body_track(read_bvh("\n".join(lines)), options)
    np.testing.assert_allclose(track.points, TRUTH, atol=1e-5)


def test_person_who_hangs_head_down_is_refused() -> None:
    text = bvh_text(working(10)).replace(NECK, "OFFSET 0.0 -440.0 0.0")
    assert "must point up, along y or z" in fault(text)


def test_body_with_an_arm_of_no_length_is_refused() -> None:
    text = bvh_text(working(10)).replace("OFFSET 0.0 -290.0", "OFFSET 0.0 0.0", 1)
    assert fault(text).startswith("upper_arm_l = 0.000 m must be 0.15 to 0.5 m long")


def test_person_whose_sides_are_mixed_up_is_refused() -> None:
    text = bvh_text(working(10)).replace("left_", "x_").replace("right_", "left_")
    assert "left and right are mixed up" in fault(text.replace("x_", "right_"))


def test_frozen_file_is_refused() -> None:
    q = np.tile(working(1), (10, 1))
    assert "show nobody who moves" in fault(bvh_text(q))
