"""Every id passes both checkers; those with people equal rows of their batch bit for bit."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env

from app.sim.cells.cell import load_cell
from app.sim.envs import IDS, PEOPLE_IDS
from app.sim.envs.pick import PickEnv
from app.sim.envs.reach import ReachEnv
from app.sim.envs.single_env import SingleEnv
from app.sim.envs.vector_env import BatchVectorEnv
from app.sim.people.human_motion_config import HumanMotionConfig
from app.sim.pick.batch import PickSettings
from app.sim.reach.batch import ReachSettings
from tests.sim.working_people import recorded_work

PEOPLE = {
    "tandem/Pick-v0": ("worker",),
    "tandem/PickWalker-v0": ("walker",),
    "tandem/PickConstant-v0": ("constant",),
    "tandem/PickFixedSpeed-v0": ("fixed-speed",),
    "tandem/PickAlone-v0": (),
    "tandem/Reach-v0": ("walker",),
    "tandem/ReachWorker-v0": ("worker",),
    "tandem/ReachConstant-v0": ("constant",),
    "tandem/ReachFixedSpeed-v0": ("fixed-speed",),
    "tandem/ReachAlone-v0": (),
}
MIX = {"people": ("worker", "walker", "constant", "fixed-speed")}


def short(env_id: str, observation: str) -> PickSettings | ReachSettings:
    """Settings with episodes of 1 s, so that a test sees several."""
    settings = PickSettings if "Pick" in env_id else ReachSettings
    return settings(time_limit_s=1.0, observation=observation)


def actions(n_steps: int, n_envs: int, size: int) -> np.ndarray:
    """Held for ten periods each, so that the robot gets about."""
    held = np.random.default_rng(71).uniform(-1, 1, (n_steps // 10 + 1, n_envs, size))
    return np.repeat(held, 10, axis=0)[:n_steps].astype(np.float32)


def assert_single_equals_row(
    env_id: str,
    settings: PickSettings | ReachSettings,
    row: int,
    n_steps: int = 180,
    **keywords: object,
) -> int:
    """Compare one environment with a row of three; return the episodes seen."""
    many = gymnasium.make_vec(
        env_id, 3, settings=settings, autoreset_mode="SameStep", **keywords
    )
    one = gymnasium.make(env_id, settings=settings, first_env=row, **keywords)
    (expected, _), (obs, _) = many.reset(seed=9), one.reset(seed=9)
    size = many.single_action_space.shape[0]
    n_episodes = 0
    for act in actions(n_steps, 3, size):
        np.testing.assert_array_equal(obs, expected[row])
        expected, rews, terminated, truncated, infos = many.step(act)
        obs, rew, over, late, info = one.step(act[row])
        assert (rew, over, late) == (rews[row], terminated[row], truncated[row])
        if over or late:
            np.testing.assert_array_equal(obs, infos["final_obs"][row])
            assert infos["final_info"]["outcome"][row] == info["outcome"]
            assert (
                infos["final_info"]["episode_number"][row]
                == info["episode_number"]
                == n_episodes
            )
            obs, info = one.reset()
            n_episodes += 1
        assert info == {key: infos[key][row] for key in info}
    return n_episodes


def test_table_of_ids_is_complete() -> None:
    assert set(PEOPLE_IDS) == set(PEOPLE)


@pytest.mark.parametrize("env_id", PEOPLE_IDS)
def test_id_names_who_is_there(env_id: str) -> None:
    env = gymnasium.make(env_id).unwrapped
    assert isinstance(env, SingleEnv)
    assert tuple(person.kind for person in env.batch.cell.people) == PEOPLE[env_id]


@pytest.mark.parametrize("env_id", IDS)
def test_environment_passes_gymnasiums_check(env_id: str) -> None:
    check_env(gymnasium.make(env_id).unwrapped)


@pytest.mark.parametrize("env_id", IDS)
def test_environment_passes_stable_baselines3s_check(env_id: str) -> None:
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    checker.check_env(gymnasium.make(env_id).unwrapped)


@pytest.mark.parametrize("env_id", ["tandem/Pick-v0", "tandem/Reach-v0", "tandem/SortingE0-v0"])
def test_every_episode_can_be_started_again_by_its_number(env_id: str) -> None:
    env, other = (gymnasium.make(env_id).unwrapped for _ in range(2))
    env.reset(seed=3)
    third = [env.reset()[0] for _ in range(3)][-1]
    again, info = other.reset(seed=3, options={"episode": 3})
    np.testing.assert_array_equal(again, third)
    assert info["episode_number"] == 3


@pytest.mark.parametrize(
    ("env_id", "kind"), [("tandem/Pick-v0", PickEnv), ("tandem/Reach-v0", ReachEnv)]
)
def test_registered_id_makes_the_environment_of_its_settings(
    env_id: str, kind: type[SingleEnv]
) -> None:
    env = gymnasium.make(env_id, settings=short(env_id, "features"))
    _, info = env.reset(seed=4)
    assert type(env.unwrapped) is kind
    assert info["time_left_s"] == 1.0
    env.close()


@pytest.mark.parametrize(
    ("env_id", "observation", "late"),
    [
        ("tandem/Pick-v0", "features", False),
        ("tandem/Pick-v0", "body", False),
        ("tandem/Pick-v0", "state", True),
        ("tandem/Reach-v0", "features", False),
        ("tandem/Reach-v0", "state", True),
    ],
)
def test_time_out_truncates_only_where_the_time_left_is_not_observed(
    env_id: str, observation: str, late: bool
) -> None:
    limit_s = 0.1 if "Pick" in env_id else 0.04
    settings = replace(short(env_id, observation), time_limit_s=limit_s)
    env = gymnasium.make(env_id, settings=settings, people=()).unwrapped
    many = gymnasium.make_vec(env_id, 4, settings=settings, people=())
    env.reset(seed=1), many.reset(seed=1)
    still = np.zeros(many.action_space.shape, dtype=np.float32)
    for over in (False, True):
        *_, terminated, truncated, info = env.step(still[0])
        assert (terminated, truncated) == (over and not late, over and late)
        _, _, ends, cuts, _ = many.step(still)
        assert (ends == terminated).all() and (cuts == truncated).all()
    assert info["outcome"] == "timeout"
    with pytest.raises(ResetNeeded, match="reset"):
        env.step(still[0])


@pytest.mark.parametrize("env_id", PEOPLE_IDS)
def test_make_vec_gives_the_batch(env_id: str) -> None:
    assert isinstance(gymnasium.make_vec(env_id, 3), BatchVectorEnv)


@pytest.mark.parametrize("env_id", PEOPLE_IDS)
def test_single_environment_equals_its_row_of_a_batch_bit_for_bit(env_id: str) -> None:
    assert assert_single_equals_row(env_id, short(env_id, "features"), row=1) >= 3


@pytest.mark.parametrize("env_id", ["tandem/Pick-v0", "tandem/Reach-v0"])
def test_any_mix_of_people_equals_its_row_of_a_batch_bit_for_bit(env_id: str) -> None:
    assert assert_single_equals_row(env_id, short(env_id, "state"), row=2, **MIX) >= 3
    env = gymnasium.make(env_id, **MIX).unwrapped
    assert len(env.batch.cell.people) == 4


@pytest.mark.parametrize("people", ["library", "recorded", "yielding", "three"])
def test_whatever_people_do_a_single_environment_equals_its_row_bit_for_bit(
    people: str,
) -> None:
    work = {
        "recorded": recorded_work(load_cell()),
        "yielding": HumanMotionConfig(yielding=1.0),
    }.get(people, HumanMotionConfig())
    settings = PickSettings(time_limit_s=1.0, observation="body", work=work)
    who = {"people": ("worker",) * 3} if people == "three" else {}
    assert assert_single_equals_row("tandem/Pick-v0", settings, 2, 90, **who) >= 3
