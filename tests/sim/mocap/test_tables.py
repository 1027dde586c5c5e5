from functools import partial

import numpy as np
import pytest

from app.sim.human.model import JOINT_NAMES
from app.sim.mocap.csv_tables import read_csv
from app.sim.mocap.opensim import COORDINATES, read_opensim
from app.sim.mocap.tables import near_names, plain
from tests.sim.recorded_person import csv_text, fault_of, opensim_text, working

Q = working(30)
TEXT = csv_text(Q)
THEIRS = {
    "shoulder_r_flex": "RArmFlex",
    "elbow_l": "Coude gauche (°)",
    "time": "Zeit = t",
    "pelvis_x": "körper/x",
}


def renamed(text: str = TEXT) -> str:
    for own, theirs in THEIRS.items():
        text = text.replace(own, theirs)
    return text


def names() -> dict[str, str]:
    return {theirs: own for own, theirs in THEIRS.items()}


fault = partial(fault_of, read_csv)


def test_name_map_says_which_column_is_which() -> None:
    track = read_csv(renamed(), names())
    np.testing.assert_allclose(track.q, Q, atol=1e-8)
    np.testing.assert_allclose(track.times, 0.02 * np.arange(30))
    assert track.names == THEIRS
    assert read_csv(TEXT).names == {}


def test_name_map_goes_before_what_a_name_says() -> None:
    swapped = TEXT.replace("elbow_r", "X").replace("elbow_l", "elbow_r").replace("X", "elbow_l")
    track = read_csv(swapped, {"elbow_r": "elbow_l", "elbow_l": "elbow_r"})
    np.testing.assert_allclose(track.q, Q, atol=1e-8)


def test_name_map_gives_a_column_once() -> None:
    head = TEXT.replace("elbow_l", "other")
    stated = {"elbow_r": "elbow_r", "Elbow R": "elbow_l"}
    assert "must map each column once" in fault(head, stated)


def test_name_map_finds_names_in_other_case_and_by_their_paths() -> None:
    angles = {name: np.linspace(0.1, 0.4, 20) for name in COORDINATES}
    text = opensim_text(angles)
    expected = read_opensim(text)
    moved = text.replace("arm_flex_r", "/jointset/sh_r/Schulter_r/value")
    for theirs in ("/jointset/sh_r/Schulter_r/value", "Schulter_r", "schulter r"):
        found = read_opensim(moved, {theirs: "arm_flex_r"})
        np.testing.assert_array_equal(found.q, expected.q)


def test_name_map_can_name_a_column_that_no_model_calls_so() -> None:
    angles = {name: np.linspace(0.1, 0.4, 20) for name in COORDINATES}
    text = opensim_text(angles)
    moved = text.replace("lumbar_bending", "L5_S1_Lat_Bending")  # half of two families
    found = read_opensim(moved, {"L5_S1_Lat_Bending": "lumbar_bending"})
    np.testing.assert_array_equal(found.q, read_opensim(text).q)


@pytest.mark.parametrize(
    ("stated", "text"),
    [
        ({"RArmFlx": "shoulder_r_flex"}, "'RArmFlx' is the name of no column, or of several"),
        ({"RArmFlx": "shoulder_r_flex"}, "(nearly the same: RArmFlex"),
        ({"zzz": "elbow_l"}, "(the file's columns: Zeit = t, körper/x, pelvis_y"),
        ({"RArmFlex": "shoulder_flex"}, "'RArmFlex=shoulder_flex' must end with one of ours"),
        ({"RArmFlex": "shoulder_flex"}, "choices: time, pelvis_x, pelvis_y"),
        ({"": "elbow_l"}, "'' is the name of no column"),
        ({"RArmFlex": "shoulder_r_flex"}, "lacks the columns pelvis_x, elbow_l"),
    ],
)
def test_name_map_that_does_not_fit_is_reported(stated: dict[str, str], text: str) -> None:
    assert text in fault(renamed(), stated)


def test_columns_that_are_not_nearly_known_are_listed() -> None:
    message = fault(TEXT.replace("elbow_r", "xyzzy"), {})
    assert message.endswith(
        "(other columns: xyzzy; a name map says what they are: theirs=ours)"
    )


def test_nearly_known_names_keep_their_side_and_are_used_once() -> None:
    there = ["left_elbow", "right_elbow", "elbowing", "RightShoulderFlex", "head"]
    pairs = near_names(["elbow_r", "elbow_l", "shoulder_r_flex", "pelvis_yaw"], there)
    assert dict(pairs) == {
        "left_elbow": "elbow_l",
        "right_elbow": "elbow_r",
        "RightShoulderFlex": "shoulder_r_flex",
    }


def test_names_of_any_length_are_compared_in_no_time() -> None:
    long = "(" * 2_000_000
    assert len(plain(long)) <= 200
    assert near_names(JOINT_NAMES, [long]) == []
    assert "is the name of no column" in fault(TEXT.replace("elbow_r", long), {"a": "elbow_r"})
