"""How ``tools/docs/augmentation_study.py`` puts seeds together, and what it refuses."""

import json
from pathlib import Path

import pytest

from app.errors import InvalidInput
from tools.docs.augmentation_study import table_of, trained


def test_difference_is_taken_seed_by_seed() -> None:
    rates = {
        "sampled": {21: {"one": 0.9}, 22: {"one": 0.8}, 23: {"one": 0.7}},
        "replayed": {21: {"one": 0.8}, 22: {"one": 0.9}},
    }
    sampled, replayed, difference = table_of(rates)
    assert (sampled["seeds"], replayed["seeds"], difference["seeds"]) == (3, 2, 2)
    assert difference["one_by_seed"] == pytest.approx([0.1, -0.1])
    assert difference["one"]["mean"] == pytest.approx(0.0)
    assert difference["one"]["low"] < 0.0 < difference["one"]["high"]


@pytest.mark.parametrize(
    ("step", "kind", "rule"),
    [(512, "sampled", "must reach 1024"), (1024, "replayed", "must be trained with sampled")],
)
def test_training_that_does_not_count_is_refused(
    tmp_path: Path, step: int, kind: str, rule: str
) -> None:
    folder = tmp_path / "sampled-21"
    folder.mkdir()
    preset = {"people": {"augmentation": kind}, "learning": {"total_steps": 1024}}
    manifest = {"seed": 21, "step": step, "preset": preset}
    (folder / "policy.json").write_text(json.dumps(manifest), encoding="utf-8")
    with pytest.raises(InvalidInput, match=rule):
        trained(tmp_path, "sampled")
