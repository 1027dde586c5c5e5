"""Tests of reach episodes: which are run, and how they are counted."""

from collections.abc import Generator
from dataclasses import replace

import numpy as np
import pytest

from app.policies.evaluation.reach import episodes as reach_episodes
from app.policies.evaluation.reach.episodes import (
    MAX_TIME_LEFT_S,
    ReachEpisodes,
    against,
    random_goals,
    recheck_contacts,
    run_episodes,
    target_goals,
)
from app.sim.cells.cell import load_cell
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.reach.recipe_rules import BlockedRules
from app.sim.scenario.kernels.episode import COLLISION, RUNNING, SUCCESS, TIMEOUT
from tests.policies.straight_controller import Straight

CELL = load_cell("shared-workspace")
TARGETS = CELL.goal_region.targets()
USUAL = ReachSettings()


class StillController:
    """Controller without motion that records the observed remaining time."""

    def __init__(self) -> None:
        self.shown: list[np.ndarray] = []

    def acts(self, batch: ReachBatch) -> np.ndarray:
        self.shown.append(batch.state.time_left.copy())
        return np.zeros((batch.n_envs, 6), dtype=np.float32)


@pytest.fixture(autouse=True, scope="module")
def few_rows() -> Generator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reach_episodes, "N_ENVS", 40)
        yield


@pytest.fixture(scope="module")
def straight() -> ReachEpisodes:
    """Episodes of a robot that moves straight to its goal."""
    return run_episodes(CELL, USUAL, Straight(), target_goals(TARGETS, 100), 5)


def one_by_one(settings: ReachSettings, goals: np.ndarray, seed: int) -> np.ndarray:
    """Return the outcome of each episode, run in a batch of its own."""
    found = []
    for i, goal in enumerate(goals):
        batch = ReachBatch(CELL, 1, seed, settings, first_env=i % 40)
        batch.state.episode[:] = i // 40
        batch.restart()
        batch.set_goals(np.arange(1), goal[None])
        while batch.state.outcome[0] == RUNNING:
            batch.step(Straight().acts(batch), auto_reset=False)
        found.append(batch.state.outcome[0])
    return np.array(found)


def test_an_episode_does_not_depend_on_the_other_episodes_of_a_batch(
    straight: ReachEpisodes,
) -> None:
    alone = one_by_one(USUAL, straight.goals[:90], 5)
    np.testing.assert_array_equal(straight.outcome[:90], alone)
    assert {SUCCESS, COLLISION} <= set(alone.tolist())


def test_fewer_episodes_are_the_first_ones(straight: ReachEpisodes) -> None:
    some = run_episodes(CELL, USUAL, Straight(), straight.goals[:61], 5)
    np.testing.assert_array_equal(straight.outcome[:61], some.outcome)
    np.testing.assert_array_equal(straight.duration_s[:61], some.duration_s)


def test_a_longer_limit_changes_only_what_would_time_out() -> None:
    goals = target_goals(TARGETS, 100)
    slow = Straight(gain=0.6)
    short = run_episodes(CELL, replace(USUAL, time_limit_s=2.0), slow, goals, 5)
    long = run_episodes(CELL, replace(USUAL, time_limit_s=9.0), slow, goals, 5)
    ended = short.outcome != TIMEOUT
    assert 0 < ended.sum() < 100
    np.testing.assert_array_equal(long.outcome[ended], short.outcome[ended])
    assert (long.duration_s[~ended] > 2.0 + 1e-9).all()


def test_long_episodes_show_no_more_remaining_time_than_training() -> None:
    still = StillController()
    found = run_episodes(CELL, replace(USUAL, time_limit_s=7.0), still, TARGETS[:40], 5)
    waited = found.outcome == TIMEOUT
    assert waited.any()
    np.testing.assert_allclose(found.duration_s[waited], 7.0)
    shown = np.array(still.shown)[:, np.flatnonzero(waited)[0]]
    np.testing.assert_allclose(shown[: round(2.0 / 0.02) + 1], MAX_TIME_LEFT_S)
    np.testing.assert_allclose(shown[-1], 0.02)


def test_starts_in_contact_are_those_that_end_at_once() -> None:
    found = run_episodes(
        CELL, replace(USUAL, start="uniform"), StillController(), target_goals(TARGETS, 400), 5
    )
    in_contact = found.start_m <= 0.0
    assert 4 <= in_contact.sum() <= 40
    assert (found.outcome[in_contact] == COLLISION).all()
    assert (found.duration_s[in_contact] < 0.03).all()
    assert found.initial_contact()["mean"] == in_contact.mean()


def test_random_goals_fill_the_box_and_fewer_are_the_first_ones() -> None:
    low, high = TARGETS.min(axis=0), TARGETS.max(axis=0)
    goals = random_goals(CELL, 2000, 5)
    assert ((goals >= low) & (goals <= high)).all()
    np.testing.assert_allclose(goals.mean(axis=0), 0.5 * (low + high), atol=0.03)
    np.testing.assert_array_equal(goals[:70], random_goals(CELL, 70, 5))
    assert not np.array_equal(goals[:70], random_goals(CELL, 70, 6))


def test_a_row_counts_every_episode_once(straight: ReachEpisodes) -> None:
    row = straight.row("straight")
    assert row["n"] == 100
    shares = [row[name]["mean"] for name in ("success", "collision", "timeout")]
    assert sum(shares) == pytest.approx(1.0)
    won = straight.outcome == SUCCESS
    assert row["time_to_goal_s"] == pytest.approx(straight.duration_s[won].mean())


def test_a_difference_is_paired(straight: ReachEpisodes) -> None:
    still = run_episodes(CELL, USUAL, StillController(), straight.goals, 5)
    assert against(straight, straight) == {"mean": 0.0, "low": 0.0, "high": 0.0}
    won = (straight.outcome == SUCCESS).mean()
    assert against(straight, still)["mean"] == pytest.approx(won)


def test_the_recheck_finds_no_missed_contact() -> None:
    found = recheck_contacts(CELL, USUAL, Straight(), target_goals(TARGETS, 12), 5)
    assert found["episodes"] == 12
    assert found["poses"] > 500
    assert found["missed_contacts"] == 0


def test_contacts_that_block_the_arm_are_not_missed() -> None:
    rules = replace(USUAL, blocked=BlockedRules(), collision_ends=False)
    found = recheck_contacts(CELL, rules, Straight(), target_goals(TARGETS, 30), 5)
    assert found["poses"] > 1000
    assert found["missed_contacts"] == 0
