"""Episodes of the reach scenario: which are played, and how they are counted."""

from dataclasses import replace

import numpy as np
import pytest

from app.policies.evaluation.reach import episodes as reach_episodes
from app.policies.evaluation.reach.episodes import (
    REPORTED_TIME_LEFT_S,
    against,
    play,
    random_goals,
    recheck_contacts,
    target_goals,
)
from app.sim.cells.cell import load_cell
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.scenario.kernels.episode import COLLISION, RUNNING, SUCCESS, TIMEOUT
from tests.policies.straight_controller import Straight

CELL = load_cell("shared-workspace")
TARGETS = CELL.goal_region.targets()
USUAL = ReachSettings()


class Still:
    """Moves nobody, and notes how much time is told."""

    def __init__(self) -> None:
        self.told: list[np.ndarray] = []

    def acts(self, batch: ReachBatch) -> np.ndarray:
        self.told.append(batch.state.time_left.copy())
        return np.zeros((batch.n_envs, 6), dtype=np.float32)


@pytest.fixture(autouse=True)
def few_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reach_episodes, "N_ENVS", 40)


def one_by_one(settings: ReachSettings, goals: np.ndarray, seed: int) -> np.ndarray:
    """The outcome of each episode, each in a batch of its own."""
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


def test_an_episode_is_what_it_is_alone_whatever_is_played_beside_it() -> None:
    goals = target_goals(TARGETS, 90)
    played = play(CELL, USUAL, Straight(), goals, 5)
    np.testing.assert_array_equal(played.outcome, one_by_one(USUAL, goals, 5))
    assert {SUCCESS, COLLISION} <= set(played.outcome.tolist())


def test_fewer_episodes_are_the_first_ones() -> None:
    goals = target_goals(TARGETS, 100)
    every, some = (play(CELL, USUAL, Straight(), goals[:n], 5) for n in (100, 61))
    np.testing.assert_array_equal(every.outcome[:61], some.outcome)
    np.testing.assert_array_equal(every.duration_s[:61], some.duration_s)


def test_a_longer_limit_changes_only_what_would_time_out() -> None:
    goals = target_goals(TARGETS, 100)
    slow = Straight(gain=0.6)
    short = play(CELL, replace(USUAL, time_limit_s=2.0), slow, goals, 5)
    long = play(CELL, replace(USUAL, time_limit_s=9.0), slow, goals, 5)
    ended = short.outcome != TIMEOUT
    assert 0 < ended.sum() < 100
    np.testing.assert_array_equal(long.outcome[ended], short.outcome[ended])
    assert (long.duration_s[~ended] > 2.0 + 1e-9).all()


def test_in_long_episodes_no_more_time_is_told_than_training_had() -> None:
    still = Still()
    played = play(CELL, replace(USUAL, time_limit_s=7.0), still, TARGETS[:40], 5)
    waited = played.outcome == TIMEOUT
    assert waited.any()
    np.testing.assert_allclose(played.duration_s[waited], 7.0)
    told = np.array(still.told)[:, np.flatnonzero(waited)[0]]
    np.testing.assert_allclose(told[: round(2.0 / 0.02) + 1], REPORTED_TIME_LEFT_S)
    np.testing.assert_allclose(told[-1], 0.02)


def test_starts_in_contact_are_those_that_end_at_once() -> None:
    played = play(CELL, replace(USUAL, start="uniform"), Still(), target_goals(TARGETS, 400), 5)
    begun = played.start_m <= 0.0
    assert 4 <= begun.sum() <= 40
    assert (played.outcome[begun] == COLLISION).all()
    assert (played.duration_s[begun] < 0.03).all()
    assert played.begun_in_contact()["mean"] == begun.mean()


def test_random_goals_fill_the_box_and_fewer_are_the_first_ones() -> None:
    low, high = TARGETS.min(axis=0), TARGETS.max(axis=0)
    goals = random_goals(low, high, 2000, 5)
    assert ((goals >= low) & (goals <= high)).all()
    np.testing.assert_allclose(goals.mean(axis=0), 0.5 * (low + high), atol=0.03)
    np.testing.assert_array_equal(goals[:70], random_goals(low, high, 70, 5))
    assert not np.array_equal(goals[:70], random_goals(low, high, 70, 6))


def test_a_row_counts_every_episode_once() -> None:
    goals = target_goals(TARGETS, 100)
    played = play(CELL, USUAL, Straight(), goals, 5)
    row = played.row("straight")
    assert row["n"] == 100
    shares = [row[name]["mean"] for name in ("success", "collision", "timeout")]
    assert sum(shares) == pytest.approx(1.0)
    won = played.outcome == SUCCESS
    assert row["time_to_goal_s"] == pytest.approx(played.duration_s[won].mean())


def test_a_difference_is_paired() -> None:
    goals = target_goals(TARGETS, 100)
    one, other = (
        play(CELL, USUAL, controller, goals, 5) for controller in (Straight(), Still())
    )
    same = against(one, one)
    assert same == {"mean": 0.0, "low": 0.0, "high": 0.0}
    assert against(one, other)["mean"] == pytest.approx((one.outcome == SUCCESS).mean())


def test_the_second_look_at_contacts_finds_none_that_was_missed() -> None:
    found = recheck_contacts(CELL, USUAL, Straight(), target_goals(TARGETS, 12), 5)
    assert found["episodes"] == 12
    assert found["poses"] > 500
    assert found["missed_contacts"] == 0
