import numpy as np
import pytest

from app.errors import BadRecording
from app.sim.human.anthropometry import BodySize
from app.sim.mocap.bvh import read_bvh
from app.sim.mocap.joint_centres import model_points
from app.sim.mocap.joint_names import find_joints
from app.sim.mocap.read_options import UNITS
from app.sim.mocap.skeletons import body_track
from tests.sim.recorded_person import SKELETONS, TUM, bvh_text, working
from tests.sim.recorded_skeleton import Person, skeleton

NECK = "OFFSET 0.0 440.0 0.0"
TRUTH = model_points(working(10), np.full(10, 0.95), BodySize())


def fault(text: str) -> str:
    with pytest.raises(BadRecording) as caught:
        body_track(read_bvh(text))
    return caught.value.faults[0].text


@pytest.mark.parametrize("names", SKELETONS.values(), ids=SKELETONS)
def test_joints_of_every_common_skeleton_are_found(names: dict[str, str]) -> None:
    track, _ = body_track(read_bvh(bvh_text(working(10), names=names)))
    np.testing.assert_allclose(track.points, TRUTH, atol=1e-6)
    assert (track.hips is not None) == ("thigh" in names)


@pytest.mark.parametrize("unit", UNITS)
def test_unit_is_found_without_legs_and_head(unit: str) -> None:
    text = bvh_text(working(10), unit=UNITS[unit])
    track, reading = body_track(read_bvh(text))
    assert reading.unit == reading.root_unit == unit
    np.testing.assert_allclose(track.points, TRUTH, atol=1e-5)


def test_pelvis_before_the_trunk_does_not_make_the_person_lean() -> None:
    text = bvh_text(working(10), names=TUM)
    forward_marker = text.replace(NECK, "OFFSET -60.0 440.0 0.0")
    assert forward_marker != text
    track, _ = body_track(read_bvh(forward_marker))
    expected = np.arctan2(60.0, 440.0)
    assert np.arccos(track.upright[2, 2]) == pytest.approx(expected)


def test_side_may_stand_before_or_behind_the_name() -> None:
    sides = ["Arm.L", "ForeArm.L", "Hand.L", "arm_r", "forearm_r", "hand_r"]
    found = find_joints(["Root", "Neck", *sides], [-1, 0, 1, 2, 3, 1, 5, 6])
    assert [found[name] for name in ("shoulder_l", "wrist_l", "elbow_r")] == [(2,), (4,), (6,)]


def test_missing_joint_is_named_beside_those_the_file_has() -> None:
    message = fault(bvh_text(working(10)).replace("left_hand", "left_tentacle"))
    assert "HIERARCHY has no joint that is known as wrist_l" in message
    assert "left_tentacle" in message


def test_angles_in_radians_are_refused() -> None:
    lines = bvh_text(working(10)).splitlines()
    start = lines.index("Frame Time: 0.02") + 1
    for k in range(start, len(lines)):
        row = np.array([float(word) for word in lines[k].split()])
        row[3:] = np.radians(row[3:])
        lines[k] = " ".join(f"{one:.6f}" for one in row)
    message = fault("\n".join(lines))
    assert message.startswith(f"frames from line {start + 1}")
    assert "looks like radians" in message


def test_positions_in_another_unit_than_the_skeleton_are_refused() -> None:
    q = working(10)
    q[:, :2] *= 1000.0
    assert "positions and offsets are probably in two units" in fault(bvh_text(q))


def test_person_who_hangs_head_down_is_refused() -> None:
    hanging = skeleton(Person(up="-y"))[0]
    assert "must point up, along y or z, in most frames: with y up" in fault(hanging)


def test_body_with_an_arm_of_no_length_is_refused() -> None:
    text = bvh_text(working(10)).replace("OFFSET 0.0 -290.0", "OFFSET 0.0 0.0", 1)
    assert fault(text).startswith("upper_arm_l = 0.000 m must be 0.1")


def test_person_whose_sides_are_mixed_up_is_refused() -> None:
    text = bvh_text(working(10)).replace("left_", "x_").replace("right_", "left_")
    assert "left and right are mixed up" in fault(text.replace("x_", "right_"))


def test_frozen_file_is_refused() -> None:
    q = np.tile(working(1), (10, 1))
    assert "must show a moving person" in fault(bvh_text(q))
