import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.errors import BadRecording
from app.sim.core.arrays import Vec
from app.sim.human.anthropometry import BodySize
from app.sim.human.model import Q_MAX
from app.sim.mocap.artifacts import MAX_SPEED
from app.sim.mocap.bvh import MAX_FRAMES
from app.sim.mocap.importer import MAX_BYTES, beyond_limits, placed, read_motion
from app.sim.mocap.joint_centres import model_points
from app.sim.mocap.read_options import ReadOptions
from tests.sim.recorded_person import CMU, bvh_text, csv_text, working
from tests.sim.recorded_skeleton import Person, skeleton

ROOT = Path(__file__).resolve().parents[3]
FOLDER = Path(os.environ.get("MOCAP_CLIPS", ROOT.parent / "shared" / "mocap"))
CLIPS = sorted(FOLDER.glob("**/*.bvh"))
"""Recorded clips, which are not part of the checkout; found beside it or where one says."""


def with_leap(frames: slice) -> str:
    """A clip of 4 s in which the right wrist leaps at some frames."""
    lines = bvh_text(working(200)).splitlines()
    start = lines.index("Frame Time: 0.02") + 1
    for k in range(start, len(lines))[frames]:
        words = lines[k].split()
        column = 3 + 3 * 9  # the right elbow's first angle
        words[column : column + 3] = ["170", "0", "0"]
        lines[k] = " ".join(words)
    return "\n".join(lines)


def test_angles_of_a_known_person_are_found_in_a_bvh_file() -> None:
    q, height = working(200), 0.95 - 0.1 * np.sin(np.linspace(0.0, 3.0, 200))
    found = read_motion(bvh_text(q, height, CMU).encode(), "someone.bvh")
    (run,) = found.runs
    points = model_points(run.q, run.pelvis_z, run.size)
    truth = model_points(q, height - np.percentile(height, 95.0), BodySize())
    assert np.abs(points - truth).max() < 1e-3
    assert found.wrists.p99 < 1e-3 and found.elbows.worst < 1e-6
    assert (found.name, found.reading.unit, found.n_frames) == ("someone", "mm", 200)
    assert found.artifacts == ()


def test_angles_of_a_table_come_back_as_they_are() -> None:
    q = working(200)
    found = read_motion(csv_text(q).encode(), "someone.csv")
    np.testing.assert_allclose(found.runs[0].q, q, atol=1e-8)
    assert found.wrists.worst == 0.0


def without_values(first: int, last: int, word: str = "NaN") -> str:
    """A table of 4 s in which the left elbow has no value in some rows."""
    lines = csv_text(working(200)).splitlines()
    for k in range(first + 2, last + 3):
        lines[k] = f"{lines[k].rpartition(',')[0]},{word}"
    return "\n".join(lines)


def test_rows_without_a_value_are_cut_out_and_named() -> None:
    found = read_motion(without_values(100, 101).encode(), "someone.csv")
    (gap,) = found.artifacts
    assert (gap.first, gap.last, gap.parts) == (100, 101, ("elbow_l",))
    assert (found.spans, found.n_frames, found.n_clean) == (((0, 199),), 200, 198)
    (run,) = found.runs
    np.testing.assert_allclose(run.q, np.delete(working(200), [100, 101], axis=0), atol=1e-8)
    assert np.diff(run.times).max() == pytest.approx(0.06)


def test_long_gap_of_values_separates_two_runs_and_is_reported_once() -> None:
    found = read_motion(without_values(90, 110, "").encode(), "someone.csv")
    (gap,) = found.artifacts
    assert (gap.first, gap.last) == (90, 110)
    (_, before), (after, last) = found.spans
    assert before < 90 and after > 110 and last == 199
    assert found.runs[1].first_frame == after
    assert f"frames {after} to 199" in found.runs[1].source


def test_rows_without_a_value_at_both_ends_count_as_frames() -> None:
    text = re.sub(r"\n3\.9\d*", "\nNA", without_values(0, 9))
    found = read_motion(text.encode(), "someone.csv")
    assert [(one.first, one.last) for one in found.artifacts] == [(0, 9), (195, 199)]
    assert (found.spans, found.n_frames) == (((10, 194),), 200)


