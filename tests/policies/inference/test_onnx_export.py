import json

import numpy as np
import onnx
import onnxruntime
import pytest
import torch

from app.errors import InvalidInput
from app.policies.algorithms.td3 import critics_of
from app.policies.checkpoints import pretrained
from app.policies.checkpoints.checkpoint import Checkpoint, load, pack
from app.policies.checkpoints.model_state import tensors_under, weights_of
from app.policies.configs.pick import PICK, THESIS, PickPreset
from app.policies.inference.onnx_export import LIMITS, export
from app.policies.inference.reach_policy import LAYOUTS, PEOPLE_SET, ReachPolicy
from app.policies.inference.value_networks import ValueNetworks
from app.policies.networks.actor_critic import ResidualActor
from app.policies.training.pick import batch_of, start
from app.policies.training.reach import networks_of
from app.sim.cells.cell import load_cell
from app.sim.core.arrays import Vec
from app.sim.reach.batch import N_ACT
from app.sim.reach.kernels.observation import BASE_START
from app.sim.robot.kernels.arm import CONTROLLED
from tests.policies.untrained import reach_preset, untrained_reach

TOLERANCE = 1e-5
"""Of actions; of values relative to their size, if that is more than 1.

Both sides are rounded to single precision: far from all observations of the environments, their
actions differ by up to 1.2e-5 in 20,000 random ones.
"""


def played(checkpoint: Checkpoint, obs: Vec) -> list[Vec]:
    """Return the outputs of the exported model."""
    session = onnxruntime.InferenceSession(export(checkpoint, "policy"))
    feeds, first = {}, 0
    for name, size in checkpoint.manifest["layout"]:
        feeds[name] = obs[:, first : first + size]
        first += size
    found: list[Vec] = session.run(None, feeds)
    return found


def observations(checkpoint: Checkpoint) -> Vec:
    n_obs = sum(size for _, size in checkpoint.manifest["layout"])
    return np.random.default_rng(5).normal(size=(64, n_obs)).astype(np.float32)


@pytest.fixture(scope="module")
def observed() -> Vec:
    """Observations of a robot that moves at random beside the people of the training."""
    rng = np.random.default_rng(5)
    batch = batch_of(PICK, load_cell(PICK.cell), 64, seed=5)
    batch.reset()
    actions = rng.uniform(-1.0, 1.0, (200, 64, CONTROLLED)).astype(np.float32)
    steps = [batch.step(action).obs.copy() for action in actions]
    return np.concatenate(steps[::10])


def with_people_set() -> Checkpoint:
    """Return an untrained reach policy that observes a set of people."""
    shipped = pretrained.load("reach").manifest
    layout = LAYOUTS["people-set"]
    episode = {**shipped["preset"]["episode"], "observation": "people-set"}
    manifest = {
        **shipped,
        "layout": layout,
        "preset": {**shipped["preset"], "episode": episode},
    }
    n_obs = sum(size for _, size in layout)
    actor = ResidualActor(32, n_obs, N_ACT, BASE_START, people_set=PEOPLE_SET)
    return pack(manifest, weights_of({"actor": actor}))


NORMALISED = {"width": 24, "actor": "ddpg", "critic": "ddpg", "normalisation": "running"}


def normalised_reach(obs: Vec) -> Checkpoint:
    """Return an untrained reach policy that normalises by given observations."""
    checkpoint = untrained_reach(seed=4, **NORMALISED)
    actor = networks_of(reach_preset(**NORMALISED), obs.shape[1]).actor()
    actor.load_state_dict(tensors_under(checkpoint.arrays(), "actor"))
    actor.norm.update(torch.as_tensor(obs))
    tensors = {**checkpoint.arrays(), **weights_of({"actor": actor})}
    return pack(checkpoint.manifest, tensors)


@pytest.mark.parametrize("alias", ["pick", "pick-monitored"])
def test_exported_pick_policy_acts_and_values_as_the_checkpoint(
    alias: str, observed: Vec
) -> None:
    checkpoint = pretrained.load(alias)
    for obs in (observed, observations(checkpoint)):
        act, value = played(checkpoint, obs)
        expected = ValueNetworks(checkpoint).evaluate(obs)
        np.testing.assert_allclose(act, expected[0], rtol=0.0, atol=TOLERANCE)
        assert (abs(value[:, 0] - expected[1]) < TOLERANCE * abs(expected[1]).clip(1.0)).all()


@pytest.mark.parametrize("preset", [PICK, THESIS], ids=["quantiles", "raw-state"])
def test_exported_pick_policy_acts_and_values_as_the_training(preset: PickPreset) -> None:
    run, _ = start(preset, 4, load_cell(preset.cell))
    checkpoint = run.policy()
    obs = observations(checkpoint)
    with torch.inference_mode():
        rows = torch.as_tensor(obs)
        expected = run.model.actor(rows)
        least = critics_of(run.model.critic).least(rows, expected)
    act, value = played(checkpoint, obs)
    np.testing.assert_allclose(act, expected.numpy(), atol=TOLERANCE)
    np.testing.assert_allclose(value[:, 0], least.numpy(), atol=TOLERANCE)
    model = onnx.load_from_string(export(checkpoint, "policy"))
    assert all(one.doc_string for one in model.graph.input)


def test_exported_reach_policy_acts_as_the_checkpoint() -> None:
    for checkpoint in (pretrained.load("reach"), with_people_set()):
        obs = observations(checkpoint)
        (act,) = played(checkpoint, obs)
        np.testing.assert_allclose(act, ReachPolicy(checkpoint).acts(obs), atol=TOLERANCE)


def test_exported_reach_policy_with_normalised_observations_acts_as_the_checkpoint() -> None:
    checkpoint = normalised_reach(3.0 + 2.0 * observations(untrained_reach(**NORMALISED)))
    obs = 3.0 + 2.0 * observations(checkpoint)
    (act,) = played(checkpoint, obs)
    np.testing.assert_allclose(act, ReachPolicy(checkpoint).acts(obs), atol=TOLERANCE)
    assert np.abs(act - ReachPolicy(untrained_reach(**NORMALISED)).acts(obs)).max() > 0.001


def test_exported_reach_policy_whose_manifest_leaves_out_defaults_acts_as_the_checkpoint() -> (
    None
):
    shipped = pretrained.load("reach")
    preset = {**shipped.manifest["preset"], "networks": {}}
    checkpoint = load({**shipped.manifest, "preset": preset}, shipped.tensors)
    obs = observations(checkpoint)
    (act,) = played(checkpoint, obs)
    np.testing.assert_allclose(act, ReachPolicy(checkpoint).acts(obs), atol=TOLERANCE)


@pytest.mark.parametrize("alias", ["pick", "reach"])
def test_exported_model_describes_its_inputs_and_limits(alias: str) -> None:
    checkpoint = pretrained.load(alias)
    model = onnx.load_from_string(export(checkpoint, "policy"))
    inputs = [
        (one.name, one.type.tensor_type.shape.dim[1].dim_value) for one in model.graph.input
    ]
    assert inputs == [tuple(group) for group in checkpoint.manifest["layout"]]
    assert all(one.doc_string for one in (*model.graph.input, *model.graph.output))
    metadata = {one.key: one.value for one in model.metadata_props}
    assert metadata["checkpoint"] == checkpoint.sha256
    assert metadata["limits"] == LIMITS
    assert json.loads(metadata["trained_range"]) == checkpoint.manifest["trained_range"]


def test_sorting_policy_is_not_exported() -> None:
    with pytest.raises(InvalidInput, match="/v1/sorting"):
        export(pretrained.load("sorting-e0"), "sorting-e0")
