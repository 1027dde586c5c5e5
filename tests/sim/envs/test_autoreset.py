"""All autoreset modes and step limits do what Gymnasium's own vector environments do."""

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv
from gymnasium.wrappers.vector import (
    NormalizeObservation,
    NormalizeReward,
    RecordEpisodeStatistics,
)

import app.sim.envs  # noqa: F401  (registers the ids)
from app.errors import InvalidInput
from app.sim.pick.batch import PickSettings
from app.sim.reach.batch import ReachSettings
from app.sim.sorting.batch import SortingSettings

N = 3
MODES = tuple(mode.value for mode in AutoresetMode)
SHORT: dict[str, dict[str, Any]] = {
    "tandem/Pick-v0": {"settings": PickSettings(time_limit_s=0.5, start="uniform")},
    "tandem/Reach-v0": {"settings": ReachSettings(time_limit_s=0.4, start="uniform")},
    "tandem/SortingE0-v0": {"settings": SortingSettings(horizon_factor=0.6, human_rate=0.1)},
}
Maker = Callable[[], gymnasium.Env[Any, Any]]


def reference(env_id: str, mode: str, limit: int | None) -> SyncVectorEnv:
    """Single environments side by side, as Gymnasium does it."""

    def maker(row: int) -> Maker:
        return lambda: gymnasium.make(
            env_id, max_episode_steps=limit, first_env=row, **SHORT[env_id]
        )

    return SyncVectorEnv([maker(row) for row in range(N)], autoreset_mode=mode)


def assert_same_infos(found: dict[str, Any], expected: dict[str, Any]) -> None:
    assert set(found) == set(expected)
    for name, value in expected.items():
        if isinstance(value, dict):
            assert_same_infos(found[name], value)
        elif name == "final_obs":
            for one, other in zip(found[name], value, strict=True):
                np.testing.assert_array_equal(one, other)
        else:
            np.testing.assert_array_equal(found[name], value)


@pytest.mark.parametrize("limit", [None, 7])
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("env_id", SHORT)
def test_batch_equals_single_environments_side_by_side(
    env_id: str, mode: str, limit: int | None
) -> None:
    kind: dict[str, Any] = SHORT[env_id] | {"max_episode_steps": limit}
    mine = gymnasium.make_vec(env_id, N, autoreset_mode=mode, **kind)
    theirs = reference(env_id, mode, limit)
    assert mine.metadata["autoreset_mode"] is AutoresetMode(mode)
    (obs, infos), (expected, marked) = mine.reset(seed=4), theirs.reset(seed=[4] * N)
    mine.action_space.seed(1)
    ends = 0
    for _ in range(80):
        np.testing.assert_array_equal(obs, expected)
        assert_same_infos(infos, marked)
        act = mine.action_space.sample()
        obs, *rest, infos = mine.step(act)
        expected, *others, marked = theirs.step(act)
        for one, other in zip(rest, others, strict=True):
            np.testing.assert_array_equal(one, other)
        done = rest[1] | rest[2]
        ends += int(done.sum())
        if mode == "Disabled" and done.any():
            np.testing.assert_array_equal(obs, expected)
            obs, _ = mine.reset(options={"reset_mask": done})
            expected, _ = theirs.reset(options={"reset_mask": done.copy()})
            infos, marked = {}, {}
    assert ends > 2 * N


def test_default_is_gymnasiums() -> None:
    env = gymnasium.make_vec("tandem/Reach-v0", 2)
    assert env.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP


def batch(**keywords: Any) -> VectorEnv[Any, Any, Any]:
    return gymnasium.make_vec("tandem/Reach-v0", N, **SHORT["tandem/Reach-v0"], **keywords)


@pytest.mark.parametrize("value", [1.0, np.nan])
def test_next_step_ignores_the_action_where_an_episode_starts(value: float) -> None:
    env = batch(max_episode_steps=1)
    env.reset(seed=2)
    assert env.step(np.zeros((N, 6), np.float32))[3].all()
    first, rew, over, late, infos = env.step(np.full((N, 6), value, np.float32))
    again, _ = batch().reset(seed=2, options={"episode": 1})
    np.testing.assert_array_equal(first, again)
    assert not rew.any() and not over.any() and not late.any()
    assert list(infos["episode_number"]) == [1] * N


