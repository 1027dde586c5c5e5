"""The weighted mean of a policy's actions for the targets around a goal."""

import numpy as np
import pytest

from app.errors import GoalOutside, InvalidInput
from app.policies.inference.target_interpolation import Interpolation, interpolates
from app.sim.reach.goal_sets import InterpolationWeights
from app.sim.reach.kernels.observation import N_FEATURES
from tests.policies.reach_actor import RandomActor


@pytest.mark.parametrize(("goals", "n_corners"), [("grid", 8), ("in-turn", 8), ("halton", 4)])
def test_targets_around_a_goal_come_with_their_positions(goals: str, n_corners: int) -> None:
    between = Interpolation(RandomActor(goals))
    mix, places = between.around(np.array([[0.02, 0.71, 0.33], [0.4, 0.9, 0.2]]))
    assert places.shape == (2, n_corners, 3)
    np.testing.assert_array_equal(places, between.cells.targets[mix.which])


def test_targets_without_weight_are_not_asked_for() -> None:
    between = Interpolation(RandomActor())
    obs = np.full((1, 8, N_FEATURES), np.nan, dtype=np.float32)
    obs[0, 2] = np.linspace(-1, 1, N_FEATURES)
    weights = np.zeros((1, 8))
    weights[0, 2] = 1.0
    mix = InterpolationWeights(which=np.arange(8)[None], weights=weights)
    found = between.acts(obs, mix)
    np.testing.assert_array_equal(found, between.actor.acts(obs[:, 2]))


def test_only_policies_with_targets_interpolate() -> None:
    assert all(interpolates(RandomActor(one)) for one in ("grid", "in-turn", "halton"))
    assert not interpolates(RandomActor("box"))
    with pytest.raises(InvalidInput, match="no targets"):
        Interpolation(RandomActor("box"))


def test_messages_use_the_given_field_of_the_goal() -> None:
    with pytest.raises(GoalOutside, match=r"^goals\[3\] = "):
        Interpolation(RandomActor()).around(np.array([[9.0, 0.8, 0.3]]), "goals[3]")
