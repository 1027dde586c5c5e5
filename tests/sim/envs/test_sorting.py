"""The sorting environments keep their promises and equal a plain one move by move."""

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded

from app.errors import InvalidInput, NotFound
from app.sim.cells.cell import load_cell
from app.sim.envs import SORTING_IDS
from app.sim.envs.sorting import SortingEnv, SortingVectorEnv
from app.sim.sorting.batch import OUTCOMES, SortingBatch, SortingSettings, fail_of, shape_of
from app.sim.sorting.kernels.reward import SortingWeights
from app.sim.sorting.state import SortingState
from tests.benchmarks.peers.plain_sorting import PlainSorting

LIVELY = SortingSettings(
    disturbed_share=0.3, human_rate=0.1, localisation_rate=0.1, random_map_share=0.5
)


@pytest.mark.parametrize(
    ("env_id", "n_actions"), list(zip(SORTING_IDS, (44, 129), strict=True))
)
def test_ids_make_tasks_of_their_size(env_id: str, n_actions: int) -> None:
    assert gymnasium.make(env_id).action_space.n == n_actions
    many = gymnasium.make_vec(env_id, 3)
    assert isinstance(many, SortingVectorEnv)
    assert many.action_space.nvec.tolist() == [n_actions] * 3


@pytest.mark.parametrize("env_id", SORTING_IDS)
def test_single_environment_equals_its_row_of_a_batch_bit_for_bit(env_id: str) -> None:
    many = gymnasium.make_vec(env_id, 3, settings=LIVELY, autoreset_mode="SameStep")
    one = gymnasium.make(env_id, settings=LIVELY, first_env=1)
    (expected, infos), (obs, info) = many.reset(seed=9), one.reset(seed=9)
    rng, n_episodes = np.random.default_rng(5), 0
    for _ in range(400):
        np.testing.assert_array_equal(obs, expected[1])
        np.testing.assert_array_equal(info["action_mask"], infos["action_mask"][1])
        acts = rng.integers(many.single_action_space.n, size=3)
        expected, rews, over, late, infos = many.step(acts)
        obs, rew, ended, cut, info = one.step(acts[1])
        assert (rew, ended, cut) == (rews[1], over[1], late[1])
        if ended or cut:
            np.testing.assert_array_equal(obs, infos["final_obs"][1])
            assert infos["final_info"]["outcome"][1] == info["outcome"]
            assert infos["final_info"]["episode_number"][1] == n_episodes
            obs, info = one.reset()
            n_episodes += 1
    assert n_episodes >= 4


def test_masks_have_the_forms_of_gymnasium_and_sb3_contrib() -> None:
    env = SortingEnv()
    _, info = env.reset(seed=1)
    assert info["action_mask"].dtype == np.int8 and env.action_masks().dtype == np.bool_
    np.testing.assert_array_equal(info["action_mask"] == 1, env.action_masks())
    for _ in range(20):
        action = env.action_space.sample(info["action_mask"])
        assert env.action_masks()[action]
        *_, over, late, info = env.step(action)
        if over or late:
            _, info = env.reset()


def test_a_random_valid_policy_moves_something_unless_a_pick_fails() -> None:
    env = SortingVectorEnv(16, settings=SortingSettings(horizon_factor=1000.0))
    _, infos = env.reset(seed=2)
    rng = np.random.default_rng(3)
    for _ in range(50):
        acts = np.array([rng.choice(np.flatnonzero(mask)) for mask in infos["action_mask"]])
        *_, infos = env.step(acts)
    np.testing.assert_array_equal(infos["moves"] + infos["failures"], infos["attempts"])


def test_horizon_truncates_and_a_further_step_asks_for_a_reset() -> None:
    env = SortingEnv(settings=SortingSettings(horizon_factor=0.2))
    env.reset(seed=1)
    stuck = env.action_space.n - 1
    ends = [env.step(stuck)[2:] for _ in range(2)]
    assert [end[:2] for end in ends] == [(False, False), (False, True)]
    assert ends[-1][2]["outcome"] == "timeout" and ends[-1][2]["attempts"] == 2
    with pytest.raises(ResetNeeded, match="reset"):
        env.step(stuck)


def test_unknown_cells_cells_without_towers_and_unknown_actions_are_refused() -> None:
    with pytest.raises(NotFound, match="sorting-e0"):
        SortingEnv("no-such-cell")
    with pytest.raises(InvalidInput, match="cluster"):
        SortingEnv("pick-and-place")
    env = SortingEnv()
    env.reset(seed=1)
    with pytest.raises(InvalidInput, match="44"):
        env.step(np.int64(44))


@pytest.mark.parametrize(
    "act", [2.5, float("nan"), 10**30, None, "3", True, [2.0, 3.0], [1j]], ids=repr
)
def test_action_that_is_no_move_is_refused_and_changes_nothing(act: object) -> None:
    env, other = SortingEnv(), SortingEnv()
    env.reset(seed=1), other.reset(seed=1)
    with pytest.raises(InvalidInput, match="act = .* must"):
        env.step(act)
    np.testing.assert_array_equal(env.step(3.0)[0], other.step(np.int64(3))[0])