def test_next_step_ignores_the_action_of_some_environments_only() -> None:
    env = gymnasium.make_vec("tandem/SortingE0-v0", 2, max_episode_steps=2)
    env.reset(seed=1)
    env.step(np.array([0, 0]))
    env.reset(options={"reset_mask": np.array([False, True])})
    assert list(env.step(np.array([0, 0]))[3]) == [True, False]
    with pytest.raises(InvalidInput, match="act = .* must lie"):
        env.step(np.array([0, -1]))
    assert list(env.step(np.array([-1, 0]))[4]["episode_number"]) == [1, 1]


def test_disabled_asks_for_a_reset_of_the_environments_that_ended() -> None:
    env = batch(autoreset_mode="Disabled", max_episode_steps=2)
    env.reset(seed=2)
    act = np.zeros((N, 6), np.float32)
    env.step(act)
    env.reset(options={"reset_mask": np.array([True, False, False])})
    *_, late, _ = env.step(act)
    assert late.tolist() == [False, True, True]
    with pytest.raises(ResetNeeded, match="1, 2.*reset_mask"):
        env.step(act)
    obs, infos = env.reset(options={"reset_mask": late})
    assert infos["episode_number"].tolist() == [1, 1, 1]
    assert infos["_episode_number"].tolist() == [False, True, True]
    assert env.observation_space.contains(obs)
    env.step(act)


@pytest.mark.parametrize(
    ("mask", "word"),
    [
        (np.zeros(N, dtype=np.bool_), "at least one"),
        (np.ones(N), "must be bool"),
        (np.ones(N + 1, dtype=np.bool_), "shape"),
        (True, "shape"),
    ],
)
def test_masks_that_are_none_are_refused(mask: Any, word: str) -> None:
    env = batch(autoreset_mode="Disabled")
    env.reset(seed=1)
    with pytest.raises(InvalidInput, match=word):
        env.reset(options={"reset_mask": mask})


def test_one_seed_is_for_all_environments() -> None:
    env, some = batch(autoreset_mode="Disabled"), np.array([True, False, True])
    with pytest.raises(ResetNeeded, match="without reset_mask"):
        env.reset(options={"reset_mask": some})
    env.reset(seed=1)
    with pytest.raises(InvalidInput, match="one seed"):
        env.reset(seed=2, options={"reset_mask": some})


@pytest.mark.parametrize("limit", [0, -2, 1.5, True, "5"])
def test_limits_that_are_none_are_refused(limit: Any) -> None:
    with pytest.raises(InvalidInput, match="max_episode_steps"):
        batch(max_episode_steps=limit)


@pytest.mark.parametrize("mode", ["same_step", "", None, 3])
def test_unknown_modes_are_refused_with_the_choices(mode: Any) -> None:
    with pytest.raises(InvalidInput, match="NextStep, SameStep, Disabled"):
        batch(autoreset_mode=mode)


@pytest.mark.parametrize("env_id", SHORT)
def test_single_environments_take_a_limit(env_id: str) -> None:
    env = gymnasium.make(env_id, max_episode_steps=2)
    env.reset(seed=2)
    still = env.action_space.sample() * 0
    assert [env.step(still)[3] for _ in range(2)] == [False, True]


def test_normalisation_and_statistics_work_on_the_batch() -> None:
    env = NormalizeReward(NormalizeObservation(RecordEpisodeStatistics(batch())))
    obs, _ = env.reset(seed=3)
    env.action_space.seed(1)
    lengths: list[int] = []
    for _ in range(90):
        obs, rew, over, late, infos = env.step(env.action_space.sample())
        assert np.isfinite(obs).all() and np.isfinite(rew).all()
        if (over | late).any():
            lengths += infos["episode"]["l"][over | late].tolist()
    assert len(lengths) >= 3 * N and max(lengths) == 20


@pytest.mark.parametrize("mode", MODES)
def test_statistics_count_every_step_of_an_episode_once(mode: str) -> None:
    env = RecordEpisodeStatistics(batch(autoreset_mode=mode, max_episode_steps=5))
    env.reset(seed=3)
    for _ in range(30):
        *_, over, late, infos = env.step(np.zeros((N, 6), np.float32))
        if (over | late).any():
            assert infos["episode"]["l"][late].tolist() == [5] * int(late.sum())
            if mode == "Disabled":
                env.reset(options={"reset_mask": over | late})
    assert env.episode_count >= 4 * N
