"""Actions, values and outcomes of the shipped policy, compared with torch."""

import numpy as np
import pytest
import torch

from app.errors import CheckpointMismatch
from app.policies.checkpoints import pretrained
from app.policies.checkpoints.model_state import tensors_under
from app.policies.configs.pick import PICK, THESIS
from app.policies.inference.task_selection import TaskChooser
from app.policies.inference.value_networks import ValueNetworks, pick_preset_of
from app.policies.networks.forward import FEW
from app.policies.networks.outcome import OutcomeHead
from app.policies.networks.pick import actor_of, critics_for
from app.policies.training.pick import settings_of, start
from app.sim.cells.cell import load_cell
from app.sim.pick.batch import WHOLE_PICK, PickBatch, PickSettings
from app.sim.pick.kernels.observation_layout import N_PICK
from tests.policies.untrained import overflowing


@pytest.mark.parametrize("n", [1, 3, FEW, FEW + 1, 200])
def test_the_shipped_policy_decides_as_its_modules_of_torch_do(n: int) -> None:
    checkpoint = pretrained.load("pick")
    networks, preset = ValueNetworks(checkpoint), pick_preset_of(checkpoint)
    parts = {
        "actor": actor_of(preset, networks.n_obs),
        "critic": critics_for(preset, networks.n_obs),
        "outcome": OutcomeHead(networks.n_obs),
    }
    for name, module in parts.items():
        module.load_state_dict(tensors_under(checkpoint.arrays(), name))
    obs = PickBatch(load_cell(), n, 5, WHOLE_PICK).reset()
    act, values, found = networks.evaluate(obs)
    assert found is not None and networks.evaluate(obs, predict=False)[2] is None
    with torch.inference_mode():
        rows = torch.as_tensor(obs)
        expected = parts["actor"](rows)
        np.testing.assert_allclose(act, expected.numpy(), atol=1e-5)
        least = parts["critic"].least(rows, expected)
        np.testing.assert_allclose(values, least.numpy(), atol=1e-4)
        head = parts["outcome"].predict(rows, torch.as_tensor(values))
    for one, other in zip(found, head, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-4)


@pytest.mark.parametrize("n", [2, FEW + 1])
def test_the_value_of_quantiles_is_the_least_mean(n: int) -> None:
    cell = load_cell(PICK.cell)
    run, _ = start(PICK, 4, cell)
    checkpoint = run.policy()
    critics = critics_for(PICK, N_PICK)
    critics.load_state_dict(tensors_under(checkpoint.arrays(), "critic"))
    obs = PickBatch(cell, n, 5, settings_of(PICK)).reset()
    act, values, _ = ValueNetworks(checkpoint).evaluate(obs)
    with torch.inference_mode():
        least = critics.least(torch.as_tensor(obs), torch.as_tensor(act))
    np.testing.assert_allclose(values, least.numpy(), atol=1e-4)
    assert np.ptp(values) > 0.0


@pytest.mark.parametrize("n", [2, FEW + 1])
def test_a_policy_of_the_raw_state_decides_on_features(n: int) -> None:
    cell = load_cell(THESIS.cell)
    run, _ = start(THESIS, 4, cell)
    checkpoint = run.policy()
    actor, critics = run.model.actor.mu, critics_for(THESIS, 51)
    critics.load_state_dict(tensors_under(checkpoint.arrays(), "critic"))
    raw = PickBatch(cell, n, 5, settings_of(THESIS)).reset()
    obs = PickBatch(cell, n, 5, PickSettings(observation="features")).reset()
    act, values, found = ValueNetworks(checkpoint).evaluate(obs)
    assert found is None
    with torch.inference_mode():
        rows = torch.as_tensor(raw)
        expected = actor(rows)
        least = critics.least(rows, expected)
    np.testing.assert_allclose(act, expected.numpy(), atol=1e-5)
    np.testing.assert_allclose(values, least.numpy(), atol=1e-4)


@pytest.mark.parametrize(
    ("part", "number"),
    [("actor.net", "action"), ("critic.q2", "value"), ("outcome.members.2", "outcome")],
)
def test_a_network_whose_numbers_overflow_is_found(part: str, number: str) -> None:
    obs = PickBatch(load_cell(), 8, 5, WHOLE_PICK).reset()
    ValueNetworks(pretrained.load("pick")).require_finite(obs)
    with np.errstate(all="ignore"):
        networks = ValueNetworks(overflowing("pick", part))
        with pytest.raises(CheckpointMismatch, match=f"{number} is 'NaN or infinite'"):
            networks.require_finite(obs)


def test_untrained_policies_of_both_recipes_give_finite_numbers() -> None:
    for preset in (PICK, THESIS):
        run, _ = start(preset, 4, load_cell(preset.cell))
        TaskChooser(run.policy()).require_finite()