def test_leap_after_missing_values_is_reported_in_frames_of_the_file() -> None:
    lines = without_values(20, 22).splitlines()
    cells = lines[150 + 2].split(",")
    cells[1] = "9.0"
    lines[150 + 2] = ",".join(cells)
    found = read_motion("\n".join(lines).encode(), "someone.csv")
    gap, leap = found.artifacts
    assert (gap.first, gap.last) == (20, 22)
    assert (leap.first, leap.last) == (149, 151) and "jumps" in leap.reason


def test_table_with_values_for_less_than_a_second_has_no_run() -> None:
    with pytest.raises(BadRecording, match="no run of 1 s .*no value of elbow_l"):
        read_motion(without_values(30, 199).encode(), "someone.csv")


@pytest.mark.parametrize("ending", [".bvh", ".mot", ".csv"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\x0b", "\u2028"])
def test_file_of_far_too_many_lines_is_refused(ending: str, end: str) -> None:
    content = (f"1{end}" * (4 * MAX_FRAMES + 10_001)).encode()
    with pytest.raises(BadRecording, match=f"ends of lines> must be at most {MAX_FRAMES}"):
        read_motion(content, f"long{ending}")


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "latin-1", "cp1252"])
def test_table_is_read_in_the_encodings_of_spreadsheets(encoding: str) -> None:
    text = csv_text(working(100)).replace("elbow_r", "elbow_r [°]")
    found = read_motion(text.encode(encoding), "someone.csv")
    np.testing.assert_allclose(found.runs[0].q, working(100), atol=1e-8)


def test_table_of_a_crouching_person_keeps_its_pelvis_height() -> None:
    low = csv_text(working(200)).replace("\n", ",-0.3\n").replace("degrees,-0.3", "degrees")
    low = low.replace("elbow_l,-0.3", "elbow_l,pelvis_z")
    (run,) = read_motion(low.encode(), "low.csv").runs
    np.testing.assert_allclose(run.pelvis_z, -0.3)


def test_error_without_the_pelvis_height_is_how_far_the_person_ducks() -> None:
    height = np.where(np.arange(200) < 100, 0.95, 0.95 - 0.002 * (np.arange(200) - 100))
    found = read_motion(bvh_text(working(200), height).encode(), "someone.bvh")
    assert found.wrists_at_fixed_height.worst == pytest.approx(0.198, abs=2e-3)


def test_person_of_another_size_keeps_the_angles_and_the_difference_is_reported() -> None:
    text = bvh_text(working(200), unit=0.001 / 1.1)  # read as mm: a tenth larger
    found = read_motion(text.encode(), "someone.bvh")
    assert found.size.forearm_r == pytest.approx(0.286)
    np.testing.assert_allclose(
        found.runs[0].q[:, [13, 17]], working(200)[:, [13, 17]], atol=1e-4
    )
    assert 0.02 < found.fixed_body.p50 < 0.2


def test_leap_is_cut_out_and_the_runs_say_where_they_stand() -> None:
    found = read_motion(with_leap(slice(100, 103)).encode(), "leap.bvh")
    assert len(found.artifacts) == 1
    assert "wrist_r" in found.artifacts[0].parts
    first, second = found.runs
    assert first.first_frame == 0 and 103 < second.first_frame < 110
    assert found.n_clean == len(first.times) + len(second.times) < 200
    assert second.times[0] == 0.0
    assert f"frames {second.first_frame} to 199" in second.source
    assert found.wrists.worst < 1e-3


def test_clip_that_leaps_all_the_time_has_no_clean_run() -> None:
    with pytest.raises(
        BadRecording, match="has no run of 1 s without an artifact .* first: .*_r at"
    ):
        read_motion(with_leap(slice(0, 200, 20)).encode(), "leap.bvh")


def test_clip_of_half_a_second_is_too_short() -> None:
    with pytest.raises(BadRecording, match="has no run of 1 s without an artifact .too short"):
        read_motion(bvh_text(working(25)).encode(), "short.bvh")


@pytest.mark.parametrize(
    ("content", "name", "text"),
    [
        (b"", "a.bvh", "file = <0 bytes> is empty"),
        (b" \n", "a.csv", "is empty"),
        (b"\xff", "a.bvh", "byte 0xff at 0"),
        (b"x", "a.c3d", "must end with .bvh, .mot, .sto, .csv"),
        (b"x", "a", "must end with"),
        (b"\x00" * 50, "a.bvh", "has no line MOTION"),
        (b"x", "a.mot", "has no line endheader"),
        (b" " * (MAX_BYTES + 1), "a.bvh", "must have at most 33554432 bytes"),
    ],
)
def test_what_is_no_motion_is_a_named_fault(content: bytes, name: str, text: str) -> None:
    with pytest.raises(BadRecording) as caught:
        read_motion(content, name)
    assert text in caught.value.faults[0].text


