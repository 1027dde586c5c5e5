"""Tests of the protocols of the reach scenario with the shipped policy."""

import json
from functools import cache

import numpy as np
import pytest

from app.errors import InvalidInput
from app.policies.checkpoints import pretrained
from app.policies.evaluation.reach import episodes as reach_episodes
from app.policies.evaluation.reach.bench import ReachBench
from app.policies.evaluation.reach.people import SPEEDS, at_speed
from app.policies.evaluation.reach.random_goals import RINGS
from app.policies.evaluation.reach.targets import STARTS
from app.policies.evaluation.reach.tracker import ROLLOUT_ROWS, ROWS
from app.policies.evaluation.registry import evaluate
from app.sim.cells.cell import load_cell
from app.sim.scenario.kernels.episode import COLLISION
from tests.policies.untrained import shipped_as, untrained_reach

N = 12
EPISODES = {"reach-targets": 2, "reach-people": 24}
"""Episodes per target, and those whose rates are compared; of other protocols N."""
MEASURED = sorted(
    f"reach-{name}"
    for name in "targets random constant speeds smoothness people tracker".split()
)


@pytest.fixture(autouse=True)
def few_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reach_episodes, "N_ENVS", 24)
    monkeypatch.setattr(reach_episodes, "N_RECHECKED", 2)


@cache
def run(name: str) -> tuple[dict, list]:
    """Return the result of a protocol and the reported rows; each protocol is run once."""
    reported: list = []
    result = evaluate(
        name,
        pretrained.load("reach"),
        episodes=EPISODES.get(name, N),
        seed=5,
        on_row=lambda *what: reported.append(what),
    )
    return result, reported


def test_a_recipe_of_the_thesis_is_measured_by_the_rules_of_its_training() -> None:
    recipe = {"actor": "ddpg", "critic": "ddpg", "normalisation": "running", "width": 16}
    rules = {"collision": "blocks", "limits": "authors", "observation": "state"}
    checkpoint = untrained_reach(**recipe, **rules, c_p=0.0, c_step=0.0)
    bench = ReachBench(checkpoint, 5)
    assert (bench.usual.limits, bench.usual.collision_ends) == ("authors", False)
    episodes = bench.on_targets(1)
    collided = episodes.outcome == COLLISION
    assert len(episodes.outcome) == 54 and collided.any()
    assert (episodes.duration_s[collided] > 0.02).all()
    assert episodes.duration_s[collided].max() == pytest.approx(5.0)


@pytest.mark.parametrize("name", MEASURED)
def test_a_result_is_json_and_states_the_rules_of_each_row(name: str) -> None:
    result, reported = run(name)
    rows = json.loads(json.dumps(result, allow_nan=False))["results"]
    assert [one for _, _, one in reported] == result["results"]
    assert [(done, total) for done, total, _ in reported] == [
        (k + 1, len(rows)) for k in range(len(rows))
    ]
    stated = result["settings"]["rows"]
    assert list(stated) == [row["name"] for row in rows]
    for row in rows:
        rules = stated[row["name"]]
        assert {"cell", "people", "start", "collision_ends", "goals", "time_limit_s"} <= set(
            rules
        )
        assert row["n"] == (108 if name == "reach-targets" else EPISODES.get(name, N))
        assert all("mean" in one for one in row.values() if isinstance(one, dict))
    assert result["checkpoint"] == pretrained.load("reach").sha256


