import re
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from app.errors import BadRecording
from app.sim.mocap.bvh import MAX_FRAMES, MAX_JOINTS, check_dt, forward, read_bvh
from tests.sim.recorded_person import bvh_text, fault_of, working

ARM = """HIERARCHY
ROOT body
{
  OFFSET 5 5 5
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT upper arm
  {
    OFFSET 1 0 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 2 0 0
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.01
0 0 0 0 0 0 0 0 0
1 2 3 90 0 0 0 0 90
""".replace("upper arm", "upper_arm")
PERSON = bvh_text(working(5))
FIRST = PERSON.splitlines().index("Frame Time: 0.02") + 2
fault = partial(fault_of, read_bvh)


def test_points_of_a_small_skeleton_are_those_worked_out_by_hand() -> None:
    bvh = read_bvh(ARM)
    points = forward(bvh, range(3))
    assert [joint.name for joint in bvh.joints] == ["body", "upper_arm", "upper_arm.end"]
    np.testing.assert_allclose(points[0], [[0, 0, 0], [1, 0, 0], [3, 0, 0]], atol=1e-12)
    # 90 degrees about z, then about the turned y: the end site looks along -z.
    np.testing.assert_allclose(points[1], [[1, 2, 3], [1, 3, 3], [1, 3, 1]], atol=1e-12)


