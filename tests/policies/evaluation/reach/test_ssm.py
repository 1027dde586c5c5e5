"""Tests of the comparison of policies and planners under the safety layer."""

from dataclasses import replace

import numpy as np
import pytest

from app.policies.checkpoints import pretrained
from app.policies.evaluation.reach import ssm as reach_ssm
from app.policies.evaluation.reach.ssm_crossings import (
    DEFAULT_SETTINGS,
    PLANNERS,
    Comparison,
    ComparisonSettings,
    best_resimulations,
)
from app.policies.evaluation.reach.ssm_rows import against, crossing_row
from app.policies.evaluation.registry import evaluate
from app.sim.cells.cell import load_cell
from app.sim.planning.ompl_planners import PlanSettings
from app.sim.reach.batch import ReachSettings
from app.sim.reach.crossings import crossings
from app.sim.safety.layer import safety_settings
from app.sim.scenario.monitoring import selected
from tests.policies.straight_controller import Straight
from tests.sim.recorded_motion import recorded

CELL = load_cell("shared-workspace")
LIMIT_S = DEFAULT_SETTINGS.time_limit_s


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    return Comparison(CELL, crossings(CELL, 6), ReachSettings(), safety_settings(CELL), seed=1)


@pytest.fixture(scope="module")
def straight(comparison):
    return comparison.policy(Straight())


def test_every_run_counts_and_the_layer_keeps_every_link_in_motion_apart(straight):
    row = crossing_row("policy", straight.episodes, LIMIT_S)
    assert row["n"] == 6
    assert row["contacts_moving"] == 0
    assert row["contacts"] == row["contacts_at_rest"]
    late = 6 - int(straight.episodes.arrived.sum())
    total = straight.episodes.seconds[straight.episodes.arrived].sum() + late * LIMIT_S
    assert row["time_capped_s"]["mean"] == pytest.approx(total / 6)
    assert row["below_half_s"]["mean"] >= row["stopped_s"]["mean"] > 0.0
    assert row["stopped_s"]["mean"] >= row["standstill_stopped_s"]["mean"] > 0.0
    assert row["never_at_standstill"]["mean"] >= row["never_stopped"]["mean"]


def test_the_overrides_are_those_counted(straight):
    for number, overrides in enumerate(straight.overrides):
        assert (overrides <= 0.0).sum() * 0.02 == pytest.approx(
            straight.episodes.stopped_s[number]
        )
        assert len(overrides) * 0.02 == pytest.approx(straight.episodes.seconds[number])


def test_without_people_the_robot_is_never_slowed(comparison):
    runs = comparison.policy(Straight(), no_person=True).episodes
    assert runs.arrived.all()
    assert crossing_row("policy-no-person", runs, LIMIT_S)["never_stopped"]["mean"] == 1.0


def test_the_oracle_takes_the_earliest_run_without_contact(comparison, straight):
    found = best_resimulations(comparison, 12, np.random.default_rng(2))
    best, free = found["oracle"], found["oracle-least-stopped"]
    assert free.arrived.all()
    assert (free.stopped_s <= best.stopped_s + 1e-3 * best.seconds + 1e-9).all()
    assert free.stopped_s.sum() < best.stopped_s.sum()
    undisturbed = comparison.policy(Straight(), no_person=True).episodes
    assert best.arrived.all() and not best.touched_at_rest.any()
    assert straight.episodes.touched_at_rest.any()
    assert (best.seconds > 0.7 * undisturbed.seconds).all()


def test_a_saving_is_paired_and_counts_runs_that_do_not_arrive(straight):
    same = against(straight.episodes, straight.episodes, LIMIT_S)
    assert same["all"]["saved_s"]["mean"] == 0.0
    assert same["all"]["n"] == 6
    half = selected(straight.episodes, np.arange(3))
    assert against(half, half, LIMIT_S)["all"]["n"] == 3
    every = np.ones(6, dtype=bool)
    fast = replace(straight.episodes, arrived=every, seconds=np.arange(1.0, 7.0))
    slow = replace(fast, seconds=4.0 * fast.seconds)
    share = against(fast, slow, LIMIT_S)["all"]["share"]
    assert share == pytest.approx({"mean": 0.75, "low": 0.75, "high": 0.75})


def test_the_protocol_runs_policy_planners_recordings_and_random_episodes(monkeypatch):
    short = PlanSettings(planner="rrt-star", budget_s=0.02)
    few = {
        name: replace(PLANNERS[name], plan=short)
        for name in ("rrtstar-once", "replan-every-cycle")
    }
    settings = ComparisonSettings(
        planners=few, without_people=few["rrtstar-once"], n_resimulations=4, time_limit_s=3.0
    )
    monkeypatch.setattr(reach_ssm, "SETTINGS", settings)
    monkeypatch.setattr(reach_ssm, "RANDOM_S", 0.5)
    monkeypatch.setattr(reach_ssm, "N_CROSSINGS", 1)
    reported = []
    result = evaluate(
        "reach-ssm",
        pretrained.load("reach"),
        episodes=2,
        seed=3,
        motions=[recorded(4.0, walk=2.4, turn=0.0)],
        on_row=lambda *row: reported.append(row),
    )
    names = [row["name"] for row in result["results"]]
    assert names[:4] == ["policy", "policy-rollout", "rrtstar-once", "replan-every-cycle"]
    assert {
        "policy-recorded",
        "policy-directed",
        "policy-rollout-ssm-agnostic-directed",
    } <= set(names)
    assert (
        "policy-rollout-ssm-agnostic" not in names
        and "policy-rollout-recorded-directed" in names
    )
    assert names[-3:] == ["random", "random-still", "random-directed"]
    assert [total for _, total, _ in reported] == [len(names)] * len(names)
    assert all(
        row["contacts_moving"] == 0 for row in result["results"] if "no-ssm" not in row["name"]
    )
    assert (result["episodes"], result["settings"]["crossings"]) == (2, 1)
    assert {
        f"{mine}-recorded against replan-every-cycle-recorded" for mine in names[:2]
    } <= set(result["paired"])
    assert "policy-rollout-directed against replan-every-cycle-directed" in result["paired"]
    assert len(result["seconds"]["worst-case"]["policy-rollout"]) == 1
    assert set(result["example"]) == {"worst-case", "directed"}
