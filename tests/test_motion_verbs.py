import json
from pathlib import Path

import pytest

from app.__main__ import main
from tests.sim.recorded_person import bvh_text, working


@pytest.fixture
def clip(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("TANDEM_DATA", str(tmp_path))
    path = tmp_path / "someone.bvh"
    path.write_text(bvh_text(working(200)), encoding="utf-8")
    return path


def test_import_tells_frames_error_and_runs(
    clip: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["motions", "import", str(clip)]) == 0
    told = capsys.readouterr().out
    assert "someone: 200 frames, 3.98 s, bvh in mm" in told
    assert "0 glitches" in told
    assert "frames 0 to 199: 3.98 s" in told


def test_import_gives_the_same_as_data(clip: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["motions", "import", str(clip), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["ok"] and found["frames"] == found["clean_frames"] == 200
    assert found["error_mm"]["wrists"]["p99"] < 1.0
    assert found["clean_runs"] == [{"first": 0, "last": 199, "duration_s": pytest.approx(3.98)}]
    assert found["body_m"]["forearm_r"] == pytest.approx(0.26)


def test_bad_file_is_told_with_line_and_rule(
    clip: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    clip.write_text(clip.read_text().replace("Frames: 200", "Frames: 300"), encoding="utf-8")
    assert main(["motions", "import", str(clip), "--json"]) == 2
    captured = capsys.readouterr()
    (fault,) = json.loads(captured.out)["faults"]
    assert "must be the 300" in fault["rule"]
    assert captured.err.startswith(f"{clip}: frames, last line ")


def test_file_that_is_not_there_is_a_wrong_call(
    clip: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["motions", "import", str(clip.with_name("nobody.bvh"))]) == 2
    assert "cannot be read: No such file" in capsys.readouterr().err
