"""How ``tools/docs/augmentation_study.py`` puts seeds together, and what it refuses."""

import json
from pathlib import Path

import pytest

from app.errors import InvalidInput
from tools.docs.augmentation_study import over_seeds, table_of, trained


def test_interval_is_students_over_the_seeds() -> None:
    found = over_seeds([0.90, 0.92, 0.94])
    half = 4.302653 * 0.02 / 3**0.5
    assert found == pytest.approx({"mean": 0.92, "low": 0.92 - half, "high": 0.92 + half})


def test_interval_of_a_rate_stays_within_what_can_be() -> None:
    assert over_seeds([0.98, 1.0])["high"] == 1.0


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
