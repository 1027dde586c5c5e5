"""The Gymnasium environment keeps both checkers' rules and the scenario's promises."""

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env

import app.sim.envs  # noqa: F401  (registers the ids)
from app.errors import NotFound, SimulationError
from app.sim.cells import load_cell
from app.sim.envs.pick import PickEnv
from app.sim.pick import PickBatch, PickSettings


def actions(n: int) -> np.ndarray:
    return np.random.default_rng(71).uniform(-1, 1, (n, 5)).astype(np.float32)


def test_registered_id_makes_the_environment() -> None:
    env = gymnasium.make("tandem/Pick-v0", settings=PickSettings(time_limit_s=10.0))
    _, info = env.reset(seed=4)
    assert isinstance(env.unwrapped, PickEnv)
    assert info["time_left_s"] == 10.0
    env.close()


def test_environment_passes_gymnasiums_check() -> None:
    check_env(gymnasium.make("tandem/Pick-v0").unwrapped, skip_render_check=True)


def test_environment_passes_stable_baselines3s_check() -> None:
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    checker.check_env(gymnasium.make("tandem/Pick-v0").unwrapped)


def test_episodes_equal_row_zero_of_a_batch_bit_for_bit() -> None:
    env, batch = PickEnv(), PickBatch(load_cell(), 5, 9, PickSettings())
    expected, (obs, _) = batch.reset(), env.reset(seed=9)
    for act in actions(900):
        np.testing.assert_array_equal(obs, expected[0])
        result = batch.step(np.tile(act, (5, 1)))
        obs, rew, terminated, _, _ = env.step(act)
        assert rew == result.rew[0]
        assert terminated == bool(result.ended[0])
        if terminated:
            obs, _ = env.reset()
        expected = result.obs
    assert batch.state.episode[0] >= 1


def test_every_episode_can_be_started_again_by_its_number() -> None:
    env = PickEnv()
    env.reset(seed=3)
    third = [env.reset()[0] for _ in range(3)][-1]
    again, info = PickEnv().reset(seed=3, options={"episode": 3})
    np.testing.assert_array_equal(again, third)
    assert info["episode_number"] == 3


def test_unseeded_environments_differ() -> None:
    assert not np.array_equal(PickEnv().reset()[0], PickEnv().reset()[0])


def test_time_out_terminates_and_a_further_step_asks_for_a_reset() -> None:
    env = PickEnv(settings=PickSettings(time_limit_s=0.1))
    env.reset(seed=1)
    still = np.zeros(5, dtype=np.float32)
    ends = [env.step(still)[2:] for _ in range(2)]
    assert [(end[0], end[1]) for end in ends] == [(False, False), (True, False)]
    assert ends[-1][2]["outcome"] == "timeout"
    with pytest.raises(ResetNeeded, match="reset"):
        env.step(still)


def test_nan_action_is_refused() -> None:
    env = PickEnv()
    env.reset(seed=1)
    with pytest.raises(SimulationError, match="finite"):
        env.step(np.full(5, np.nan, dtype=np.float32))


def test_unknown_cell_is_refused_with_the_known_ones() -> None:
    with pytest.raises(NotFound, match="pick-and-place"):
        PickEnv("no-such-cell")
