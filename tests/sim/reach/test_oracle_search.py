"""Oracle search: resimulations repeat the episodes; solvable episodes are solved."""

from dataclasses import replace

import numpy as np
import pytest

from app.sim.cells.cell import load_cell
from app.sim.reach import oracle_search
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.reach.oracle_search import (
    OracleSearch,
    copy_rows,
    future_cylinders,
    presumably_unsolvable,
)
from app.sim.robot.actions import ActionSettings
from app.sim.scenario.kernels.episode import RUNNING, SUCCESS
from tests.policies.straight_controller import Straight

CELL = load_cell("shared-workspace")
RULES = ReachSettings()
BY_COEFFICIENT = replace(RULES, action=ActionSettings(meaning="coefficient"))
SMALL = 256


def batch_of(n: int, seed: int = 4, rules: ReachSettings = RULES) -> ReachBatch:
    batch = ReachBatch(CELL, n, seed, rules)
    batch.reset()
    return batch


def still(batch: ReachBatch) -> np.ndarray:
    return np.zeros((batch.n_envs, 6), dtype=np.float32)


def test_copied_episode_equals_the_original():
    first, other = batch_of(6), batch_of(4, seed=99)
    rows = np.array([5, 2, 2])
    copy_rows(first.state, rows, other.state, 1)
    controller = Straight()
    for _ in range(100):
        first.step(controller.acts(first), auto_reset=False)
        other.step(controller.acts(other), auto_reset=False)
    np.testing.assert_array_equal(other.state.q[1:], first.state.q[rows])
    np.testing.assert_array_equal(
        other.state.people.cylinders[1:], first.state.people.cylinders[rows]
    )
    np.testing.assert_array_equal(other.state.outcome[1:], first.state.outcome[rows])


def test_resimulated_policy_ends_as_without_the_search():
    batch, controller = batch_of(40), Straight()
    search = OracleSearch(batch, 1, SMALL)
    search.simulate_policy(controller.acts)
    while (batch.state.outcome == RUNNING).any():
        batch.step(controller.acts(batch), auto_reset=False)
    solved = batch.state.outcome == SUCCESS
    assert 5 < solved.sum() < 40
    np.testing.assert_array_equal(search.resimulations.reached > 0, solved)
    np.testing.assert_allclose(
        search.resimulations.soonest[solved], batch.state.elapsed[solved]
    )


def test_resimulations_solve_what_straight_moves_do_not():
    search = OracleSearch(batch_of(40), 1, SMALL)
    search.simulate_policy(Straight().acts)
    before = search.unsolved()
    search.scripted(before, 24)
    after = search.unsolved()
    assert len(before) > 2 * len(after)
    assert set(after) <= set(before)
    assert (search.resimulations.n[before] == 25).all()
    assert (search.resimulations.untouched <= search.resimulations.n).all()


def test_noise_and_detours_change_what_a_policy_does():
    search = OracleSearch(batch_of(20), 1, SMALL)
    search.disturbed(np.arange(20), 8, Straight().acts)
    assert (search.resimulations.n == 8).all()
    assert ((search.resimulations.reached > 0) & (search.resimulations.reached < 8)).any()


def test_scripts_are_the_same_whatever_actions_mean():
    found = []
    for rules in (RULES, BY_COEFFICIENT):
        search = OracleSearch(batch_of(20, rules=rules), 1, SMALL)
        search.scripted(np.arange(20), 4)
        found.append(search.resimulations.reached)
    assert found[0].any()
    np.testing.assert_array_equal(*found)


def test_policies_of_coefficients_make_no_detours(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(oracle_search, "SIGMAS", (0.0,))
    search = OracleSearch(batch_of(20, rules=BY_COEFFICIENT), 1, SMALL)
    search.disturbed(np.arange(20), 8, Straight().acts)
    assert set(search.resimulations.untouched.tolist()) == {0, 8}


def test_the_search_leaves_the_episodes_as_they_were():
    batch = batch_of(10)
    q, people = batch.state.q.copy(), batch.state.people.cylinders.copy()
    OracleSearch(batch, 1, SMALL).scripted(np.arange(10), 2)
    np.testing.assert_array_equal(batch.state.q, q)
    np.testing.assert_array_equal(batch.state.people.cylinders, people)


@pytest.mark.parametrize("rest", [0.0, 0.5])
def test_a_walk_is_what_the_replays_meet(rest: float):
    batch, played = batch_of(5), batch_of(5)
    walks = future_cylinders(batch, 50)
    for k in range(50):
        np.testing.assert_array_equal(walks[k], played.state.people.cylinders)
        played.state.outcome[:] = RUNNING
        played.step(still(played) + np.float32(rest), auto_reset=False)


def test_what_is_covered_for_good_or_pinned_at_the_base_is_never_possible():
    goals = np.tile([0.0, 0.8, 0.3], (4, 1))
    walks = np.zeros((101, 4, 1, 3))
    walks[:, 0, 0] = (0.0, 0.9, 0.4)
    walks[:, 1, 0] = (0.0, 0.9, 0.4)
    walks[60:, 1, 0] = (0.0, 3.0, 0.4)
    walks[:, 2, 0] = (0.0, 3.0, 0.4)
    walks[20:30, 2, 0] = (0.0, 0.4, 0.4)
    walks[:, 3, 0] = (0.0, 3.0, 0.4)
    walks[60:, 3, 0] = (0.0, 0.4, 0.4)
    soonest = np.full(4, 1.0)
    found = presumably_unsolvable(walks, goals, soonest, 0.02, 0.04, 0.08)
    assert found.tolist() == [True, False, True, False]


def test_what_was_never_possible_is_never_solved():
    batch = batch_of(300)
    search = OracleSearch(batch, 1, 1024)
    search.scripted(np.arange(300), 12)
    walks = future_cylinders(batch_of(300), 250)
    soonest = np.full(300, 0.5)
    never = presumably_unsolvable(walks, batch.state.goal, soonest, CELL.robot.dt, 0.04, 0.08)
    assert not (never & (search.resimulations.reached > 0)).any()
