"""Networks of the sorting task: masks, duelling, symmetry, and duplicates."""

import numpy as np
import pytest
import torch

from app.policies.networks.sorting_q import NETWORKS, NEVER, PrintedNetwork, SharedNetwork
from app.sim.cells.cell import load_cell
from app.sim.sorting.batch import SortingSettings, batch_in, observe
from app.sim.sorting.state import SortingShape, SortingState, empty_state

SHAPE = SortingShape(n_slots=10, n_colours=2)
DISTURBED = SortingSettings(disturbed_share=0.7, random_map_share=0.5)


def network(shape: SortingShape = SHAPE, seed: int = 0) -> SharedNetwork:
    torch.manual_seed(seed)
    return SharedNetwork(shape, 32)


def values_of(net, *states: SortingState) -> np.ndarray:
    with torch.no_grad():
        return net(torch.as_tensor(np.stack([observe(state) for state in states]))).numpy()


@pytest.mark.parametrize("cell", ["sorting-e0", "sorting-e1"])
def test_exactly_the_moves_that_change_nothing_are_never_taken(cell):
    batch = batch_in(load_cell(cell), 300, 5, DISTURBED)
    obs = batch.reset()
    with torch.no_grad():
        values = network(batch.shape)(torch.as_tensor(obs)).numpy()
    assert ((values > NEVER) == batch.masks()).all()


def test_the_value_is_the_mean_over_valid_moves():
    batch = batch_in(load_cell("sorting-e0"), 50, 5, DISTURBED)
    net, obs = network(batch.shape), batch.reset()
    with torch.no_grad():
        before = net(torch.as_tensor(obs)).numpy()
        net.value.bias += 1.0
        after = net(torch.as_tensor(obs)).numpy()
    valid = batch.masks()
    assert after[valid] - before[valid] == pytest.approx(np.ones(valid.sum()), abs=1e-5)


def with_duplicates() -> SortingState:
    """Two large reds, in a risky and in a safe cell, and a goal that asks for one."""
    state = empty_state(SHAPE)
    red = SHAPE.code(0, 2)
    state.clutter[[2, 7]] = red
    state.goal[0, 0] = red
    state.fail[[2, 7]] = 0.4, 0.1
    return state


@pytest.mark.parametrize("seed", range(20))
def test_the_riskier_of_two_duplicates_is_never_worth_more(seed):
    values = values_of(network(seed=seed), with_duplicates())[0]
    for tower in range(2):
        assert values[2 * 2 + tower] <= values[7 * 2 + tower]


def test_the_value_of_a_pick_is_linear_in_its_failure_probability():
    states = []
    for fail in (0.2, 0.3, 0.4):  # the safer duplicate stays at 0.1
        state = with_duplicates()
        state.fail[2] = fail
        states.append(state)
    difference = np.diff(values_of(network(), *states)[:, [4, 14]], axis=1)[:, 0]
    assert difference[2] - difference[1] == pytest.approx(
        difference[1] - difference[0], abs=1e-6
    )


@pytest.mark.parametrize("n_colours", [2, 3])
def test_turning_all_colours_turns_the_values(n_colours):
    shape = SortingShape(n_slots=6, n_colours=n_colours)
    rng = np.random.default_rng(3)
    state = empty_state(shape)
    state.clutter[:4] = rng.integers(1, shape.n_types + 1, 4)
    state.goal[0, :2] = shape.code(0, 2), shape.code(0, 1)
    state.towers[1, 0] = shape.code(0, 2)
    state.fail[:] = rng.random(6) * 0.4

    def turn(codes):
        turned = 1 + (codes - 1 + shape.n_sizes) % shape.n_types
        return np.where(codes == 0, 0, turned).astype(np.int8)

    other = SortingState(
        clutter=turn(state.clutter),
        towers=np.roll(turn(state.towers), 1, axis=0),
        goal=np.roll(turn(state.goal), 1, axis=0),
        fail=state.fail,
    )
    values = values_of(network(shape), state, other)
    for action in range(shape.n_actions):
        move = shape.move_of(action)
        ends = [
            place if place < 6 else 6 + (place - 6 + 1) % n_colours
            for place in (move.pick, move.place)
        ]
        duplicate = shape.action_of(type(move)(*ends))
        assert values[0, action] == pytest.approx(values[1, duplicate], abs=1e-5)


def test_the_printed_network_has_two_streams_of_two_layers():
    net = PrintedNetwork(SHAPE, 128)
    for first, stream in ((net.advantage_first, net.advantage), (net.value_first, net.value)):
        assert first.weight.shape == (50 * 7, 128)
        assert (stream[1].in_features, stream[1].out_features) == (128, 128)
    assert (net.advantage[3].out_features, net.value[3].out_features) == (SHAPE.n_actions, 1)
    for stream in (net.advantage, net.value):
        bound = (6 / (128 + 128)) ** 0.5  # Glorot-uniform, as in the library of the thesis
        assert 0.99 * bound < stream[1].weight.abs().max() <= bound
        assert not stream[1].bias.any() and not stream[3].bias.any()
    obs = torch.as_tensor(batch_in(load_cell("sorting-e0"), 3, 1).reset())
    advantage = net(obs) - net(obs).mean(dim=1, keepdim=True)
    assert torch.allclose(advantage.mean(dim=1), torch.zeros(3), atol=1e-6)


def test_only_the_informed_network_observes_failure_probabilities():
    obs = torch.as_tensor(batch_in(load_cell("sorting-e0"), 3, 1).reset())
    other = obs.clone()
    other[:, -10:] = 255 - other[:, -10:]
    hidden, informed = NETWORKS["printed"](SHAPE, 16), NETWORKS["printed-informed"](SHAPE, 16)
    assert torch.equal(hidden(obs), hidden(other))
    assert not torch.equal(informed(obs), informed(other))


@pytest.mark.parametrize("kind", NETWORKS)
def test_the_best_move_is_the_one_of_greatest_value(kind):
    batch = batch_in(load_cell("sorting-e0"), 300, 5, DISTURBED)
    torch.manual_seed(3)
    net = NETWORKS[kind](batch.shape, 32)
    obs = torch.as_tensor(batch.reset())
    with torch.no_grad():
        values, best = net(obs), net.best(obs)
    taken = values.gather(1, best[:, None])[:, 0]
    torch.testing.assert_close(taken, values.amax(dim=1), rtol=0.0, atol=1e-5)
    assert len(best.unique()) > 1


def test_presets_name_networks_that_there_are():
    assert set(NETWORKS) == {"shared", "printed", "printed-informed"}
