"""Parameter-space noise (Plappert et al. 2018), compared with computations by hand."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch
from torch import nn

from app.policies.algorithms.parameter_noise import FACTOR, ParameterNoise, distance, forward
from app.policies.configs import presets
from app.policies.configs.pick import ENV_BYTES, PickPreset
from app.policies.networks.forward import Layer, layers_of
from app.policies.networks.pick import actor_of
from app.policies.training.pick import batch_of
from app.sim.cells.cell import load_cell
from app.sim.pick.batch import PickBatch, PickSettings
from tests.policies.conftest import preset_of


@pytest.fixture
def batch() -> PickBatch:
    found = PickBatch(load_cell(), 6, 3, PickSettings(observation="state"))
    found.reset()
    return found


@pytest.fixture
def actor() -> nn.Module:
    torch.manual_seed(4)
    return actor_of(preset_of("pick-td3-thesis", {"networks.width": 16}), 51)


def noise_of(batch: PickBatch, actor: nn.Module, sigma: float = 0.5) -> ParameterNoise:
    noise = ParameterNoise(batch, sigma, np.random.default_rng(1))
    noise.follow(actor)
    return noise


def test_the_distance_is_the_root_mean_square_over_states_and_joints() -> None:
    first = np.array([[0.0, 0.5], [1.0, -1.0]], dtype=np.float32)
    second = np.array([[0.0, 0.1], [0.8, -0.4]], dtype=np.float32)
    assert distance(first, second) == pytest.approx(((0.16 + 0.04 + 0.36) / 4) ** 0.5)


class Constant(nn.Module):
    """Actor of one joint whose action is ``tanh`` of its bias."""

    def __init__(self, bias: float) -> None:
        super().__init__()
        self.net = nn.Sequential(nn.Linear(1, 1))
        nn.init.zeros_(self.net[0].weight)
        nn.init.constant_(self.net[0].bias, bias)


@pytest.mark.parametrize(
    ("bias", "factor"),
    [
        (0.0, 1 / 1.01),  # the drawn bias of 2 x 0.5 moves the action by tanh(1) > 0.5
        (4.0, 1.01),  # a saturated action moves by tanh(5) - tanh(4) < 0.5
    ],
)
def test_sigma_is_multiplied_where_actions_are_near_and_divided_where_far(
    bias: float, factor: float
) -> None:
    drawn = SimpleNamespace(
        standard_normal=lambda shape, dtype: np.full(shape, 2.0, dtype=dtype)
    )
    noise = ParameterNoise(SimpleNamespace(n_envs=1), 0.5, drawn)  # type: ignore[arg-type]
    noise.follow(Constant(bias))
    obs = np.zeros((8, 1), dtype=np.float32)
    noise.adapt(obs)
    assert noise.sigma == pytest.approx(0.5 * factor)
    noise.adapt(obs)
    assert noise.sigma == pytest.approx(0.5 * factor**2)
    assert FACTOR == 1.01 and noise.delta == 0.5


def test_sigma_approaches_the_wanted_distance(batch, actor) -> None:
    noise, obs = noise_of(batch, actor), np.random.default_rng(2).normal(size=(64, 51))
    states = obs.astype(np.float32)
    for _ in range(600):
        noise.adapt(states)
    far = [
        distance(
            actor(torch.as_tensor(states)).detach().numpy(),
            forward(tuple(Layer(*(a[None] for a in one)) for one in copy), states[None])[0],
        )
        for copy in (noise.perturbed() for _ in range(200))
    ]
    assert np.mean(far) == pytest.approx(0.5, abs=0.1)


def test_weights_get_normal_noise_and_layer_normalisation_none(batch, actor) -> None:
    noise = noise_of(batch, actor, sigma=0.25)
    copies = [noise.perturbed() for _ in range(300)]
    for place, layer in enumerate(layers_of(actor.net)):
        drawn = np.stack([copy[place].weight for copy in copies]) - layer.weight
        assert drawn.mean() == pytest.approx(0.0, abs=0.02)
        assert drawn.std() == pytest.approx(0.25, rel=0.02)
        assert np.stack([copy[place].bias for copy in copies]).std() > 0.2
        for copy in copies:
            np.testing.assert_array_equal(copy[place].gain, layer.gain)
            np.testing.assert_array_equal(copy[place].shift, layer.shift)


def test_a_copy_acts_for_a_whole_episode_and_another_one_in_the_next(batch, actor) -> None:
    noise, unused = noise_of(batch, actor), np.zeros((6, 5), dtype=np.float32)
    first = noise.apply(unused)
    assert len(np.unique(first, axis=0)) == 6
    with torch.no_grad():
        for value in actor.parameters():
            value.add_(1.0)  # an update within the episode
    batch.state.elapsed[:] = 1.0
    np.testing.assert_array_equal(noise.apply(unused), first)
    batch.state.elapsed[2] = 0.0
    changed = (noise.apply(unused) != first).any(axis=1)
    assert changed.tolist() == [False, False, True, False, False, False]


def test_without_noise_the_copies_act_as_the_actor(batch, actor) -> None:
    noise = noise_of(batch, actor)
    noise.sigma = 0.0
    expected = actor(torch.as_tensor(batch.obs)).detach().numpy()
    taken = noise.apply(expected)
    np.testing.assert_allclose(taken, expected, atol=1e-6)


def test_the_state_of_an_environment_is_within_the_bound_of_the_configuration() -> None:
    people, episode = {"n_people": 4}, {"safety": "ssm", "curriculum_steps": 0}
    preset = presets.resolve("pick-td3-thesis", {"people": people, "episode": episode})
    assert isinstance(preset, PickPreset)
    state = batch_of(preset, load_cell(preset.cell), 64, 1).state_dict()
    size = sum(one.nbytes for one in state.values() if isinstance(one, np.ndarray))
    assert 0.5 * ENV_BYTES < size / 64 < ENV_BYTES
