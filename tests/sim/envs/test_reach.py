"""The single reach environment: ends, numbers of episodes, refusals."""

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded

import app.sim.envs  # noqa: F401  (registers the ids)
from app.errors import InvalidInput, NotFound
from app.sim.envs.reach import ReachEnv
from app.sim.reach.batch import ReachSettings
from app.sim.reach.kernels.observation import N_FEATURES


def test_registered_id_takes_settings() -> None:
    env = gymnasium.make("tandem/Reach-v0", settings=ReachSettings(time_limit_s=25.0))
    _, info = env.reset(seed=4)
    assert isinstance(env.unwrapped, ReachEnv)
    assert info["time_left_s"] == 25.0
    env.close()


@pytest.mark.parametrize(("observation", "size"), [("state", 20), ("features", N_FEATURES)])
def test_both_observations_are_as_long_as_the_data_sheet_says(
    observation: str, size: int
) -> None:
    env = ReachEnv(settings=ReachSettings(observation=observation))
    obs, _ = env.reset(seed=1)
    assert obs.shape == (size,) and env.observation_space.contains(obs)


@pytest.mark.parametrize(("observation", "truncates"), [("state", True), ("features", False)])
def test_time_out_ends_and_a_further_step_asks_for_a_reset(
    observation: str, truncates: bool
) -> None:
    env = ReachEnv(
        settings=ReachSettings(time_limit_s=0.04, observation=observation), people=()
    )
    env.reset(seed=1)
    still = np.zeros(6, dtype=np.float32)
    ends = [env.step(still)[2:] for _ in range(2)]
    assert [end[:2] for end in ends] == [(False, False), (not truncates, truncates)]
    assert ends[-1][2]["outcome"] == "timeout"
    with pytest.raises(ResetNeeded, match="reset"):
        env.step(still)


def test_unknown_cell_and_people_are_refused_with_the_known_ones() -> None:
    with pytest.raises(NotFound, match="shared-workspace"):
        ReachEnv("no-such-cell")
    with pytest.raises(InvalidInput, match="fixed-speed"):
        ReachEnv(people=("ghost",))
