"""What ``tools/docs/recording_plots.py`` measures, on a clip with a known fault."""

from pathlib import Path

import numpy as np
import pytest

from tests.sim.mocap.test_importer import with_leap
from tools.docs.recording_plots import ClipErrors, clip_errors, name_of, row, shown_of


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("someone") / "0.bvh"
    path.write_text(with_leap(slice(100, 102)), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def found(clip: Path) -> ClipErrors:
    return clip_errors(clip)


def test_row_names_the_fault_and_its_speed(clip: Path) -> None:
    shown = row(clip)
    assert shown["name"] == name_of(clip)
    assert shown["artifacts"].startswith("1 (`wrist_r` ")
    assert shown["frames"] == 200 and 150 < shown["clean"] < 198


def test_errors_are_those_of_the_clean_frames_alone(found: ClipErrors) -> None:
    (artifact,) = found.artifacts
    wrist = found.errors["right wrist"]
    assert np.isnan(wrist[artifact.first : artifact.last + 1]).all()
    assert 0.0 <= np.nanmax(wrist) < 1.0
    assert np.isfinite(wrist[[0, -1]]).all()


def test_frames_beside_an_artifact_are_reported_as_dropped(found: ClipErrors) -> None:
    (artifact,) = found.artifacts
    before, after = found.dropped
    assert before[1] < found.times[artifact.first] < found.times[artifact.last] < after[0]


def test_drawn_clip_has_an_artifact(found: ClipErrors, tmp_path: Path) -> None:
    clean = tmp_path / "clean.bvh"
    clean.write_text(with_leap(slice(0, 0)), encoding="utf-8")
    other = clip_errors(clean)
    assert other.artifacts == ()
    assert shown_of([other, found]) is found
