"""Controllers of one policy: direct, between targets, beside several people."""

import numpy as np
import pytest

from app.errors import CheckpointMismatch, GoalOutside, InvalidInput
from app.policies.inference.controllers import (
    NEAREST_M,
    InferenceMode,
    controller_of,
    inference_modes_of,
    person_weights,
)
from app.policies.inference.target_interpolation import Interpolation
from app.sim.cells.cell import load_cell
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.reach.goal_sets import halton_targets
from tests.policies.reach_actor import RandomActor

CELL = load_cell("shared-workspace")
TARGETS = {"grid": CELL.goal_region.targets(), "halton": halton_targets(CELL.goal_region)}
HALF = 0.5 * np.array(CELL.goal_region.size)
LOW, HIGH = CELL.goal_region.center - HALF, CELL.goal_region.center + HALF


def batch_of(
    people: tuple[str, ...] = ("walker",), n_envs: int = 12, **other: str
) -> ReachBatch:
    batch = ReachBatch(CELL, n_envs, 3, ReachSettings(people=people, **other))
    batch.reset()
    return batch


def send(batch: ReachBatch, goals: np.ndarray) -> None:
    batch.set_goals(np.arange(batch.n_envs), goals)


def random_goals(n: int, seed: int = 4) -> np.ndarray:
    return np.random.default_rng(seed).uniform(LOW, HIGH, (n, 3))


@pytest.mark.parametrize("view", ["features", "state"])
def test_direct_is_the_policy_on_the_ordinary_observation(view: str) -> None:
    batch, actor = batch_of(observation=view), RandomActor(view=view)
    obs = batch.restart()
    np.testing.assert_array_equal(controller_of(actor, "direct").acts(batch), actor.acts(obs))


@pytest.mark.parametrize("goals", ["grid", "halton"])
def test_at_a_target_the_interpolated_action_is_the_policys(goals: str) -> None:
    batch, actor = batch_of(n_envs=54), RandomActor(goals)
    send(batch, TARGETS[goals])
    np.testing.assert_array_equal(
        controller_of(actor, "interpolated").acts(batch),
        controller_of(actor, "direct").acts(batch),
    )


@pytest.mark.parametrize("goals", ["grid", "halton"])
def test_between_targets_it_is_the_weighted_mean_of_actions_for_them(goals: str) -> None:
    batch, actor = batch_of(n_envs=6), RandomActor(goals)
    wanted = random_goals(6)
    send(batch, wanted)
    found = controller_of(actor, "interpolated").acts(batch)
    mix = Interpolation(actor).cells.weights_at(wanted)
    mean = np.zeros((6, 6))
    for k in range(mix.which.shape[1]):
        send(batch, actor.targets[mix.which[:, k]])
        mean += mix.weights[:, k, None] * controller_of(actor, "direct").acts(batch)
    np.testing.assert_allclose(found, mean, atol=1e-6)


@pytest.mark.parametrize("goals", ["grid", "halton"])
def test_actions_are_continuous_over_the_borders_of_cells(goals: str) -> None:
    batch, controller = batch_of(n_envs=400), controller_of(RandomActor(goals))
    state = batch.state
    for name in ("q", "qd", "clear", "time_left"):
        getattr(state, name)[:] = getattr(state, name)[:1]
    state.people.walkers.rows[:] = state.people.walkers.rows[:1]
    state.people.cylinders[:] = state.people.cylinders[:1]
    send(batch, np.linspace(LOW + 1e-3, HIGH - 1e-3, 400))
    jumps = np.abs(np.diff(controller.acts(batch), axis=0)).max(axis=1)
    assert jumps.max() < 0.05 and jumps.min() > 0.0


def test_a_goal_outside_the_grid_is_refused_with_axis_and_distance() -> None:
    batch = batch_of(n_envs=2)
    send(batch, np.array([[0.0, 0.8, 0.3], [0.0, 1.3, 0.3]]))
    with pytest.raises(GoalOutside, match=r"0\.3 m outside along y"):
        controller_of(RandomActor("grid")).acts(batch)
    assert controller_of(RandomActor("box")).acts(batch).shape == (2, 6)


def test_a_policy_without_targets_cannot_interpolate() -> None:
    with pytest.raises(InvalidInput, match="no targets"):
        controller_of(RandomActor("box"), "interpolated")
    with pytest.raises(InvalidInput, match="choices: direct"):
        controller_of(RandomActor("box"), "sideways")


def test_only_policies_that_kernels_simulate_allow_rollouts() -> None:
    assert inference_modes_of(RandomActor()) == tuple(
        mode for mode in InferenceMode if not mode.rollout
    )
    assert inference_modes_of(RandomActor("box")) == ("direct", "distance-weighted")


@pytest.mark.parametrize("how", inference_modes_of(RandomActor()))
def test_ended_cells_get_no_action_and_the_others_the_same(how: str) -> None:
    batch, controller = batch_of(("walker", "constant")), controller_of(RandomActor(), how)
    before = controller.acts(batch)
    batch.state.outcome[[1, 4]] = 1
    after = controller.acts(batch)
    assert not after[[1, 4]].any()
    others = [0, 2, 3, *range(5, 12)]
    np.testing.assert_allclose(after[others], before[others], atol=1e-6)


@pytest.mark.parametrize("inner", ["direct", "interpolated"])
@pytest.mark.parametrize("people", [(), ("walker",)])
def test_beside_one_person_averaging_changes_nothing(
    inner: str, people: tuple[str, ...]
) -> None:
    batch, actor = batch_of(people), RandomActor()
    send(batch, random_goals(12))
    weighted = "distance-weighted" if inner == "direct" else "distance-weighted-interpolated"
    np.testing.assert_array_equal(
        controller_of(actor, weighted).acts(batch), controller_of(actor, inner).acts(batch)
    )


def test_distance_weighted_is_the_mean_of_actions_beside_each_person_alone() -> None:
    batch, actor = batch_of(("walker", "constant", "fixed-speed")), RandomActor()
    found, rows = controller_of(actor, "distance-weighted").acts(batch), np.arange(12)
    weights = person_weights(batch.person_distances(rows))
    mean = np.zeros((12, 6))
    for who in range(3):
        obs = batch.observe_goals(rows, batch.state.goal[:, None], who)[:, 0]
        mean += weights[:, who, None] * actor.acts(obs)
    np.testing.assert_allclose(found, mean, atol=1e-6)


def test_weights_of_people_sum_to_one_and_the_nearest_weighs_most() -> None:
    apart = np.random.default_rng(1).uniform(-0.1, 3.0, (500, 4))
    weights = person_weights(apart)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)
    clear = apart.min(axis=1) > NEAREST_M
    assert (weights.argmax(axis=1) == apart.argmin(axis=1))[clear].all()
    assert np.isfinite(weights).all() and (weights > 0.0).all()


def test_weights_fall_with_the_square_of_the_distance() -> None:
    np.testing.assert_allclose(person_weights(np.array([[0.5, 1.0]])), [[0.8, 0.2]])


def test_a_batch_that_observes_something_else_is_refused() -> None:
    with pytest.raises(CheckpointMismatch, match="view"):
        controller_of(RandomActor(view="state")).acts(batch_of())
