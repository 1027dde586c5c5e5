"""Recalibrated probabilities against cases with a known answer."""

from functools import cache

import numpy as np
import pytest
import torch
from scipy.special import softmax

from app.errors import InvalidInput
from app.policies.checkpoints import pretrained
from app.policies.checkpoints.checkpoint import pack
from app.policies.inference.recalibration import (
    BETWEEN,
    fit_map,
    narrowed,
    recalibrated,
    with_timeout,
)
from app.policies.inference.value_networks import ValueNetworks
from app.sim.cells.cell import load_cell
from app.sim.pick.batch import WHOLE_PICK, PickBatch


@cache
def drawn(n: int = 20_000):
    """Return true probabilities, shape (n, 3), and outcomes drawn from them."""
    rng = np.random.default_rng(3)
    true = softmax(rng.normal((2.0, -1.0, 0.0), 1.0, (n, 3)), axis=1)
    outcome = (rng.random((n, 1)) > np.cumsum(true, axis=1)[:, :2]).sum(axis=1)
    return true, outcome


def distorted(true):
    return softmax(0.5 * np.log(true) + (0.4, 0.0, -0.7), axis=1)


def test_map_undoes_a_slope_and_offsets():
    true, outcome = drawn()
    wrong = distorted(true)
    corrected = fit_map(wrong, outcome)(wrong)
    assert np.abs(wrong - true).mean() > 0.05
    assert np.abs(corrected - true).mean() < 0.01


def test_calibrated_predictions_stay():
    true, outcome = drawn()
    assert np.abs(fit_map(true, outcome)(true) - true).max() < 0.03


def test_twenty_successes_do_not_make_a_success_certain():
    predicted = np.tile((0.7, 0.1, 0.2), (20, 1))
    found = fit_map(predicted, np.zeros(20, dtype=int))(predicted)[0]
    assert 0.85 < found[0] < 0.99


def test_probabilities_of_nothing_and_everything_are_corrected():
    predicted = with_timeout(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    assert predicted.tolist() == [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    found = fit_map(np.tile(predicted, (30, 1)), np.tile([0, 1, 2], 30))
    assert np.isfinite(found(predicted)).all()
    assert (found(predicted).argmax(axis=1) == [0, 1, 2]).all()


def test_recalibrated_policy_predicts_the_map_and_acts_as_before():
    shipped = pretrained.load("pick")
    before = ValueNetworks(shipped)
    obs = np.random.default_rng(1).normal(0.0, 0.3, (400, before.n_obs)).astype(np.float32)
    act, values, predicted = before.evaluate(obs)
    assert predicted is not None
    old = predicted.probability.astype(float)
    act, values = act.copy(), values.copy()
    outcome = np.random.default_rng(2).choice(3, 400, p=(0.3, 0.3, 0.4))
    made = recalibrated(shipped, old, outcome)
    after = ValueNetworks(made)
    new_act, new_values, new = after.evaluate(obs)
    assert new is not None
    assert torch.equal(torch.as_tensor(act), torch.as_tensor(new_act))
    assert np.array_equal(values, new_values)
    wanted = fit_map(old, outcome)(old)
    assert np.abs(new.probability - wanted).mean() < 0.02
    assert np.abs(new.probability.mean(axis=0) - (0.3, 0.3, 0.4)).max() < 0.06
    record = made.manifest["recalibration"]
    assert record["from"] == shipped.sha256
    assert sum(record["outcomes"].values()) == 400
    assert made.sha256 != shipped.sha256


def test_outcomes_of_a_cell_narrow_the_offsets_between_cells():
    """A hundred outcomes at even odds have the information 25; 0.98 is half of 1.96."""
    half = np.tile((0.5, 0.5, 0.0), (100, 1))
    found = narrowed(np.tile(np.float32((-0.98, 0.98)), (3, 1)), half)
    left = 0.98 / np.sqrt(1.0 + 25.0 / 4.0)
    np.testing.assert_allclose(found, [(-left, left), (-left, left), (-0.98, 0.98)], rtol=1e-6)


def test_recalibrated_intervals_are_narrower_and_older_checkpoints_have_those_of_the_fit():
    shipped = pretrained.load("pick")
    obs = PickBatch(load_cell(), 200, 5, WHOLE_PICK).reset()

    def width(checkpoint):
        _, _, found = ValueNetworks(checkpoint).evaluate(obs)
        assert found is not None
        return float((found.high - found.low)[:, 0].mean())

    _, _, predicted = ValueNetworks(shipped).evaluate(obs)
    assert predicted is not None
    rng = np.random.default_rng(2)
    outcome = np.array([rng.choice(3, p=one / one.sum()) for one in predicted.probability])
    after = recalibrated(shipped, predicted.probability.astype(float), outcome)
    older = pack(
        shipped.manifest,
        {name: one for name, one in shipped.arrays().items() if name != BETWEEN},
    )
    assert width(older) < 0.7 * width(shipped) and width(after) < 0.7 * width(shipped)
    again = recalibrated(older, predicted.probability.astype(float), outcome)
    assert BETWEEN not in again.arrays()


def test_too_few_outcomes_and_policies_without_probabilities_are_refused():
    shipped = pretrained.load("pick")
    with pytest.raises(InvalidInput, match="must be at least 20"):
        recalibrated(shipped, np.full((19, 3), 1 / 3), np.zeros(19, dtype=int))
    plain = pack(
        shipped.manifest,
        {name: a for name, a in shipped.arrays().items() if not name.startswith("outcome.")},
    )
    for one in (plain, pretrained.load("reach")):
        with pytest.raises(InvalidInput, match="must predict outcomes"):
            recalibrated(one, np.full((30, 3), 1 / 3), np.zeros(30, dtype=int))
