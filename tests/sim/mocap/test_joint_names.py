from collections.abc import Callable

import numpy as np
import pytest

from app.errors import BadRecording
from app.sim.mocap.bvh import read_bvh
from app.sim.mocap.joint_names import find_joints
from app.sim.mocap.read_options import ReadOptions
from app.sim.mocap.skeletons import body_track
from tests.sim.recorded_skeleton import Person, skeleton

BIPED = {
    "Hips": "Pelvis", "Chest": "Spine1", "LeftShoulder": "L Clavicle", "LeftArm": "L UpperArm",
    "LeftForeArm": "L Forearm", "LeftHand": "L Hand", "LeftUpLeg": "L Thigh",
    "LeftLeg": "L Calf", "LeftFoot": "L Foot", "LeftToeBase": "L Toe0",
}  # fmt: skip
VRM = {
    "Hips": "C_Hips", "Chest": "C_Chest", "Neck": "C_Neck", "Head": "C_Head",
    "LeftShoulder": "L_Shoulder", "LeftArm": "L_UpperArm", "LeftForeArm": "L_LowerArm",
    "LeftHand": "L_Hand", "LeftUpLeg": "L_UpperLeg", "LeftLeg": "L_LowerLeg",
    "LeftFoot": "L_Foot", "LeftToeBase": "L_ToeBase",
}  # fmt: skip
UNREAL = {
    "Hips": "pelvis", "Spine": "spine_01", "Chest": "spine_03", "Neck": "neck_01",
    "LeftShoulder": "clavicle_l", "LeftArm": "upperarm_l", "LeftForeArm": "lowerarm_l",
    "LeftHand": "hand_l", "LeftUpLeg": "thigh_l", "LeftLeg": "calf_l", "LeftFoot": "foot_l",
    "LeftToeBase": "ball_l",
}  # fmt: skip
KINECT = {
    "Hips": "SpineBase", "Chest": "SpineMid", "Neck": "SpineShoulder",
    "LeftShoulder": "ClavicleLeft", "LeftArm": "ShoulderLeft", "LeftForeArm": "ElbowLeft",
    "LeftHand": "WristLeft", "LeftUpLeg": "HipLeft", "LeftLeg": "KneeLeft",
    "LeftFoot": "AnkleLeft", "LeftToeBase": "FootLeft",
}  # fmt: skip


def written(names: dict[str, str], before: str = "", behind: str = "") -> Callable[[str], str]:
    """The names of another skeleton, the right side's made from the left's."""

    def named(role: str) -> str:
        found = names.get(role)
        if found is None and role.startswith("Right"):
            left = names.get(role.replace("Right", "Left"), "")
            found = {"L ": "R ", "L_": "R_"}.get(left[:2], "") + left[2:] if left else None
            if found is not None and left[:2] not in ("L ", "L_"):
                found = (
                    left[:-1] + "r" if left.endswith("_l") else left.replace("Left", "Right")
                )
        return f"{before}{found or role}{behind}"

    return named


@pytest.mark.parametrize(
    "named",
    [
        written(BIPED, "Bip01 "),
        written(BIPED, "Bip001_"),
        written(BIPED, "ValveBiped.Bip01_"),
        written({}, "mixamorig"),
        written({}, "mixamorig1_"),
        written({}, "Character1_"),
        written({}, "Robot "),
        written({}, "Left-hand rig "),
        written({}, "Max Mustermann:"),
        written({}, "", "_jnt"),
        written({}, "b_", ".001"),
        written(VRM, "J_Bip_"),
        written(UNREAL),
        written(UNREAL, "actor 1 "),
        written(KINECT),
    ],
    ids=lambda named: named("LeftArm"),
)
def test_names_of_other_tools_are_known(named: Callable[[str], str]) -> None:
    text, truth = skeleton(Person(named=named))
    track, reading = body_track(read_bvh(text))
    np.testing.assert_allclose(track.points, truth, atol=1e-4)
    assert reading.names["elbow_l"] == named("LeftForeArm")
    assert reading.names["toe_r"] == named("RightToeBase")


def test_every_joint_that_is_read_is_reported() -> None:
    _, reading = body_track(read_bvh(skeleton(Person())[0]))
    assert reading.names["pelvis"] == "Hips"
    assert reading.names["knee_r"] == "RightLeg"
    assert reading.names["crown"] == "Head.end"


@pytest.mark.parametrize("hand", ["Hand", "Palm", "HandEE"])
def test_wrist_is_the_wrist_where_a_hand_is_there_too(hand: str) -> None:
    names = ["Hips", "Neck"]
    for side in ("Left", "Right"):
        names += [side + one for one in ("Arm", "Elbow", "Wrist", hand)]
    found = find_joints(names, range(-1, len(names) - 1))
    assert (found["wrist_l"], found["wrist_r"]) == ((4,), (8,))


@pytest.mark.parametrize(
    ("ankle", "toe"), [("Ankle", "Foot"), ("Foot", "ToeBase"), ("Ankle", "Toe")]
)
def test_foot_is_the_ankle_only_where_no_ankle_is_there(ankle: str, toe: str) -> None:
    names = ["Hips", "Neck", "LeftArm", "LeftElbow", "LeftWrist", "RightArm", "RightElbow"]
    names += ["RightWrist", f"Left{ankle}", f"Left{toe}"]
    found = find_joints(names, range(-1, len(names) - 1))
    assert (found["ankle_l"], found["toe_l"]) == ((8,), (9,))


def test_without_a_neck_the_parents_of_the_shoulders_stand_for_it() -> None:
    text, truth = skeleton(Person(named=lambda role: "Spine9" if role == "Neck" else role))
    track, reading = body_track(read_bvh(text))
    assert reading.names["neck"] == "RightShoulder + LeftShoulder"
    np.testing.assert_allclose(track.points[:, 1], truth[:, 1], atol=0.01)  # 0 from the neck
    np.testing.assert_allclose(track.points[:, 2:], truth[:, 2:], atol=1e-4)


def test_without_neck_and_clavicles_it_is_the_chest() -> None:
    names = ["Hips", "Chest"]
    parents = [-1, 0]
    for side in ("Left", "Right"):
        for one in ("Arm", "ForeArm", "Hand"):
            parents.append(1 if one == "Arm" else len(names) - 1)
            names.append(side + one)
    assert find_joints(names, parents)["neck"] == (1,)


def test_joints_of_any_name_can_be_stated() -> None:
    strange = {"Hips": "Hüfte", "LeftHand": "Handgelenk links", "RightHand": "Pfote rechts"}
    text, truth = skeleton(Person(named=lambda role: strange.get(role, role)))
    stated = {"Hüfte": "pelvis", "Handgelenk links": "wrist_l", "Pfote rechts": "wrist_r"}
    track, _ = body_track(read_bvh(text), ReadOptions(names=stated))
    np.testing.assert_allclose(track.points, truth, atol=1e-4)


@pytest.mark.parametrize(
    ("stated", "message"),
    [
        ({"Hip": "pelvis"}, "joint of pelvis = 'Hip' must be the name of a joint of the file"),
        ({"Hips": "pelviss"}, "name of 'Hips' = 'pelviss' must be the name of one of our"),
    ],
)
def test_stated_name_that_is_none_is_refused_with_the_nearest(
    stated: dict[str, str], message: str
) -> None:
    with pytest.raises(BadRecording) as caught:
        body_track(read_bvh(skeleton(Person())[0]), ReadOptions(names=stated))
    assert caught.value.faults[0].text.startswith(message)
    assert "there are " in caught.value.faults[0].hint
