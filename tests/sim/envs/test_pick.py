"""The pick environment keeps the promises of the scenario."""

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from app.errors import NotFound, SimulationError
from app.sim.cells.cell import load_cell
from app.sim.envs.pick import PickEnv
from app.sim.human.anthropometry import MEDIAN, percentile_body
from app.sim.people.human_motion_config import HumanMotionConfig
from app.sim.pick.batch import WHOLE_PICK, PickBatch, PickSettings
from app.sim.pick.kernels.observation_layout import N_FEATURES, N_WITH_BODY


def actions(n: int) -> np.ndarray:
    return np.random.default_rng(71).uniform(-1, 1, (n, 5)).astype(np.float32)


def test_episodes_equal_row_zero_of_a_batch_bit_for_bit() -> None:
    env, batch = PickEnv(), PickBatch(load_cell(), 5, 9, WHOLE_PICK)
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


def test_unseeded_environments_differ() -> None:
    assert not np.array_equal(PickEnv().reset()[0], PickEnv().reset()[0])


def test_nan_action_is_refused() -> None:
    env = PickEnv()
    env.reset(seed=1)
    with pytest.raises(SimulationError, match="finite"):
        env.step(np.full(5, np.nan, dtype=np.float32))


def test_unknown_cell_is_refused_with_the_known_ones() -> None:
    with pytest.raises(NotFound, match="pick-and-place"):
        PickEnv("no-such-cell")


BODY = PickSettings(observation="body")


def test_environment_that_tells_the_size_passes_both_checks() -> None:
    env = PickEnv(settings=BODY)
    assert env.observation_space.shape == (N_WITH_BODY,)
    check_env(env, skip_render_check=True)
    pytest.importorskip("stable_baselines3.common.env_checker").check_env(env)


@pytest.mark.parametrize("size", [MEDIAN, percentile_body(95.0), percentile_body(5.0, 40.0)])
def test_observation_ends_with_the_size_of_the_person(size) -> None:
    work = HumanMotionConfig(bodies=(size,))
    env = PickEnv(settings=PickSettings(observation="body", work=work))
    plain = PickEnv(settings=PickSettings(work=work))
    (obs, _), (known, _) = env.reset(seed=2), plain.reset(seed=2)
    floor_z = env.batch.cell.floor_z
    for act in actions(3):
        np.testing.assert_array_equal(obs[N_FEATURES:], size.vector(floor_z).astype(np.float32))
        np.testing.assert_array_equal(obs[:N_FEATURES], known)
        obs, known = env.step(act)[0], plain.step(act)[0]
