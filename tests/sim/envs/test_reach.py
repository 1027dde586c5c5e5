"""The reach environments: observations, blocked arms, refusals."""

import numpy as np
import pytest

from app.errors import InvalidInput, NotFound
from app.sim.cells.cell import load_cell
from app.sim.core.observation_layout import OBS_BOUND
from app.sim.envs.pick import PickEnv
from app.sim.envs.reach import ReachEnv, ReachVectorEnv
from app.sim.pick.batch import PickSettings
from app.sim.reach.batch import ReachSettings
from app.sim.reach.kernels.observation import N_FEATURES
from app.sim.reach.recipe_rules import BlockedRules


@pytest.mark.parametrize(("observation", "size"), [("state", 20), ("features", N_FEATURES)])
def test_both_observations_are_as_long_as_the_data_sheet_says(
    observation: str, size: int
) -> None:
    env = ReachEnv(settings=ReachSettings(observation=observation))
    obs, _ = env.reset(seed=1)
    assert obs.shape == (size,) and env.observation_space.contains(obs)


def test_observations_stay_in_their_space_in_long_episodes_and_of_a_slow_robot() -> None:
    cell = load_cell("shared-workspace")
    slow = cell.robot.model_copy(update={"qd_max": (0.01,) * 6})
    for env in (
        ReachEnv(settings=ReachSettings(time_limit_s=1e4), people=()),
        PickEnv(settings=PickSettings(time_limit_s=1e4), people=()),
        ReachEnv(
            cell.model_copy(update={"robot": slow}), ReachSettings(observation="forecast"), ()
        ),
    ):
        obs = np.stack([env.reset(seed=seed)[0] for seed in range(8)])
        assert all(env.observation_space.contains(row) for row in obs)
        assert obs.max() == OBS_BOUND


def test_a_contact_blocks_the_arm_where_the_settings_say_so() -> None:
    settings = ReachSettings(blocked=BlockedRules(), collision_ends=False, limits="authors")
    one = ReachEnv(settings=settings, people=(), first_env=1)
    many = ReachVectorEnv(2, settings=settings, people=())
    one.reset(seed=1), many.reset(seed=1)
    down = np.array([0, 1, 0, 0, 0, 0], dtype=np.float32)
    for _ in range(200):
        obs, rew, *_ = one.step(down)
        rows, rewards, *_ = many.step(np.tile(down, (2, 1)))
        np.testing.assert_array_equal(obs, rows[1])
        assert rew == rewards[1]
    assert one.batch.state.touched[0] > 20 and not one.batch.state.qd.any()


def test_unknown_cell_and_people_are_refused_with_the_known_ones() -> None:
    with pytest.raises(NotFound, match="shared-workspace"):
        ReachEnv("no-such-cell")
    with pytest.raises(InvalidInput, match="fixed-speed"):
        ReachEnv(people=("ghost",))