def test_channels_turn_in_the_order_of_the_file() -> None:
    row = "\n0 0 0 90 0 90 0 0 0\n"
    first = read_bvh(re.sub(r"\n0 0 0 0.*\n", row, ARM, count=1))
    text = ARM.replace("Zrotation Xrotation Yrotation", "Yrotation Xrotation Zrotation")
    other = read_bvh(re.sub(r"\n0 0 0 0.*\n", row, text, count=1))
    np.testing.assert_allclose(forward(first, [1])[0, 0], [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(forward(other, [1])[0, 0], [0, 1, 0], atol=1e-12)


def test_braces_and_line_ends_may_stand_as_they_like() -> None:
    crammed = ARM.replace("body\n{", "body {").replace("\n", "\r\n").replace("  ", "\t")
    expected, found = (forward(read_bvh(text), range(3)) for text in (ARM, crammed))
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("write", [str.lower, str.upper, str.title])
def test_keywords_may_have_any_case_and_joints_their_names(write: Callable[[str], str]) -> None:
    named = ARM.replace("body", "Root").replace("upper_arm", "joint_End")
    words = "HIERARCHY ROOT JOINT End Site OFFSET CHANNELS MOTION Frames: Xposition Zrotation"
    text = named.replace("Frame Time: 0.01", f"{write('frame')}\t{write('time')} : 0.01")
    for word in words.split():
        text = re.sub(rf"(?m)(^|\s){word}(?=\s)", lambda found: write(found[0]), text)
    bvh = read_bvh(text.replace(write("ROOT") + " " + write("ROOT"), "ROOT Root"))
    assert bvh.dt == 0.01 and bvh.joints == read_bvh(named).joints


@pytest.mark.parametrize(
    ("old", "new", "place", "text"),
    [
        ("HIERARCHY", "HELLO", "line 1", "must be HIERARCHY"),
        ("ROOT body", "JOINT body", "line 2", "must be ROOT"),
        ("OFFSET 1 0 0", "OFFSET 1 0", "line 9", "must be a number"),
        ("OFFSET 1 0 0", "OFFSET 1 nan 0", "line 8", "must be a finite number"),
        ("CHANNELS 6", "CHANNELS 7", "line 5", "must be 0 to 6 channels"),
        ("CHANNELS 6 X", "CHANNELS 6 Q", "line 5", "must be one of Xposition"),
        ("JOINT upper_arm", "JOINT body", "line 6", "is the name of two joints"),
        ("JOINT upper_arm", "BONE upper_arm", "line 6", "must be one of JOINT, End"),
        ("MOTION", "MOVIES", "line 20", "has no line MOTION"),
        ("  }\n}\nMOTION", "  }\nMOTION", "line 14", "ends where } or JOINT must follow"),
        ("}\nMOTION", "}\nROOT two\nMOTION", "line 16", "must hold one skeleton"),
        ("Frames: 2", "Frames: many", "line 17", "must be a number"),
        ("Frames: 2", "Frames: -2", "line 17", "must be a whole number"),
        ("Frames: 2", "Frames: 2.5", "line 17", "must be a whole number"),
        ("Frames: 2", "Frames: 3", "frames, last line 20", "the file is cut off"),
        ("Frames: 2", "Frames: 1", "frames, last line 20", "must be the 1 that"),
        ("Frames: 2", f"Frames: {MAX_FRAMES + 1}", "frames", "must be at most 200000"),
        ("Frame Time: 0.01", "Frame Time: 10", "line 18", "looks like milliseconds"),
        ("Frame Time: 0.01", "Frame Time: 120", "line 18", "must lie in [0.001, 0.1] s"),
        ("Frame Time: 0.01", "Frame Time: 0", "line 18", "must lie in [0.001, 0.1] s"),
        ("Frame Time: 0.01", "Frame Time: nan", "line 18", "must be a finite number"),
        ("Frame Time: 0.01\n", "", "line 18", 'must be "Frame Time:" with a number'),
        ("90 0 0 0 0 90", "90 0 0 0 0", "line 20", "must hold 9 numbers"),
        ("90 0 0 0 0 90", "90 0 0 x 0 90", "line 20, number 7", "must be a number"),
        ("90 0 0 0 0 90", "90 0 0 1_0 0 90", "line 20, number 7", "must be a number"),
        ("OFFSET 1 0 0", "OFFSET 1 0 0_0", "line 8", "must be a number"),
        ("90 0 0 0 0 90", "90 0 0 inf 0 90", "line 20, number 7", "must be a finite number"),
        ("90 0 0 0 0 90", "90 0 0 1e300 0 90", "line 20, number 7", "at most 1000000000"),
        ("0 0 0 0 0 0 0 0 0\n1 2 3 90 0 0 0 0 90\n", "", "frames", "the file is cut off"),
        ("OFFSET 5 5 5", "OFFSET 5,00 5,00 5,00", "line 4", "decimal commas: write points"),
        ("90 0 0 0 0 90", "90,5 0 0 0 0 90", "line 20, number 4", "decimal commas"),
        ("Frame Time: 0.01", "Frame Time: 0,01", "line 18", "decimal commas"),
        ("90 0 0 0 0 90", "90,0,0,0,0,90", "line 20", "commas between numbers: write spaces"),
    ],
)
def test_fault_is_named_with_its_line(old: str, new: str, place: str, text: str) -> None:
    assert old in ARM
    message = fault(ARM.replace(old, new, 1))
    assert message.startswith(place)
    assert text in message


@pytest.mark.parametrize("name", ["Bip01 L UpperArm", "arm (left)", "a  b"])
def test_name_of_a_joint_may_have_several_words(name: str) -> None:
    lines = ARM.splitlines()
    at = next(k for k, line in enumerate(lines) if "JOINT" in line)
    for brace in ("", " {"):
        text = lines.copy()
        text[at] = f"JOINT {name}{brace}"
        if brace:
            del text[at + 1]
        read = read_bvh("\n".join(text))
        assert [one.name for one in read.joints][1] == " ".join(name.split())


def test_missing_brace_is_reported_rather_than_read_as_a_name() -> None:
    lines = ARM.splitlines()
    at = next(k for k, line in enumerate(lines) if "JOINT" in line)
    del lines[at + 1]
    assert "'OFFSET' must be {" in fault("\n".join(lines))


def test_all_faulty_lines_are_reported_at_once() -> None:
    lines = PERSON.splitlines()
    lines[FIRST - 1] += " 7"
    lines[FIRST + 1] = "1 2"
    with pytest.raises(BadRecording) as caught:
        read_bvh("\n".join(lines))
    assert [one.place for one in caught.value.faults] == [f"line {FIRST}", f"line {FIRST + 2}"]


@pytest.mark.parametrize("share", np.linspace(0.0, 0.995, 40))
def test_file_cut_off_anywhere_is_a_named_fault(share: float) -> None:
    cut = PERSON[: int(share * len(PERSON))]
    assert fault(cut)


@pytest.mark.parametrize("seed", range(60))
def test_garbled_file_is_read_or_refused_but_never_crashes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    letters = bytearray(PERSON.encode())
    for place in rng.integers(0, len(letters), rng.integers(1, 30)):
        letters[place] = rng.choice(list(b"{}0-e.nX \n:9"))
    try:
        points = forward(read_bvh(letters.decode()), range(5))
    except BadRecording as error:
        assert error.faults[0].place and error.faults[0].rule
    else:
        assert np.isfinite(points).all()


def test_skeleton_without_end_is_refused() -> None:
    joint = "JOINT j{k} {{ OFFSET 0 0 0 CHANNELS 0 "
    head = "HIERARCHY ROOT r { OFFSET 0 0 0 CHANNELS 0 "
    deep = head + "".join(joint.format(k=k) for k in range(500)) + "\nMOTION"
    wide = head + "".join(joint.format(k=k) + "}" for k in range(MAX_JOINTS)) + "}\nMOTION"
    assert "nested at most 60 deep" in fault(deep)
    assert "at most 300 joints" in fault(wide)


def test_rate_is_what_motion_capture_delivers() -> None:
    assert check_dt(0.01, "dt") == 0.01
    for rounded in (0.1 + 1e-15, 6 * 0.0166667, 1.001 - 1.0):
        assert check_dt(rounded, "dt") == rounded
    with pytest.raises(BadRecording, match="or frames per second: in s that is 0.0166667"):
        check_dt(60.0, "dt")
