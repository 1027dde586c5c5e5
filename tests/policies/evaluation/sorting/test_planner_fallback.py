"""Tests that the batched progress monitor agrees with the monitor of one task."""

import numpy as np
import pytest

from app.policies.evaluation.sorting.benchmark_tasks import start_test
from app.policies.evaluation.sorting.episodes import (
    ENDLESS,
    ScriptedInterferences,
    greedy,
    run_episodes,
)
from app.policies.evaluation.sorting.planner_fallback import state_keys
from app.sim.sorting.batch import SortingBatch, SortingSettings, apply
from app.sim.sorting.benchmark_tasks import sorting_test
from app.sim.sorting.planner import solve
from app.sim.sorting.progress_monitor import (
    ProgressMonitor,
    expect_state,
    observe_transition,
    state_key,
)
from app.sim.sorting.state import SortingShape
from tests.policies.evaluation.sorting_players import at_random, exactly, state_in

SHAPE = SortingShape(n_slots=10, n_colours=2)
FAIL = np.array([0.0, 0.4, 0.1, 0.2, 0.0, 0.3, 0.4, 0.0, 0.1, 0.2])
POLICY = "a" * 64


class Followed(SortingBatch):
    """A batch that keeps the record of each of its tasks, one by one."""

    def follow(self) -> None:
        self.records: dict[int, ProgressMonitor] = {}
        self.asked: set[int] = set()
        self.verdicts: list[tuple[bool, bool]] = []

    def step(self, act, *, auto_reset=True):
        for e in np.flatnonzero(self.envs.outcome == 0).tolist():
            state = self.state_of(e)
            plan = solve(state, self.shape)
            record = observe_transition(
                self.records.get(e), state_key(state), plan.attempts, POLICY
            )
            self.verdicts.append((record.planner_fallback is not None, e not in self.asked))
            move = self.shape.move_of(int(act[e]))
            risk = state.fail[move.pick] if move.pick < self.shape.n_slots else 0.0
            after = state_key(apply(state, self.shape, move))
            self.records[e] = expect_state(record, after, can_fail=bool(risk > 0.0))
        self.asked.clear()
        return super().step(act, auto_reset=auto_reset)


def partly_at_random(seed: int):
    """Return values that are the planner's more often than not."""
    draws = at_random(SHAPE, seed)
    rng = np.random.default_rng(seed)

    def values(obs):
        q = draws(obs)
        for row, one in zip(q, obs, strict=True):
            if rng.random() < 0.6:
                row[exactly(state_in(one, SHAPE), SHAPE)] = 2.0
        return q

    return values


@pytest.mark.parametrize("name", ["test-2", "test-4", "test-5"])
def test_every_verdict_is_that_of_the_rule_for_one_task(name):
    n, test, choose = 40, sorting_test(name), greedy(partly_at_random(3))
    batch = Followed(SHAPE, FAIL, n, 7, SortingSettings(horizon_factor=ENDLESS))
    start_test(batch, test, FAIL, 7)
    batch.follow()

    def asked(rows, which):
        batch.asked.update(which.tolist())
        return choose(rows, which)

    found = run_episodes(batch, asked, script=ScriptedInterferences(test, n, 7), fallback=True)
    single, together = np.array(batch.verdicts).T
    assert np.array_equal(single, together)
    assert 0 < single.sum() < len(single)
    assert found.planner_fallback.any()


def test_different_states_have_different_keys():
    batch = SortingBatch(SHAPE, FAIL, 3000, 2, SortingSettings(disturbed_share=1.0))
    batch.reset()
    envs = batch.envs
    keys = state_keys(envs, np.arange(3000))
    objects = np.concatenate([envs.clutter, envs.towers.reshape(3000, -1)], axis=1)
    assert len(np.unique(keys)) == len(np.unique(objects, axis=0))
