"""Full sorting tasks beside a person: symbolic states, order rules and their execution."""

from dataclasses import replace

import numpy as np
import pytest

from app.policies.checkpoints import pretrained
from app.policies.evaluation.pick.episodes import settings_for
from app.policies.evaluation.rows import EvaluationRequest
from app.policies.evaluation.sorting import order_rules, people
from app.policies.evaluation.sorting.order_rules import OrderView
from app.policies.evaluation.sorting.people import (
    CellCondition,
    SortingBesidePeople,
    run_sorting_people,
)
from app.policies.evaluation.sorting.task_states import NOTHING, TaskStates
from app.policies.inference.value_networks import ValueNetworks, pick_preset_of
from app.sim.cells.cell import load_cell
from app.sim.robot.actions import ActionSettings
from app.sim.scenario.kernels.episode import RUNNING, TIMEOUT, UNFEASIBLE
from app.sim.sorting.planner import solve

CELL = load_cell("sorting-e0")


@pytest.fixture(autouse=True)
def few_objects(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(people, "N_OBJECTS", 4)


def view(values: list[float], distances: list[float], chosen: int) -> OrderView:
    return OrderView(
        values=np.array([values], dtype=np.float32),
        distances=np.array([distances]),
        chosen=np.array([chosen]),
    )


def test_planner_s_move_is_the_first_target() -> None:
    assert order_rules.planner(view([0.0, 1.0], [1.0, 0.5], 1))[0] == 0


def test_nearest_target_at_the_start_of_a_motion_is_kept() -> None:
    assert order_rules.nearest(view([0.0, 0.0], [1.0, 0.5], -1))[0] == 1
    assert order_rules.nearest(view([0.0, 0.0], [1.0, 0.5], 0))[0] == 0


@pytest.mark.parametrize(
    ("chosen", "gain", "expected"), [(-1, 0.1, 1), (0, 0.4, 0), (0, 0.6, 1)]
)
def test_critic_changes_the_target_for_a_gain_above_the_hysteresis(
    chosen: int, gain: float, expected: int
) -> None:
    assert order_rules.critic(view([1.0, 1.0 + gain], [0.0, 0.0], chosen))[0] == expected


def test_tasks_follow_shortest_plans_whatever_targets_are_chosen() -> None:
    tasks, rng = TaskStates(CELL, 6, 10, seed=5), np.random.default_rng(0)
    for e in range(6):
        fewest, over = solve(tasks.state(e), tasks.shape).moves, False
        while not over:
            over = tasks.advance(e, int(rng.integers(len(tasks.targets[e]))))
        assert tasks.state(e).solved
        assert tasks.moves[e] == fewest == 10
        assert tasks.attempts[e] >= 10
    tasks.begin()
    assert (tasks.held == NOTHING).all() and not tasks.state(0).solved
    assert (tasks.attempts == 0).all()


def test_targets_are_the_objects_and_then_the_place_of_the_held_one() -> None:
    tasks = TaskStates(CELL, 1, 10, seed=5)
    picks = tasks.targets[0]
    assert len(picks) > 1 and (picks < tasks.shape.n_slots).all()
    while tasks.held[0] == NOTHING:
        tasks.advance(0, 0)
    assert tasks.held[0] == picks[0]
    towers = [station.points()[0].tolist() for station in CELL.stations_of("cluster")]
    assert [tasks.points[one].tolist() in towers for one in tasks.targets[0]] == [True]


def bench(n: int, *, active: bool = True) -> SortingBesidePeople:
    checkpoint = pretrained.load("pick")
    settings = settings_for((1, 1), pick_preset_of(checkpoint))
    networks = ValueNetworks(checkpoint)
    condition = CellCondition(active=active)
    return SortingBesidePeople(networks, CELL, settings, n, 3, condition)


def test_same_rule_repeats_its_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(people, "N_OBJECTS", 2)
    ran = bench(3)
    first, second = ran.run(order_rules.nearest), ran.run(order_rules.nearest)
    assert first.finished.all() and first.stopped.any()
    np.testing.assert_array_equal(first.cycle_s, second.cycle_s)
    np.testing.assert_array_equal(first.resting, second.resting)


def test_contact_of_the_moving_robot_stops_it_until_the_person_is_away() -> None:
    ran = bench(2)
    ran._begin()
    ran.batch.state.qd[:] = 0.3
    ran._stop(0)
    assert ran._moving.tolist() == [1, 0]
    assert not ran.batch.state.qd[0].any() and ran._waiting.tolist() == [True, False]
    for clearance, waiting in ((0.01, True), (0.2, False)):
        ran.batch.state.clear[0, 0] = clearance
        ran._release()
        assert ran._waiting[0] == waiting


def test_touch_of_the_robot_at_standstill_counts_once() -> None:
    ran = bench(2)
    ran._begin()
    rows = np.arange(2)
    for touched in ([True, False], [True, False], [False, False], [True, True]):
        ran._count_touches(rows, np.array(touched))
    assert ran._resting.tolist() == [2, 1]


def test_safety_layer_stops_the_robot_and_prevents_contacts_of_the_moving_one() -> None:
    runs = [bench(3, active=active).run(order_rules.planner) for active in (True, False)]
    assert [run.finished.all() for run in runs] == [True, True]
    assert runs[0].moving.sum() == 0 < runs[1].moving.sum()
    assert (runs[0].stopped > 0.0).all() and not runs[1].stopped.any()
    assert runs[0].cycle_s.mean() > runs[1].cycle_s.mean()


def test_unfeasible_motion_begins_again_as_a_late_one_does() -> None:
    ran = bench(2)
    ran._begin()
    ran.batch.state.outcome[:] = [UNFEASIBLE, TIMEOUT]
    ran._settle(np.arange(2))
    assert ran._late.tolist() == [1, 1]
    assert (ran.batch.state.outcome == RUNNING).all()


def test_straight_moves_are_the_same_whatever_actions_mean(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(people, "LIMIT_S", 6.0)
    checkpoint = pretrained.load("pick")
    usual = settings_for((1, 1), pick_preset_of(checkpoint))
    other = replace(usual, action=ActionSettings(meaning="coefficient"))
    straight, networks = CellCondition(straight=True), ValueNetworks(checkpoint)
    first, second = (
        SortingBesidePeople(networks, CELL, each, 1, 3, straight) for each in (usual, other)
    )
    start = first.batch.state.q.copy()
    first.run(order_rules.nearest)
    second.run(order_rules.nearest)
    assert np.abs(first.batch.state.q - start).max() > 0.1
    np.testing.assert_array_equal(first.batch.state.q, second.batch.state.q)


def test_task_that_is_cut_off_has_failed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(people, "LIMIT_S", 5.0)
    cut = bench(2).run(order_rules.planner)
    assert not cut.finished.any()
    assert (cut.cycle_s == 5.0).all()
    assert cut.row("planner")["cycle_time_s"] is None


def test_result_compares_the_rules_on_the_same_tasks(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(people, "N_OBJECTS", 2)
    reported = []
    request = EvaluationRequest(episodes=2, seed=4, on_row=lambda *what: reported.append(what))
    result = run_sorting_people(pretrained.load("pick"), request)
    names = [row["name"] for row in result["results"]]
    rules = ["critic", "planner", "nearest"]
    assert names == [*rules, *(f"{rule}-no-ssm" for rule in rules), "critic-fast-hands"]
    assert [done for done, _, _ in reported] == [1, 2, 3, 4, 5, 6, 7]
    critic, planner = result["results"][:2]
    difference = critic["cycle_time_s"]["mean"] - planner["cycle_time_s"]["mean"]
    assert result["paired"][0]["cycle_time_s"]["mean"] == pytest.approx(difference)


def test_workers_continue_with_another_script() -> None:
    ran = bench(1)
    ran._begin()
    state = ran.batch.state.people
    before = state.chosen[0, 0].copy()
    last = int(state.n_moves[0, 0])
    state.clock[0, 0] = state.start[0, 0, last - 1] + state.duration[0, 0, last - 1] + 2.0
    ran._renew_scripts(np.array([0]))
    assert state.clock[0, 0] == 0.0
    assert state.chosen[0, 0, 0] == before[last]
    assert (state.chosen[0, 0] != before).any()