def test_motion_is_moved_to_where_it_shall_begin() -> None:
    (run,) = read_motion(csv_text(working(100)).encode(), "a.csv").runs
    moved = placed(run, 0.5, -0.2, 1.0)
    np.testing.assert_allclose(moved.q[0, :3], [0.5, -0.2, 1.0])
    before, after = (
        model_points(one.q, one.pelvis_z, one.size)[:, [1, 4]] for one in (run, moved)
    )
    gap = [np.linalg.norm(one[:, 1] - one[:, 0], axis=1) for one in (before, after)]
    np.testing.assert_allclose(gap[0], gap[1])
    np.testing.assert_allclose(
        np.linalg.norm(moved.q[-1, :2] - moved.q[0, :2]),
        np.linalg.norm(run.q[-1, :2] - run.q[0, :2]),
    )


def test_arrays_of_a_motion_cannot_be_written_to() -> None:
    (run,) = read_motion(csv_text(working(100)).encode(), "a.csv").runs
    with pytest.raises(ValueError, match="read-only"):
        replace(run).q[0, 0] = 1.0


def test_joints_beyond_their_limits_are_named_with_share_and_distance() -> None:
    q = working(100)
    q[:25, 13] = Q_MAX[13] + 0.2
    assert beyond_limits(q) == {"elbow_r": (pytest.approx(0.25), pytest.approx(0.2))}


if CLIPS:  # without clips there is no test to skip

    @pytest.mark.parametrize("path", CLIPS, ids=lambda path: f"{path.parent.name}/{path.name}")
    def test_wrists_of_a_recorded_clip_are_met_within_a_centimetre(path: Path) -> None:
        found = read_motion(path.read_bytes(), path.name)
        assert (found.reading.unit, found.reading.up) == ("mm", "y")
        assert found.wrists.p99 < 0.01
        assert found.elbows.worst < 1e-6
        assert all(one.speed > MAX_SPEED for one in found.artifacts)
        assert all(np.isfinite(run.q).all() for run in found.runs)


@pytest.mark.parametrize("stated", [{"unit": "cm"}, {"root_unit": "m"}, {"up": "z"}])
def test_unit_of_a_file_of_angles_cannot_be_stated(stated: dict[str, str]) -> None:
    (field,) = stated
    with pytest.raises(BadRecording, match=rf"{field} = .* applies to \.bvh only"):
        read_motion(csv_text(working(100)).encode(), "a.csv", ReadOptions(**stated))


@pytest.mark.parametrize(("up", "rest_up"), [("y", "y"), ("z", "z"), ("y", "z"), ("z", "y")])
@pytest.mark.parametrize("bend", [0.0, 40.0, 65.0])
def test_angles_are_the_same_in_any_frame(up: str, rest_up: str, bend: float) -> None:
    def angles(who: Person) -> Vec:
        (run,) = read_motion(skeleton(who)[0].encode(), "someone.bvh").runs
        return run.q

    plain = Person(bend=bend)
    q = angles(replace(plain, up=up, rest_up=rest_up, unit=0.0254))
    np.testing.assert_allclose(q, angles(plain), atol=2e-3)
    np.testing.assert_allclose(angles(replace(plain, twisted=True)), q, atol=2e-3)
    # The hips are below the joint that bends, so the line from there leans less.
    assert np.degrees(np.median(q[:, 3])) == pytest.approx(0.85 * bend, abs=5.0)


@pytest.mark.parametrize("seed", range(60))
def test_garbled_skeleton_is_read_or_refused_but_never_crashes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    words = skeleton(Person(legs=seed % 3 > 0))[0].split(" ")
    for place in rng.integers(0, len(words), rng.integers(1, 12)):
        if words[place].strip().replace(".", "").replace("-", "").isdigit():
            words[place] = str(rng.choice(["0", "1e9", "-1e-9", "1e3", "3", "-0"]))
    try:
        found = read_motion(" ".join(words).encode(), "garbled.bvh")
    except BadRecording as error:
        assert error.faults[0].place and error.faults[0].rule
    else:
        assert all(np.isfinite(run.q).all() for run in found.runs)
