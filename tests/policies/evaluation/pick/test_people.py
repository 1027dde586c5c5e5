"""Tests of the protocols with several, yielding and recorded people."""

from dataclasses import replace

import numpy as np
import pytest

from app.errors import InvalidInput
from app.policies.checkpoints import pretrained
from app.policies.evaluation.pick.episodes import PickBench
from app.policies.evaluation.pick.people import (
    MAX_RECORDED_S,
    OneTarget,
    beside_recordings,
    could_be_picked,
)
from app.policies.evaluation.registry import evaluate
from app.policies.evaluation.rows import EvaluationRequest
from app.sim.cells.cell import load_cell
from app.sim.human import model as human
from app.sim.people.reach_script import standing_reach
from app.sim.pick.batch import PickBatch, PickSettings
from tests.sim.recorded_person import working
from tests.sim.working_people import run_of

N = 40
PEOPLE = [
    "0-people", "1-people", "2-people", "3-people", "4-people", "1-person-p5", "1-person-p95",
    "3-people-p5", "3-people-p95", "worker-and-walker", "first-reaches",
]  # fmt: skip


@pytest.fixture(scope="module")
def reported():
    return []


@pytest.fixture(scope="module")
def beside_people(reported):
    return evaluate(
        "pick-people",
        pretrained.load("pick"),
        episodes=N,
        seed=5,
        on_row=lambda *what: reported.append(what),
    )


def rows_of(result):
    return {row["name"]: row for row in result["results"]}


def test_people_have_a_row_for_every_number_and_size(beside_people):
    assert [row["name"] for row in beside_people["results"]] == PEOPLE
    assert {row["n"] for row in beside_people["results"]} == {N}
    stated = beside_people["settings"]
    assert stated["3-people-p5"]["people"] == ["worker"] * 3
    assert stated["worker-and-walker"]["people"] == ["worker", "walker"]


def test_contacts_at_rest_grow_with_the_number_of_people_from_zero(beside_people):
    rows = rows_of(beside_people)
    assert rows["0-people"]["touched_at_rest"]["mean"] == 0.0
    touched = [rows[f"{n}-people"]["touched_at_rest"]["mean"] for n in (0, 1, 4)]
    assert touched[0] < touched[1] < touched[2]


def test_small_and_large_people_give_other_episodes(beside_people):
    rows, stated = rows_of(beside_people), beside_people["settings"]
    small, large = rows["3-people-p5"], rows["3-people-p95"]
    assert {k: v for k, v in small.items() if k != "name"} != {
        k: v for k, v in large.items() if k != "name"
    }
    speeds = [stated[f"1-person-p{p}"]["hand_speed_median_m_s"] for p in (5, 95)]
    assert speeds[0] != speeds[1]


def test_every_row_is_reported_as_soon_as_it_is_known(beside_people, reported):
    assert [(done, total) for done, total, _ in reported] == [(k + 1, 11) for k in range(11)]
    assert [row for _, _, row in reported] == beside_people["results"]


def test_yielding_people_touch_a_robot_at_rest_less_often():
    result = evaluate("pick-yielding", pretrained.load("pick"), episodes=80, seed=5)
    rows, kinds = rows_of(result), ("yielding-0", "yielding-0.5", "yielding-1")
    assert list(rows) == [name for kind in kinds for name in (kind, f"{kind}, planner")]
    touched = [rows[kind]["touched_at_rest"]["mean"] for kind in kinds]
    assert touched[0] > touched[2] + 0.05
    assert touched[0] >= touched[1] >= touched[2]
    assert [one["name"] for one in result["paired"]] == [f"{k}, planner - {k}" for k in kinds]
    late = [row["timeout"]["mean"] for name, row in rows.items() if "yielding-1" in name]
    assert late[1] < late[0]  # people who yield stop in the robot's path


def test_recorded_people_are_evaluated_together_and_one_by_one():
    standing = run_of(np.tile(human.rest_posture(1.0, 2.0, 0.5), (700, 1)), name="stands")
    busy = run_of(working(700), name="works")
    result = evaluate(
        "pick-mocap", pretrained.load("pick"), episodes=20, seed=5, motions=(standing, busy)
    )
    rows, stated = rows_of(result), result["settings"]
    assert list(rows) == ["library", "recorded", "recorded stands", "recorded works"]
    assert rows["recorded stands"]["touched_at_rest"]["mean"] == 0.0
    assert rows["recorded stands"]["frozen_share"] == 1.0
    assert 0.0 < rows["recorded"]["frozen_share"] < 1.0
    assert rows["recorded works"]["frozen_share"] < 0.01  # when it turns, back and forth
    assert "frozen_share" not in rows["library"]
    assert "hand_speed_median_m_s" not in stated["recorded stands"]
    assert stated["recorded works"]["hand_speed_median_m_s"] > 0.05
    assert stated["motions"][1] == {"source": "works, made up", "seconds": 13.98}
    library = rows["library"]["touched_at_rest"]["mean"]
    assert library > 0.0


def test_one_recording_has_no_row_of_its_own():
    runs = (run_of(working(100), name="a"), run_of(working(100, seed=1), name="a"))
    result = evaluate("pick-mocap", pretrained.load("pick"), episodes=2, motions=runs)
    assert list(rows_of(result)) == ["library", "recorded"]


def test_runs_are_drawn_in_proportion_to_what_was_recorded():
    cell, runs = load_cell(), tuple(run_of(working(n)) for n in (51, 151))
    batch = PickBatch(cell, 2000, 5, beside_recordings(PickSettings(), runs, cell))
    batch.reset()
    people = batch.world.people
    assert len(people.bodies) == 2 and len(people.tracks.spans) == 40
    assert batch.state.people.body[:, 0].mean() == pytest.approx(0.75, abs=0.04)


def test_more_recorded_motion_than_memory_is_refused():
    run = run_of(working(100))
    long = replace(run, times=run.times * (MAX_RECORDED_S + 10.0) / run.times[-1])
    with pytest.raises(InvalidInput, match="motions = 36010 s .* at most 36000 s"):
        evaluate("pick-mocap", pretrained.load("pick"), episodes=1, motions=(long,))


def test_a_target_is_blocked_unless_a_grasp_fits_after_the_motion_to_it():
    bench = PickBench(pretrained.load("pick"), EvaluationRequest(episodes=1, seed=5), (1, 1))
    batch = bench.evaluator(bench.usual).batch
    batch.reset()
    seen, state, cell = OneTarget(batch), batch.state, bench.cell
    (target,) = batch.world.stations[state.candidates[0, :1]]
    batch.set_goals(np.arange(1), target[None])
    over = target - [0.0, 0.0, 0.05]
    at_it = standing_reach(cell, over, "r")[None, None]
    away = human.rest_posture(cell.human.x_min, cell.human.y_max, cell.human.home[2])[
        None, None
    ]
    seen.start = state.q_goal.copy()  # already there
    for free, picked in ((15, False), (16, True), (17, True)):
        seen.people[:] = [at_it] * 10 + [away] * free + [at_it] * 10
        assert could_be_picked(batch, seen, 0) == picked
    seen.start = state.q_goal + 0.09 * batch.arm.limits.qd_max  # 0.09 s away
    seen.people[:] = [away] * 16 + [at_it] * 10
    assert not could_be_picked(batch, seen, 0)
    seen.people.insert(0, away)
    assert could_be_picked(batch, seen, 0)
