"""A trained reach policy, for inference: numpy in, numpy out, and what it refuses."""

import dataclasses

import numpy as np
import pytest
import torch

from app.errors import CheckpointMismatch, InvalidInput
from app.policies.checkpoints import checkpoint as formats
from app.policies.checkpoints import pretrained
from app.policies.checkpoints.model_state import tensors_under, weights_of
from app.policies.inference.reach_policy import PEOPLE_SET, ReachPolicy
from app.policies.training.reach import networks_of
from app.sim.cells.cell import load_cell
from app.sim.reach.batch import ReachBatch, ReachSettings, goal_region_of
from app.sim.reach.goal_sets import halton_targets
from app.sim.reach.reach_actor import ReachActor
from app.sim.reach.rollout.kernels.actor import FEW
from app.sim.robot.actions import ActionSettings
from tests.policies.untrained import overflowing_reach, reach_preset, untrained_reach


@pytest.fixture(scope="module")
def checkpoint():
    return untrained_reach(width=64)


def changed(checkpoint, **fields):
    """Return the checkpoint with other fields in its manifest."""
    return formats.load({**checkpoint.manifest, **fields}, checkpoint.tensors)


@pytest.mark.parametrize(("layers", "kind"), [(2, "residual"), (5, "plain")])
def test_it_acts_as_the_network_that_was_trained(layers, kind):
    checkpoint = untrained_reach(seed=4, width=48, layers=layers, actor=kind)
    policy = ReachPolicy(checkpoint)
    preset = reach_preset(width=48, layers=layers, actor=kind)
    actor = networks_of(preset, policy.n_obs).actor()
    actor.load_state_dict(tensors_under(checkpoint.arrays(), "actor"))
    obs = np.random.default_rng(1).normal(size=(300, policy.n_obs)).astype(np.float32)
    with torch.no_grad():
        expected = actor(torch.as_tensor(obs)).numpy()
    act = policy.acts(obs)
    assert act.dtype == np.float32 and np.ptp(act) > 0.1
    np.testing.assert_allclose(act, expected, atol=2e-6)


def test_a_normalised_actor_acts_as_in_training():
    overrides = {"width": 24, "layers": 3, "actor": "ddpg", "critic": "ddpg"}
    overrides["normalisation"] = "running"
    checkpoint = untrained_reach(seed=4, **overrides)
    n_obs = sum(size for _, size in checkpoint.manifest["layout"])
    actor = networks_of(reach_preset(**overrides), n_obs).actor()
    obs = 3.0 + 2.0 * np.random.default_rng(1).normal(size=(300, n_obs)).astype(np.float32)
    actor.load_state_dict(tensors_under(checkpoint.arrays(), "actor"))
    actor.norm.update(torch.as_tensor(obs))
    tensors = {**checkpoint.arrays(), **weights_of({"actor": actor})}
    policy = ReachPolicy(formats.pack(checkpoint.manifest, tensors))
    with torch.no_grad():
        expected = actor(torch.as_tensor(obs)).numpy()
    np.testing.assert_allclose(policy.acts(obs), expected, atol=1e-5)


def test_few_states_are_answered_as_many_are():
    """By the kernel, each by itself, what the matrices say of all together."""
    policy = ReachPolicy(pretrained.load("reach"))
    cell, n = load_cell("shared-workspace"), 3 * FEW
    batch = ReachBatch(cell, n, 5, ReachSettings(observation=policy.view))
    obs = batch.reset()
    for _ in range(10):
        obs = batch.step(policy.acts(obs)).obs
    many = policy.acts(obs)
    alone = np.concatenate([policy.acts(obs[row : row + 1]) for row in range(n)])
    assert np.ptp(alone) > 0.5
    np.testing.assert_allclose(alone, many, atol=2e-5)
    np.testing.assert_array_equal(policy.acts(obs[:FEW][::-1]), alone[:FEW][::-1])


def test_it_says_what_it_is(checkpoint):
    policy: ReachActor = ReachPolicy(checkpoint)
    cell = load_cell("shared-workspace")
    assert (policy.checkpoint, policy.view) == (checkpoint.sha256, "forecast")
    assert (policy.cell, policy.cell_sha256) == (cell.name, cell.sha256)
    assert policy.title == "Reach (TD3), 0.00 M steps"
    assert policy.action == ActionSettings()
    np.testing.assert_array_equal(policy.targets, goal_region_of(cell).targets())
    assert ReachPolicy(untrained_reach(width=16, goals="box")).targets is None
    halton = ReachPolicy(untrained_reach(width=16, goals="halton", n_halton=30)).targets
    np.testing.assert_array_equal(halton, halton_targets(goal_region_of(cell), 30))


