"""The vector environments keep Gymnasium's conventions of SAME_STEP autoreset."""

import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import DictInfoToList, RecordEpisodeStatistics

import app.sim.envs  # noqa: F401  (registers the ids)
from app.errors import InvalidInput, SimulationError
from app.sim.envs.reach import ReachVectorEnv
from app.sim.reach.batch import ReachSettings

SAME = AutoresetMode.SAME_STEP
QUICK = ReachSettings(time_limit_s=0.1, observation="state")
STILL = np.zeros((4, 6), dtype=np.float32)


def test_observations_fit_the_spaces_and_are_not_overwritten() -> None:
    env = ReachVectorEnv(4)
    first, _ = env.reset(seed=3)
    kept = first.copy()
    second = env.step(STILL)[0]
    assert env.observation_space.contains(first) and env.observation_space.contains(second)
    np.testing.assert_array_equal(first, kept)


def test_next_episode_starts_in_the_step_that_ended_one() -> None:
    env = ReachVectorEnv(4, settings=QUICK, people=(), autoreset_mode=SAME)
    env.reset(seed=3)
    ends = [env.step(STILL)[2:] for _ in range(5)]
    assert not any("final_obs" in infos for _, _, infos in ends[:4])
    terminated, truncated, infos = ends[-1]
    assert not terminated.any() and truncated.all()
    assert list(infos["final_info"]["outcome"]) == ["timeout"] * 4
    assert (
        list(infos["episode_number"]) == [1] * 4 and list(infos["outcome"]) == ["running"] * 4
    )
    np.testing.assert_allclose(infos["time_left_s"], 0.1)


def test_rows_that_did_not_end_have_no_final_observation() -> None:
    env = ReachVectorEnv(64, settings=ReachSettings(start="uniform"), autoreset_mode=SAME)
    env.reset(seed=3)
    *_, infos = env.step(np.zeros((64, 6), dtype=np.float32))
    ended = infos["_final_obs"]
    assert 0 < ended.sum() < 64
    assert [obs is not None for obs in infos["final_obs"]] == list(ended)
    assert [name is not None for name in infos["final_info"]["outcome"]] == list(ended)


def test_gymnasiums_own_wrappers_work() -> None:
    env = DictInfoToList(
        RecordEpisodeStatistics(
            ReachVectorEnv(4, settings=QUICK, people=(), autoreset_mode=SAME)
        )
    )
    env.reset(seed=3)
    for _ in range(5):
        *_, infos = env.step(STILL)
    assert [info["final_info"]["outcome"] for info in infos] == ["timeout"] * 4
    assert [info["episode"]["l"] for info in infos] == [5] * 4


def test_reset_without_seed_goes_on_to_the_next_episodes() -> None:
    env, other = ReachVectorEnv(4), ReachVectorEnv(4)
    env.reset(seed=3)
    obs, infos = env.reset()
    assert list(infos["episode_number"]) == [1] * 4
    again, _ = other.reset(seed=3, options={"episode": 1})
    np.testing.assert_array_equal(obs, again)


def test_unseeded_environments_differ() -> None:
    assert not np.array_equal(ReachVectorEnv(4).reset()[0], ReachVectorEnv(4).reset()[0])


def test_step_before_reset_and_nan_are_refused() -> None:
    env = ReachVectorEnv(4)
    with pytest.raises(ResetNeeded, match="reset"):
        env.step(STILL)
    env.reset(seed=1)
    for value in (np.nan, 1e300):
        with pytest.raises(SimulationError, match="finite"):
            env.step(np.full((4, 6), value))


@pytest.mark.parametrize("shape", [(6, 4), (24,), (4, 3, 2), (3, 6), (6,), ()])
def test_actions_of_another_shape_are_refused_even_with_as_many_numbers(
    shape: tuple[int, ...],
) -> None:
    env = ReachVectorEnv(4)
    env.reset(seed=1)
    with pytest.raises(InvalidInput, match=r"act = .* must have the shape \(4, 6\)"):
        env.step(np.zeros(shape, dtype=np.float32))


def test_action_of_one_environment_needs_no_first_axis() -> None:
    env = ReachVectorEnv(1)
    env.reset(seed=1)
    assert env.step(np.zeros(6, dtype=np.float32))[1].shape == (1,)


def test_a_list_of_seeds_is_refused() -> None:
    with pytest.raises(InvalidInput, match=r"seed = \[1, 2\] must be a whole number"):
        ReachVectorEnv(2).reset(seed=[1, 2])
