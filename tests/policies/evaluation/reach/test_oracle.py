"""Tests of the oracle search over the episodes of ``reach-targets``."""

import numpy as np
import pytest

from app.policies.evaluation.reach import oracle as reach_oracle
from app.policies.evaluation.reach.episodes import run_episodes, target_goals
from app.policies.evaluation.reach.oracle import (
    search_in_stages,
    soonest_arrivals,
    started,
    verdict,
)
from app.policies.evaluation.registry import evaluate
from app.sim.cells.cell import load_cell
from app.sim.reach.batch import ReachSettings, goal_region_of
from app.sim.reach.oracle_search import OracleSearch
from app.sim.scenario.kernels.episode import SUCCESS
from tests.policies.straight_controller import Straight
from tests.policies.untrained import untrained_reach

CELL = load_cell("shared-workspace")
TARGETS = goal_region_of(CELL).targets()
RULES = ReachSettings()


def test_the_first_states_are_those_of_the_episodes():
    goals = target_goals(TARGETS, 530)
    search = OracleSearch(started(CELL, RULES, goals, 6), 1, 600)
    search.simulate_policy(Straight().acts)
    found = run_episodes(CELL, RULES, Straight(), goals, 6)
    np.testing.assert_array_equal(search.resimulations.reached > 0, found.outcome == SUCCESS)


@pytest.fixture
def short(monkeypatch) -> None:
    monkeypatch.setattr(reach_oracle, "SCRIPTED", (6, 6))
    monkeypatch.setattr(reach_oracle, "DISTURBED", 2)
    monkeypatch.setattr(reach_oracle, "LONG", 6)
    monkeypatch.setattr(reach_oracle, "SOONEST_TRIES", 8)


@pytest.mark.usefixtures("short")
def test_every_stage_solves_as_much_or_more():
    goals, rows = target_goals(TARGETS, 54), []
    search = search_in_stages(started(CELL, RULES, goals, 6), Straight(), 1, rows)
    solved = [row["solved"]["mean"] for row in rows]
    assert solved == sorted(solved)
    assert solved[-1] > solved[0] + 0.05
    assert [row["name"] for row in rows] == [
        *("policy", "scripted-6", "scripted-6", "disturbed", "long")
    ]
    never = np.zeros(54, dtype=bool)
    row = verdict(search, never, TARGETS, goals)
    assert row["solvable"]["mean"] + row["undecided"]["mean"] == pytest.approx(1.0)
    assert row["doomed"]["mean"] <= 1.0 - row["solvable"]["mean"] + 1e-9


@pytest.mark.usefixtures("short")
def test_earliest_arrivals_without_people_are_plausible():
    goals = target_goals(TARGETS, 54)
    soonest = soonest_arrivals(CELL, RULES, goals, 6)
    assert (soonest > 0.3).all() and (soonest < 4.0).all()


@pytest.mark.usefixtures("short")
def test_the_protocol_reports_solvable_episodes():
    result = evaluate("reach-oracle", untrained_reach(width=16), episodes=1, seed=6)
    (row,) = result["results"]
    assert (row["n"], result["episodes"]) == (54, 1)  # an episode of each target
    assert row["solvable"]["low"] <= row["solvable"]["mean"] <= row["solvable"]["high"]
    assert result["stages"][0]["solved"]["mean"] <= row["solvable"]["mean"]
    assert result["settings"]["rows"]["oracle"]["start_clearance_m"] == 0.05