@pytest.mark.parametrize(
    ("reset", "text"),
    [
        ({"seed": 2**63}, r"seed = 9223372036854775808 must be .* \[0, 2\^63\)"),
        ({"seed": 2**127}, "seed = .* must be"),
        ({"options": {"episode": -1}}, r"options.episode = -1 must be a whole number in \[0"),
        ({"options": {"episode": 1.5}}, "options.episode = 1.5 must"),
        ({"options": {"episode": 2**70}}, "options.episode = .* must"),
        ({"options": {"episode": np.uint64(2**63)}}, "options.episode = .* must"),
        ({"options": {"episode": 2**62}}, r"options.episode = .* must .* \[0, 2\^62\)"),
        ({"options": {"episode": "2"}}, "options.episode = '2' must"),
        ({"options": {"episode": [1, 2, 3, 4]}}, "options.episode = .* a list of . of them"),
    ],
    ids=repr,
)
@pytest.mark.parametrize("kind", [SortingEnv, SortingVectorEnv])
def test_seeds_and_episodes_out_of_range_are_refused_and_start_nothing(
    kind: type[SortingEnv] | type[SortingVectorEnv], reset: dict[str, object], text: str
) -> None:
    env = kind()
    with pytest.raises(InvalidInput, match=text):
        env.reset(**reset)
    with pytest.raises(ResetNeeded):
        env.step(np.zeros(1, dtype=np.int64))


def test_every_row_of_a_vector_environment_starts_its_own_episode() -> None:
    _, infos = SortingVectorEnv(3).reset(seed=1, options={"episode": [4, 0, 2]})
    assert infos["episode_number"].tolist() == [4, 0, 2]


def plain_as(state: SortingState, fail: float) -> PlainSorting:
    """A plain environment in a state, whose picks from the clutter fail as given."""
    k, c = state.clutter.size, len(state.towers)
    env = PlainSorting(np.full(k, fail), c)
    env.reset(seed=0)
    env.clutter[:], env.towers[:], env.goal[:] = state.clutter, state.towers, state.goal
    env.heights = [int(height) for height in state.heights]
    return env


@pytest.mark.parametrize("cell_name", ["sorting-e0", "sorting-e1"])
@pytest.mark.parametrize("fails", [False, True])
def test_plain_environment_gives_the_same_transitions_and_rewards(
    cell_name: str, fails: bool
) -> None:
    cell = load_cell(cell_name)
    shape = shape_of(cell)
    # A pick that succeeds for sure, and, as 1 is not allowed, one that fails as good as surely.
    fail = np.full(shape.n_slots, 0.99 if fails else 0.0)
    # The plain environment has the reward of the thesis' presets.
    weights = SortingWeights(fail=0.05, back=0.05, distance=0.1)
    settings = SortingSettings(disturbed_share=0.5, weights=weights)
    batch = SortingBatch(shape, fail, 8, 4, settings)
    batch.reset()
    rng, seen = np.random.default_rng(6), set()
    for _ in range(45):
        plain = [plain_as(batch.state_of(e), float(fails)) for e in range(8)]
        for e, env in enumerate(plain):
            env.attempts = int(batch.envs.steps[e])
        acts = rng.integers(shape.n_actions, size=8)
        failures = batch.envs.failures.copy()
        result = batch.step(acts, auto_reset=False)
        for e, env in enumerate(plain):
            if fails and acts[e] < shape.n_slots * shape.n_colours:
                if (
                    env.clutter[acts[e] // shape.n_colours]
                    and batch.envs.failures[e] == failures[e]
                ):
                    continue  # the one in a hundred that did not fail
            _, rew, over, late, _ = env.step(acts[e])
            now = batch.state_of(e)
            np.testing.assert_array_equal(env.clutter, now.clutter)
            np.testing.assert_array_equal(env.towers, now.towers)
            assert rew == pytest.approx(result.rew[e], abs=1e-6)
            assert int(result.ended[e]) == (1 if over else 2 if late else 0)
            seen.add(round(rew, 2))
        batch.envs.outcome[:] = OUTCOMES.index("running")
    assert len(seen) > 5


@pytest.mark.parametrize("cell_name", ["sorting-e0", "sorting-e1"])
def test_plain_environment_draws_the_same_kind_of_episodes(cell_name: str) -> None:
    cell = load_cell(cell_name)
    shape = shape_of(cell)
    batch = SortingBatch(shape, fail_of(cell), 4000, 5)
    batch.reset()
    env = PlainSorting(fail_of(cell), shape.n_colours)
    env.reset(seed=5)
    drawn = []
    for _ in range(4000):
        env.reset()
        drawn.append(((env.clutter > 0).sum(), (env.goal > 0).sum()))
    mine = [(batch.envs.clutter > 0).sum(axis=1), (batch.envs.goal > 0).sum(axis=(1, 2))]
    difference = np.array(drawn).mean(axis=0) - np.array(mine).mean(axis=1)
    spread = np.array(drawn).std(axis=0) / np.sqrt(2000)
    assert (np.abs(difference) < 4 * spread).all()
