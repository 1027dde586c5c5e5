from dataclasses import replace

import numpy as np
import pytest

from app.sim.human.anthropometry import BodySize
from app.sim.mocap.bvh import forward, read_bvh
from app.sim.mocap.inverse_kinematics import body_angles
from app.sim.mocap.joint_centres import model_points
from app.sim.mocap.joint_names import find_joints
from app.sim.mocap.read_options import UNITS
from app.sim.mocap.skeletons import body_track
from tests.sim.recorded_person import CMU, SKELETONS, TUM, bvh_text, fault_of, working
from tests.sim.recorded_skeleton import Person, skeleton

NECK = "OFFSET 0.0 440.0 0.0"
TRUTH = model_points(working(10), np.full(10, 0.95), BodySize())


def fault(text: str) -> str:
    return fault_of(lambda: body_track(read_bvh(text)))


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


@pytest.mark.parametrize("n_turns", [0.0, 2.0])
def test_angles_in_radians_are_refused(n_turns: float) -> None:
    lines = bvh_text(working(10)).splitlines()
    start = lines.index("Frame Time: 0.02") + 1
    for k in range(start, len(lines)):
        row = np.array([float(word) for word in lines[k].split()])
        row[3:] = np.radians(row[3:])
        row[5] += 2.0 * np.pi * n_turns * (k - start) / 10.0  # the person turns round
        lines[k] = " ".join(f"{one:.6f}" for one in row)
    message = fault("\n".join(lines))
    assert message.startswith(f"frames from line {start + 1}")
    assert "looks like radians" in message


def test_positions_alone_have_no_unit_of_angles() -> None:
    whole = read_bvh(bvh_text(working(10)))
    points = forward(whole, range(len(whole.joints)))
    joints = tuple(
        replace(one, channels=("Xposition", "Yposition", "Zposition")) for one in whole.joints
    )
    parents = np.array([one.parent for one in joints])
    moved = points - np.where(parents[:, None] >= 0, points[:, parents], 0.0)
    bare = replace(whole, joints=joints, values=moved.reshape(len(points), -1))
    track, _ = body_track(bare)
    np.testing.assert_allclose(track.points, TRUTH, atol=1e-6)


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


def test_legs_of_the_other_side_are_refused() -> None:
    text = bvh_text(working(10), names=CMU)
    for part in ("UpLeg", "Foot"):
        text = text.replace(f"Left{part}", "x").replace(f"Right{part}", f"Left{part}")
        text = text.replace("x", f"Right{part}", 1)
    message = fault(text)
    assert message.startswith("hips and shoulders = 1") and "degrees apart" in message
    assert "left and right of the legs, or of the arms, are mixed up" in message


def test_hips_at_one_place_leave_the_heading_to_the_shoulders() -> None:
    text = bvh_text(working(10), names=CMU)
    apart = ("OFFSET 0.0 -50.0 -90.0", "OFFSET 0.0 -50.0 90.0")
    assert all(text.count(offset) == 1 for offset in apart)
    for offset in apart:
        text = text.replace(offset, "OFFSET 0.0 -50.0 0.0")
    track, _ = body_track(read_bvh(text))
    found, _ = body_angles(track, BodySize())
    np.testing.assert_allclose(found[:, 2], working(10)[:, 2], atol=0.5)


def test_frozen_file_is_refused() -> None:
    q = np.tile(working(1), (10, 1))
    assert "must show a moving person" in fault(bvh_text(q))
