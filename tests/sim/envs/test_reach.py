"""The single reach environment: lengths of observations, refusals."""

import pytest

from app.errors import InvalidInput, NotFound
from app.sim.envs.reach import ReachEnv
from app.sim.reach.batch import ReachSettings
from app.sim.reach.kernels.observation import N_FEATURES


@pytest.mark.parametrize(("observation", "size"), [("state", 20), ("features", N_FEATURES)])
def test_both_observations_are_as_long_as_the_data_sheet_says(
    observation: str, size: int
) -> None:
    env = ReachEnv(settings=ReachSettings(observation=observation))
    obs, _ = env.reset(seed=1)
    assert obs.shape == (size,) and env.observation_space.contains(obs)


def test_unknown_cell_and_people_are_refused_with_the_known_ones() -> None:
    with pytest.raises(NotFound, match="shared-workspace"):
        ReachEnv("no-such-cell")
    with pytest.raises(InvalidInput, match="fixed-speed"):
        ReachEnv(people=("ghost",))
