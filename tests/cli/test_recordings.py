import json
from pathlib import Path

import pytest

from app.cli.entry import main
from app.cli.recordings import clean_runs
from app.errors import BadRecording
from app.sim.mocap.read_options import ReadOptions
from tests.sim.recorded_person import bvh_text, csv_text, working
from tests.sim.recorded_skeleton import Person, skeleton


@pytest.fixture
def clip(tmp_path: Path) -> Path:
    path = tmp_path / "someone.bvh"
    path.write_text(bvh_text(working(200)), encoding="utf-8")
    return path


def test_import_tells_frames_error_and_runs(
    clip: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["recordings", "import", str(clip)]) == 0
    printed = capsys.readouterr().out
    assert "someone: 200 frames, 3.98 s, bvh in mm" in printed
    assert "artefacts: 0" in printed
    assert "frames 0 to 199: 3.98 s" in printed


def test_import_gives_the_same_as_data(clip: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["recordings", "import", str(clip), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["ok"] and found["frames"] == found["clean_frames"] == 200
    assert found["error_mm"]["wrists"]["p99"] < 1.0
    assert found["clean_runs"] == [{"first": 0, "last": 199, "duration_s": pytest.approx(3.98)}]
    assert found["body_m"]["forearm_r"] == pytest.approx(0.26)


def test_bad_file_is_reported_with_line_and_rule(
    clip: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    clip.write_text(clip.read_text().replace("Frames: 200", "Frames: 300"), encoding="utf-8")
    assert main(["recordings", "import", str(clip), "--json"]) == 2
    captured = capsys.readouterr()
    (fault,) = json.loads(captured.out)["faults"]
    assert "must be the 300" in fault["rule"]
    assert captured.err.startswith(f"{clip}: frames, last line ")


def test_file_that_is_not_there_is_a_wrong_call(
    clip: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["recordings", "import", str(clip.with_name("nobody.bvh"))]) == 2
    assert "cannot be read: No such file" in capsys.readouterr().err


def test_kept_recording_is_listed_shown_and_removed(
    clip: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["recordings", "list"]) == 0
    assert "no recording is stored" in capsys.readouterr().out
    assert main(["recordings", "import", str(clip), "--keep"]) == 0
    printed = capsys.readouterr().out
    assert printed.endswith("\nstored as someone\n")
    assert main(["recordings", "import", str(clip), "--keep", "--json"]) == 0
    assert not json.loads(capsys.readouterr().out)["new"]
    assert main(["recordings", "list"]) == 0
    assert "clean runs: 1, wrists p99 0.0" in capsys.readouterr().out
    assert main(["recordings", "show", "someone"]) == 0
    assert printed.startswith(capsys.readouterr().out.strip())
    assert main(["recordings", "remove", "someone"]) == 0
    assert main(["recordings", "show", "someone"]) == 2
    assert "no recording 'someone'" in capsys.readouterr().err


def test_kept_recording_can_be_given_a_name(
    clip: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["recordings", "import", str(clip), "--keep", "--name", "reach-1"]) == 0
    capsys.readouterr()
    assert main(["recordings", "list", "--json"]) == 0
    (found,) = json.loads(capsys.readouterr().out)["recordings"]
    assert (found["name"], found["file_name"]) == ("reach-1", "someone.bvh")


def test_unit_and_up_axis_can_be_stated(clip: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert (
        main(["recordings", "import", str(clip), "--unit", "0.0011", "--up", "y", "--json"])
        == 0
    )
    found = json.loads(capsys.readouterr().out)
    assert found["unit"] == "0.0011"
    assert found["body_m"]["forearm_r"] == pytest.approx(0.286)


def test_files_of_an_evaluation_are_read_as_stated(tmp_path: Path) -> None:
    path = tmp_path / "child.bvh"
    path.write_text(skeleton(Person(unit=0.0254, stature=0.98))[0], encoding="utf-8")
    with pytest.raises(BadRecording, match="fits two units, inch"):
        clean_runs([path])
    (run,) = clean_runs([path], ReadOptions(unit="inch"))
    assert run.size.forearm_r == pytest.approx(0.149 * 0.98, rel=1e-3)


def test_other_file_under_a_taken_name_is_refused(
    clip: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main(["recordings", "import", str(clip), "--keep"])
    clip.write_text(bvh_text(working(200, seed=1)), encoding="utf-8")
    assert main(["recordings", "import", str(clip), "--keep"]) == 1
    assert "from another file is stored: remove it first" in capsys.readouterr().err


def test_names_of_joints_and_columns_can_be_mapped(
    clip: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = clip.with_suffix(".csv")
    text = csv_text(working(100)).replace("elbow_r", "coude d").replace("elbow_l", "coude g")
    table.write_text(text, encoding="utf-8")
    asked = ["recordings", "import", str(table), "--map", "coude d=elbow_r"]
    assert main(asked) == 2
    assert "lacks the columns elbow_l (other columns: coude g" in capsys.readouterr().err
    assert main([*asked, "--map", "coude g = elbow_l", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["frames"] == 100
    assert main([*asked, "--map", "coude g=elbow", "--json"]) == 2
    (fault,) = json.loads(capsys.readouterr().out)["faults"]
    assert "choices: time, pelvis_x" in fault["hint"]


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["list", "--map", "a=neck"], "No such option: --map"),
        (["import", "{clip}", "--map", "a"], "map = 'a' must be theirs=ours"),
        (["import", "{clip}", "--map", "a=neck", "--map", "b=neck"], "the only name for neck"),
        (["import", "{clip}", "--name", "a"], "add --keep"),
        (["import", "{clip}", "--keep", "--name", "A"], "1 to 64 of the characters"),
        (["list", "--keep"], "No such option: --keep"),
        (["show", "someone", "--unit", "cm"], "No such option: --unit"),
        (["import", "{clip}", "--unit", "furlong"], "choices: m, cm, mm, inch, foot, cmu"),
        (["import", "{clip}", "--up", "up"], "choices: x, y, z, -x, -y, -z"),
        (["show"], "Missing argument 'name'"),
        (["import"], "Missing argument 'file'"),
        (["remove", "someone"], "there is no database at"),
    ],
)
def test_wrong_call_is_reported(
    clip: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], text: str
) -> None:
    given = [one.replace("{clip}", str(clip)) for one in arguments]
    assert main(["recordings", *given]) == 2
    assert text in capsys.readouterr().err