def test_every_target_is_counted_under_each_rule_of_starting() -> None:
    result, _ = run("reach-targets")
    assert result["episodes"] == 2
    names = [row["name"] for row in result["results"]]
    assert names == [*STARTS, *(f"{start}-rollout" for start in STARTS)]
    for row in result["results"]:
        goals = {tuple(cell["goal"]) for cell in row["targets"]}
        assert len(goals) == 54
        assert all(cell["n"] == 2 for cell in row["targets"])
        assert {cell["height_m"] for cell in row["targets"]} == {0.8, 1.0, 1.2}
        hits = sum(cell["collision"]["mean"] for cell in row["targets"]) / 54
        assert hits == pytest.approx(row["collision"]["mean"])
        assert row["worst"][0]["mean"] == min(
            cell["success"]["mean"] for cell in row["targets"]
        )
        ends = row["ends"]
        for kind in ("success", "collision"):
            assert sum(one[kind] for one in ends) == round(row[kind]["mean"] * 108)
    first, uniform, authors = result["results"][:3]
    assert first["initial_contact"]["mean"] == 0.0 and first["starts_redrawn"] > 0.0
    assert uniform["starts_redrawn"] == 0.0
    assert "reached_after_contact" in authors
    assert result["fcl_recheck"]["missed_contacts"] == 0


def test_random_goals_have_a_row_per_inference_mode_and_limit() -> None:
    on_grid, _ = run("reach-random")
    in_box = evaluate("reach-random", shipped_as(goals="box"), episodes=N, seed=5)
    names = [row["name"] for row in in_box["results"]]
    assert names[:4] == ["targets", "targets-rollout", "direct", "direct-25s"]
    assert names[4:] == ["direct-rollout", "direct-rollout-25s"]
    modes = ["direct", "interpolated", "direct-rollout", "interpolated-rollout"]
    names = [row["name"] for row in on_grid["results"]][2:]
    assert names == [f"{mode}{limit}" for mode in modes for limit in ("", "-25s")]
    direct = in_box["results"][2]
    assert sum(one["n"] for one in direct["between"]) == N
    assert all(
        RINGS[0] <= one["low_m"] < one["high_m"] <= RINGS[-1] for one in direct["between"]
    )
    limits = [rules["time_limit_s"] for rules in on_grid["settings"]["rows"].values()]
    assert limits == [5.0, 5.0, *(4 * [5.0, 25.0])]


def test_zero_to_four_walkers_are_there_and_make_it_harder() -> None:
    result, _ = run("reach-people")
    people = [len(one["people"]) for one in result["settings"]["rows"].values()]
    assert sorted(set(people)) == [0, 1, 2, 3, 4]
    rows = {row["name"]: row for row in result["results"]}
    empty, four = rows["0-people"], rows["4-people-direct"]
    assert empty["success"]["mean"] == 1.0
    assert four["collision"]["mean"] > 0.0


def test_people_of_a_given_speed_walk_at_it() -> None:
    cell = load_cell("shared-workspace")
    for speed in SPEEDS:
        (person,) = at_speed(cell, speed).cylinders
        own = cell.cylinders[0]
        assert (person.kind, person.speed) == ("fixed-speed", speed)
        assert (person.x_min, person.height, person.p_still) == (
            own.x_min,
            own.height,
            own.p_still,
        )


def test_a_row_per_tracker_stands_beside_the_exact_state() -> None:
    result, _ = run("reach-tracker")
    names = [row["name"] for row in result["results"]]
    assert names == ["exact", *ROWS, *(f"{name}-rollout" for name in ROLLOUT_ROWS)]
    errors = [row["axis_error_median_mm"] for row in result["results"][1:]]
    assert np.all(np.diff(errors[:4]) > 0.0)


def test_a_jerk_limited_policy_is_measured_as_such() -> None:
    policy = untrained_reach(width=16, degree=3)
    result = evaluate("reach-smoothness", policy, episodes=N, seed=5)
    (row,) = result["results"]
    assert row["name"] == "degree-3"
    assert row["jerk_rad_s3"] <= row["jerk_limit_rad_s3"] + 1e-6
    assert result["settings"]["action"]["degree"] == 3


@pytest.mark.parametrize("name", ["reach-speeds", "reach-tracker"])
def test_a_cell_without_a_pedestrian_is_refused(name: str) -> None:
    cell = load_cell("shared-workspace").model_copy(update={"name": "empty", "people": ()})
    with pytest.raises(InvalidInput, match="a cell with a pedestrian") as caught:
        evaluate(name, untrained_reach(width=16, cell=cell), episodes=2)
    assert (caught.value.field, caught.value.value) == ("checkpoint", "empty")