@pytest.mark.parametrize("kind", ["residual", "plain"])
def test_the_set_encoding_ignores_order_and_absent_people(kind):
    checkpoint = untrained_reach(seed=4, width=48, actor=kind, observation="people-set")
    policy = ReachPolicy(checkpoint)
    preset = reach_preset(width=48, actor=kind, observation="people-set")
    actor = networks_of(preset, policy.n_obs).actor()
    actor.load_state_dict(tensors_under(checkpoint.arrays(), "actor"))
    obs = np.random.default_rng(1).normal(size=(50, policy.n_obs)).astype(np.float32)
    blocks = obs[:, PEOPLE_SET.first :].reshape(50, PEOPLE_SET.n_people, PEOPLE_SET.n_block)
    blocks[:, :, 0] = [1.0, 1.0, 1.0, 0.0]
    act = policy.acts(obs)
    with torch.no_grad():
        np.testing.assert_allclose(act, actor(torch.as_tensor(obs)).numpy(), atol=2e-6)
    blocks[:] = blocks[:, [3, 1, 0, 2]]
    np.testing.assert_allclose(policy.acts(obs), act, atol=1e-6)
    blocks[:, 0, 1:] = 9.0
    np.testing.assert_allclose(policy.acts(obs), act, atol=1e-6)
    blocks[:, 1, 1:] = 9.0
    assert np.abs(policy.acts(obs) - act).max() > 0.01
    assert policy.kernel_network is None, "looking ahead knows no sets"


@pytest.mark.parametrize(
    ("view", "actor"),
    [
        ("forecast", "residual"),
        ("features", "residual"),
        ("state", "plain"),
        ("people-set", "residual"),
    ],
)
def test_it_moves_the_robot_of_a_batch(view, actor):
    policy = ReachPolicy(untrained_reach(width=16, observation=view, actor=actor))
    batch = ReachBatch(
        load_cell("shared-workspace"), 3, 1, ReachSettings(observation=policy.view)
    )
    first = batch.reset().copy()
    result = batch.step(policy.acts(first))
    assert not np.array_equal(result.obs[:, :6], first[:, :6])


def test_observations_of_another_shape_are_refused(checkpoint):
    with pytest.raises(InvalidInput, match="obs"):
        ReachPolicy(checkpoint).acts(np.zeros((2, 20), dtype=np.float32))


def test_a_policy_of_another_task_is_refused():
    with pytest.raises(CheckpointMismatch, match="purpose"):
        ReachPolicy(pretrained.load("pick"))


@pytest.mark.parametrize(
    ("fields", "fault"),
    [
        ({"act_size": 5}, "act_size"),
        ({"layout": [["human", 5]]}, "layout"),
        ({"preset": {"episode": {"goals": "moon"}}}, r"manifest\.preset\.episode\.goals"),
        ({"preset": {"episode": {"goals": "halton", "n_halton": "1"}}}, "n_halton"),
        ({"preset": {"goals": "grid"}}, r"manifest\.preset\.goals"),
    ],
)
def test_a_manifest_that_does_not_fit_is_named(checkpoint, fields, fault):
    with pytest.raises((CheckpointMismatch, InvalidInput), match=fault):
        ReachPolicy(changed(checkpoint, **fields))


@pytest.mark.parametrize("drop", ["actor.net.0.weight", "actor.net.2.bias", "actor.net.4.bias"])
def test_tensors_that_make_no_network_are_refused(checkpoint, drop):
    arrays = {name: array for name, array in checkpoint.arrays().items() if name != drop}
    with pytest.raises(CheckpointMismatch, match="tensors"):
        ReachPolicy(formats.pack(checkpoint.manifest, arrays))


@pytest.mark.parametrize("extra", ["actor.net.8.weight", "actor.net.3.bias", "actor.net.x"])
def test_tensors_of_the_actor_that_no_layer_uses_are_refused(checkpoint, extra):
    arrays = {**checkpoint.arrays(), extra: np.zeros((6, 6), dtype=np.float32)}
    with pytest.raises(CheckpointMismatch, match=f"tensors is '{extra}'"):
        ReachPolicy(formats.pack(checkpoint.manifest, arrays))


@pytest.mark.parametrize("values", [None, np.zeros(3)])
def test_normalisation_without_its_tensors_is_refused(values):
    overrides = {"actor": "ddpg", "critic": "ddpg", "normalisation": "running"}
    checkpoint = untrained_reach(width=24, **overrides)
    arrays = {**checkpoint.arrays(), "actor.norm.total": values}
    arrays = {name: array for name, array in arrays.items() if array is not None}
    with pytest.raises(CheckpointMismatch, match="checkpoint tensors"):
        ReachPolicy(formats.pack(checkpoint.manifest, arrays))


@pytest.mark.parametrize("count", [0.0, -1.0, 1e-300])
def test_normalisation_without_finite_moments_is_refused(count):
    overrides = {"actor": "ddpg", "critic": "ddpg", "normalisation": "running"}
    checkpoint = untrained_reach(width=24, **overrides)
    arrays = {**checkpoint.arrays(), "actor.norm.count": np.array([count])}
    with pytest.raises(CheckpointMismatch, match=r"tensors\.actor\.norm is 'count"):
        ReachPolicy(formats.pack(checkpoint.manifest, arrays))


@pytest.mark.parametrize("n", [1, FEW + 1])
def test_actions_that_are_not_finite_are_refused(n):
    policy = ReachPolicy(overflowing_reach())
    obs = np.zeros((n, policy.n_obs), dtype=np.float32)
    with np.errstate(all="ignore"), pytest.raises(CheckpointMismatch, match="finite numbers"):
        policy.acts(obs)


def test_layers_that_do_not_fit_each_other_are_refused(checkpoint):
    arrays = dict(checkpoint.arrays())
    arrays["actor.net.2.weight"] = np.zeros((64, 63), dtype=np.float32)
    broken = formats.pack(checkpoint.manifest, arrays)
    with pytest.raises(CheckpointMismatch, match=r"actor\.net\.2"):
        ReachPolicy(dataclasses.replace(broken))
