"""Measures of calibration against cases with a known answer."""

import numpy as np
import pytest

from app.errors import InvalidInput
from app.policies.checkpoints import checkpoint as formats
from app.policies.checkpoints import pretrained
from app.policies.evaluation.pick.calibration import calibration, corrected, times_of
from app.policies.evaluation.registry import evaluate
from app.policies.inference.recalibration import BETWEEN, fit_map, narrowed, recalibrated
from app.policies.inference.value_networks import ValueNetworks
from app.sim.cells.cell import load_cell
from app.sim.pick.batch import WHOLE_PICK, PickBatch


def drawn(n: int = 20_000):
    rng = np.random.default_rng(3)
    probability = rng.uniform(0.05, 0.95, n)
    return probability, rng.random(n) < probability


def measured(probability, happened, spread: float = 0.0):
    """Return the measures of predictions of an episode each."""
    interval = np.column_stack([probability - spread, probability + spread])
    return calibration(probability, interval, happened, np.arange(len(probability)), 1)


def test_calibrated_probabilities_have_an_error_at_the_level_of_chance():
    probability, happened = drawn()
    found = measured(probability, happened, 0.02)
    assert found["ece"] < 2.0 * found["ece_floor"] < 0.02
    assert found["brier"] < found["brier_constant"] - 0.05
    assert found["auc"] == pytest.approx(0.8, abs=0.03)


def test_predictions_with_one_outcome_err_more_by_chance():
    probability, happened = drawn(1000)
    apart = measured(probability, happened)["ece_floor"]
    pairs = np.repeat(probability, 2), np.zeros((2000, 2)), np.repeat(happened, 2)
    both = calibration(*pairs, np.repeat(np.arange(1000), 2), 1)["ece_floor"]
    assert both == pytest.approx(apart, rel=0.05)  # twice the predictions tell no more
    alone = calibration(*pairs, np.arange(2000), 1)["ece_floor"]
    assert alone == pytest.approx(both / np.sqrt(2.0), rel=0.1)


def test_shifted_probabilities_have_that_error():
    probability, happened = drawn()
    found = measured(np.clip(probability + 0.1, 0, 1), happened)
    assert found["ece"] == pytest.approx(0.1, abs=0.02)


def test_ranks_of_a_perfect_and_of_a_useless_prediction():
    happened = np.arange(100) >= 40
    perfect = measured(happened.astype(float), happened)
    assert (perfect["auc"], perfect["brier"], perfect["ece"]) == (1.0, 0.0, 0.0)
    useless = measured(np.full(100, 0.6), happened)
    assert useless["auc"] == 0.5
    assert useless["brier"] == pytest.approx(useless["brier_constant"])


@pytest.mark.parametrize("n", [1, 7])
def test_fewer_predictions_than_bins_have_a_bin_each(n: int) -> None:
    probability = np.linspace(0.1, 0.9, n)
    happened = np.arange(n) % 2 == 0
    found = measured(probability, happened)
    assert [one["n"] for one in found["bins"]] == [1] * n
    assert found["ece"] == pytest.approx(np.abs(probability - happened).mean())
    assert np.isfinite(found["ece_floor"])


def test_a_checkpoint_without_probabilities_is_refused():
    shipped = pretrained.load("pick")
    arrays = shipped.arrays()
    plain = {name: one for name, one in arrays.items() if not name.startswith("outcome.")}
    assert len(plain) < len(arrays)
    with pytest.raises(InvalidInput, match="must predict outcomes"):
        evaluate("risk-calibration", formats.pack(shipped.manifest, plain), episodes=5)


def test_predictions_after_a_recalibration_are_those_of_the_recalibrated_policy():
    shipped, obs = pretrained.load("pick"), PickBatch(load_cell(), 300, 5, WHOLE_PICK).reset()

    def predictions(checkpoint):
        _, _, found = ValueNetworks(checkpoint).evaluate(obs)
        columns = found.probability[:, :2], found.low[:, :2], found.high[:, :2]
        return found.probability.astype(float), np.hstack(columns).astype(float)

    probability, before = predictions(shipped)
    outcome = np.random.default_rng(2).choice(3, 300, p=(0.7, 0.2, 0.1))
    _, wanted = predictions(recalibrated(shipped, probability, outcome))
    mapped, between = fit_map(probability, outcome), shipped.arrays()[BETWEEN]
    left = narrowed(between, mapped(probability))
    found = corrected(before, mapped, between, left)
    assert np.abs(found - wanted).max() < 0.02 < np.abs(before - wanted).max() / 10
    assert (np.diff(wanted[:, [2, 4]]) < np.diff(before[:, [2, 4]])).mean() > 0.9


def test_every_kind_of_people_has_a_row_with_both_outcomes():
    result = evaluate("risk-calibration", pretrained.load("pick"), episodes=60, seed=5)
    rows = {row["name"]: row for row in result["results"]}
    one_kind = ["library", "faster", "two-people", "off-task", "stops"]
    assert list(rows) == [*one_kind, "mixture", "short-time"]
    assert rows["mixture"]["success"]["rate"] != rows["two-people"]["success"]["rate"]
    short = rows["short-time"]["success"]
    assert short["brier"] < 0.7 * short["brier_constant"]
    library = rows["library"]
    assert abs(library["expected_time_s"] - library["time_to_success_s"]) < 1.0
    for row in rows.values():
        assert 60 <= row["predictions"] <= 120
        for what in ("success", "contact"):
            assert sum(one["n"] for one in row[what]["bins"]) == row["predictions"]
            assert 0.0 <= row[what]["mean"] <= 1.0
            for after in row[what]["recalibrated"].values():
                assert after["brier"] < 0.25
                pairs = list(zip(row[what]["bins"], after["bins"], strict=True))
                assert all(b["n"] == a["n"] and b["low"] < a["high"] for b, a in pairs)
                assert (
                    np.mean([a["high"] - a["low"] < b["high"] - b["low"] for b, a in pairs])
                    > 0.7
                )
        assert abs(row["expected_time_s"] - row["time_to_success_s"]) < 1.5, row["name"]
        assert row["time_ece_s"] <= row["time_error_s"] < row["time_error_constant_s"] + 0.5


def test_expected_times_are_compared_in_bins_and_one_by_one():
    predicted, passed = np.arange(20.0), np.arange(20.0)
    passed[::2] += 3.0  # one of the two of each bin
    assert times_of(predicted, passed) == {
        "time_to_success_s": 11.0,
        "expected_time_s": 9.5,
        "time_ece_s": 1.5,
        "time_error_s": 1.5,
        "time_error_constant_s": pytest.approx(np.abs(passed - 11.0).mean()),
    }
    passed[1::2] -= 3.0
    assert times_of(predicted, passed)["time_ece_s"] == 0.0
    assert times_of(predicted, passed)["time_error_s"] == 3.0
    assert times_of(np.zeros(0), np.zeros(0)) == {}
