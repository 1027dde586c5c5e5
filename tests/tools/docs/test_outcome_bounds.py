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
    monkeypatch.setattr(pick, "CELLS", 2)
    checkpoint = Recorder().run(preset_of("pick-td3", TINY)).checkpoint
    result = measured(checkpoint, EvaluationRequest(episodes=30, seed=5))
    assert result["checkpoint"] == checkpoint.sha256
    rows = {row["name"]: row for row in result["results"]}
    kinds = ("library", "faster", "two-people", "off-task", "stops")
    assert list(rows) == [f"{kind}, {one}" for kind in kinds for one in ("success", "contact")]
    for row in rows.values():
        rate = row["rate_percent"] / 100.0
        assert row["brier_of_the_rate"] == pytest.approx(rate * (1.0 - rate))
        if 0.0 < rate < 1.0:
            assert row["brier_fitted_beside_them"] != row["brier_shipped"]
