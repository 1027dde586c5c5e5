"""Outcomes fitted beside one kind of people, with a tiny training."""

import pytest

from app.policies.evaluation.rows import EvaluationRequest
from app.policies.training import pick
from tests.policies.conftest import TINY, Recorder, preset_of
from tools.docs.outcome_bounds import measured


def test_every_kind_has_a_fit_of_its_own_on_the_same_predictions(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(pick, "MIN_EPISODES", 10)
    checkpoint = Recorder().run(preset_of("pick-td3", TINY)).checkpoint
    result = measured(checkpoint, EvaluationRequest(episodes=30, seed=5))
    assert result["checkpoint"] == checkpoint.sha256
    rows = result["results"]
    kinds = ["library", "faster", "two-people", "off-task", "stops"]
    assert [row["name"] for row in rows] == kinds
    for row in rows:
        usual = row["shipped"]
        assert row["predictions"] == usual["predictions"] >= 30
        for what in ("success", "contact"):
            assert row[what]["rate"] == usual[what]["rate"]
            assert row[what]["brier"] != usual[what]["brier"]
