"""``POST /v1/sorting``: the exact planner, a policy that knows nothing yet, and bad input."""

import copy
import json
from typing import Any

import pytest
from fastapi.testclient import TestClient

from app.policies.configs import presets
from app.policies.configs.sorting import SortingPreset
from app.policies.training.sorting import start
from app.sim.cells.cell import load_cell
from jobs.checkpoints import to_store
from tests.api.answers import content_of, post_json, problem_of
from tests.api.conftest import services_of

URL = "/v1/sorting"
ALIAS = "untrained-sorting"

TASK: dict[str, Any] = {
    "cell": "sorting-e0",
    "objects": [
        {"id": "a", "colour": "red", "size": "large", "at": "slot2"},
        {"id": "b", "colour": "red", "size": "large", "at": "slot5"},
        {"id": "c", "colour": "red", "size": "small", "at": "slot0"},
        {"id": "d", "colour": "blue", "size": "medium", "at": "red", "level": 0},
        {"id": "e", "colour": "blue", "size": "small", "at": "red", "level": 1},
    ],
    "goal": {"red": ["large", "small"], "blue": ["medium"]},
}
"""Two blue objects stand in the parents; of two large red ones the one in slot5 never fails."""


@pytest.fixture(scope="module")
def checkpoint(client: TestClient) -> str:
    """A policy at the start of its training, in the store of the service."""
    preset = presets.resolve(
        "sorting-e0-dqn", {"networks": {"width": 16}, "learning": {"n_envs": 8}}
    )
    assert isinstance(preset, SortingPreset)
    made = start(preset, 4, load_cell("sorting-e0"))[0].policy()
    services_of(client).checkpoints.publish(ALIAS, to_store(made))
    return made.sha256


def asked(client: TestClient, body: dict[str, Any]) -> dict[str, Any]:
    return content_of(client.post(URL, json=body))


def refused(client: TestClient, body: Any, status: int = 422) -> dict[str, Any]:
    return problem_of(post_json(client, URL, body), status)


def carried_out(task: dict[str, Any], move: dict[str, Any]) -> dict[str, Any]:
    """The task after a move, with the objects where it puts them."""
    task = copy.deepcopy(task)
    pick, place = move["pick"], move["place"]
    for one in task["objects"]:
        if (one["at"], one.get("level")) == (pick["station"], pick["level"]):
            one.update(at=place["station"], level=place["level"])
            return task
    raise AssertionError(f"nothing is at {pick}")


def planned(task: dict[str, Any]) -> dict[str, Any]:
    return {**task, "decider": "planner"}


def test_planner_first_removes_blocks_above(client: TestClient) -> None:
    answer = asked(client, planned(TASK))
    assert (answer["by"], answer["why"], answer["solved"]) == ("planner", "asked", False)
    assert answer["move"]["object"] == "e"
    assert answer["move"]["pick"] == {"station": "red", "level": 1}
    assert answer["fewest_moves"] == 4
    assert answer["expected_attempts"] == pytest.approx(3.0 + 1.0 / (1.0 - 0.217))
    assert answer["checkpoint"] is None


def test_all_valid_moves_are_ranked_with_the_chosen_one_first(client: TestClient) -> None:
    answer = asked(client, planned(TASK))
    moves = answer["moves"]
    first = {name: moves[0][name] for name in answer["move"]}
    assert first == answer["move"]
    assert len(moves) == 3 * 2 + 7 + 1
    assert moves[0]["value"] == pytest.approx(-answer["expected_attempts"])
    assert moves[0]["fewest"] and not moves[-1]["fewest"]


def test_of_two_duplicates_the_planner_takes_the_safe_one(client: TestClient) -> None:
    objects = [one for one in TASK["objects"] if one["at"] != "red"]
    answer = asked(client, planned({**TASK, "objects": objects, "goal": {"red": ["large"]}}))
    assert answer["move"]["object"] == "b"


def test_failure_map_of_the_request_replaces_the_cells(client: TestClient) -> None:
    objects = [one for one in TASK["objects"] if one["at"] != "red"]
    changed = {"objects": objects, "goal": {"red": ["large"]}, "failure_map": {"slot5": 0.9}}
    assert asked(client, planned({**TASK, **changed}))["move"]["object"] == "a"


def test_plan_is_carried_out_in_the_fewest_moves(client: TestClient) -> None:
    task = TASK
    for left in (4, 3, 2, 1):
        answer = asked(client, planned(task))
        assert answer["fewest_moves"] == left
        task = carried_out(task, answer["move"])
    answer = asked(client, planned(task))
    assert (answer["solved"], answer["move"], answer["moves"]) == (True, None, [])
    assert answer["because"] == "The goal is reached: there is nothing to move."


def test_goal_and_objects_may_change_between_two_calls(client: TestClient) -> None:
    task = carried_out(TASK, asked(client, planned(TASK))["move"])
    task["objects"].append({"colour": "blue", "size": "large", "at": "slot9"})
    task["goal"] = {"blue": ["large", "medium"]}
    answer = asked(client, planned(task))
    assert not answer["solved"]
    assert answer["fewest_moves"] == 2


def test_policy_decides_by_its_greatest_value(client: TestClient, checkpoint: str) -> None:
    answer = asked(client, {**TASK, "checkpoint": checkpoint})
    values = [one["value"] for one in answer["moves"]]
    assert (answer["by"], answer["why"], answer["checkpoint"]) == (
        "policy",
        "policy",
        checkpoint,
    )
    assert values == sorted(values, reverse=True)
    assert answer["fewest_moves"] == 4
    by_alias = asked(client, {**TASK, "checkpoint": ALIAS})
    assert by_alias["moves"] == answer["moves"]


def test_shipped_policy_of_the_cell_decides_where_none_is_named(client: TestClient) -> None:
    shipped = client.get("/v1/checkpoints/sorting-e0").json()["sha256"]
    task, deciders = TASK, []
    for _ in range(4):
        answer = asked(client, task)
        assert answer["checkpoint"] == shipped
        deciders.append(answer["by"])
        task = {**carried_out(task, answer["move"]), "monitor": answer["monitor"]}
    assert asked(client, task)["solved"]
    assert deciders == ["policy"] * 4


@pytest.mark.usefixtures("checkpoint")
def test_planner_takes_over_and_the_goal_is_reached(client: TestClient) -> None:
    task: dict[str, Any] = {**TASK, "checkpoint": ALIAS}
    deciders = []
    for _ in range(30):
        answer = asked(client, task)
        if answer["solved"]:
            break
        deciders.append(answer["why"])
        task = {**carried_out(task, answer["move"]), "monitor": answer["monitor"]}
    assert answer["solved"]
    assert deciders[0] == "policy"
    assert deciders[-1] in ("repeated", "attempts-exceeded")


@pytest.mark.usefixtures("checkpoint")
def test_without_the_record_nothing_is_remembered(client: TestClient) -> None:
    first, second = (asked(client, {**TASK, "checkpoint": ALIAS}) for _ in range(2))
    assert first["monitor"] == second["monitor"]
    assert first["moves"] == second["moves"]


@pytest.mark.usefixtures("checkpoint")
@pytest.mark.parametrize(
    ("goal", "field"),
    [
        ({"red": ["small", "large"]}, "goal.red[1]"),
        ({"blue": [{"size": "large", "colour": "red"}]}, "goal.blue[0]"),
    ],
)
def test_goal_that_no_policy_was_trained_for_is_left_to_the_planner(
    client: TestClient, goal: dict[str, Any], field: str
) -> None:
    answer = asked(client, {**TASK, "goal": goal, "checkpoint": ALIAS})
    assert (answer["by"], answer["why"]) == ("planner", "untrained-goal")
    assert [one["field"] for one in answer["outside"]] == [field]


@pytest.mark.usefixtures("checkpoint")
def test_failures_beyond_those_of_the_training_are_said(client: TestClient) -> None:
    task = {**TASK, "failure_map": {"slot7": 0.75}, "checkpoint": ALIAS}
    assert asked(client, task)["outside"] == [
        {"field": "failure_map.slot7", "value": "0.75", "rule": "was at most 0.4 in training"}
    ]


@pytest.mark.usefixtures("checkpoint")
def test_policy_of_another_size_of_task_leaves_it_to_the_planner(client: TestClient) -> None:
    layout = {"n_slots": 3, "colours": ["red", "blue"]}
    objects = [{"colour": "red", "size": "small", "at": "slot1"}]
    task = {"layout": layout, "objects": objects, "goal": {"red": ["small"]}}
    answer = asked(client, {**task, "checkpoint": ALIAS})
    assert (answer["by"], answer["why"]) == ("planner", "other-shape")
    assert answer["outside"][0]["field"] == "cell"


def test_task_without_a_cell_takes_its_own_colours_and_sizes(client: TestClient) -> None:
    task = {
        "layout": {"n_slots": 4, "colours": ["amber", "violet"], "sizes": ["thin", "thick"]},
        "objects": [{"colour": "amber", "size": "thick", "at": "violet", "level": 0}],
        "goal": {"amber": ["thick"]},
    }
    answer = asked(client, task)
    assert answer["why"] == "no-policy"
    assert answer["move"]["place"] == {"station": "amber", "level": 0}


def test_largest_task_is_answered(client: TestClient) -> None:
    colours, sizes = ["a", "b", "c", "d", "e"], ["xs", "s", "m", "l", "xl"]
    objects = [
        {"colour": colours[k % 5], "size": sizes[k // 8], "at": f"slot{k}"} for k in range(40)
    ]
    goal = {
        c: [one["size"] for one in reversed(objects) if one["colour"] == c] for c in colours
    }
    layout = {"n_slots": 40, "colours": colours, "sizes": sizes}
    answer = asked(client, {"layout": layout, "objects": objects, "goal": goal})
    assert answer["fewest_moves"] == 40
    assert len(answer["moves"]) == 40 * 5


def changed(path: str, value: Any) -> dict[str, Any]:
    """The task with one member replaced; ``path`` such as ``objects.0.at``."""
    task = copy.deepcopy(TASK)
    *parents, last = [int(part) if part.isdigit() else part for part in path.split(".")]
    place: Any = task
    for part in parents:
        place = place[part]
    place[last] = value
    return task


@pytest.mark.parametrize(
    ("path", "value", "field"),
    [
        ("cell", "kitchen", "cell"),
        ("cell", "pick-and-place", "cell"),
        ("cell", None, "cell"),
        ("layout", {"n_slots": 4, "colours": ["red"]}, "cell"),
        ("objects.0.colour", "green", "objects[0].colour"),
        ("objects.0.size", "huge", "objects[0].size"),
        ("objects.0.at", "slot10", "objects[0].at"),
        ("objects.0.at", "slot5", "objects[1].at"),
        ("objects.0.level", 0, "objects[0].level"),
        ("objects.0.id", "b", "objects[1].id"),
        ("objects.3.level", None, "objects[3].level"),
        ("objects.3.level", 10, "objects[3].level"),
        ("objects.3.level", 2, "objects[4].level"),
        ("objects.4.level", 0, "objects[4].level"),
        ("objects.4.level", 2, "objects[4].level"),
        ("objects.4.level", -1, "objects[4].level"),
        ("goal.green", ["large"], "goal"),
        ("goal.red", ["huge"], "goal.red[0].size"),
        ("goal.red", [{"size": "small", "colour": "pink"}], "goal.red[0].colour"),
        ("goal.red", ["small"] * 11, "goal.red"),
        ("goal.red", ["large"] * 3, "goal"),
        ("failure_map", {"slot0": 1.0}, "failure_map.slot0"),
        ("failure_map", {"slot0": -0.1}, "failure_map.slot0"),
        ("failure_map", {"red": 0.1}, "failure_map.red"),
        ("checkpoint", "best", "checkpoint"),
        ("decider", "oracle", "decider"),
        ("gaol", {}, "gaol"),
    ],
)
def test_what_cannot_be_is_refused_with_its_field(
    client: TestClient, path: str, value: Any, field: str
) -> None:
    problem = refused(client, changed(path, value))
    assert problem["field"] == field
    assert {"value", "rule", "choices"} <= problem.keys()


def test_objects_that_the_goal_lacks_are_named(client: TestClient) -> None:
    goal = {"red": ["large"] * 4, "blue": ["large"]}
    problem = refused(client, {**TASK, "goal": goal})
    assert problem["value"] == "'2 x large red, 1 x large blue'"
    assert problem["rule"] == "must be met by the objects: these are missing"


def test_unknown_words_are_refused_with_those_that_are_known(client: TestClient) -> None:
    assert refused(client, changed("objects.0.colour", "green"))["choices"] == ["red", "blue"]
    sizes = refused(client, changed("objects.0.size", "huge"))["choices"]
    assert sizes == ["small", "medium", "large"]
    assert "slot9" in refused(client, changed("objects.0.at", "slot10"))["choices"]


def test_more_objects_than_the_cell_has_room_for_are_refused(client: TestClient) -> None:
    more = [{"colour": "red", "size": "small", "at": f"slot{k}"} for k in range(9)]
    problem = refused(client, {**TASK, "objects": [*TASK["objects"][3:], *more]})
    assert (problem["field"], problem["value"]) == ("objects", "11")


def test_endless_list_of_objects_is_refused(client: TestClient) -> None:
    problem = refused(client, {**TASK, "objects": [TASK["objects"][0]] * 5000})
    assert problem["field"] == "objects"


@pytest.mark.parametrize("text", ["NaN", "Infinity", "1e999"])
def test_failure_that_is_no_number_is_refused(client: TestClient, text: str) -> None:
    body = json.dumps({**TASK, "failure_map": {"slot0": "X"}}).replace('"X"', text)
    problem = refused(client, body)
    assert problem["field"] == "failure_map.slot0"
    assert problem["rule"] == "must be a finite number"


def test_planner_and_a_checkpoint_at_once_are_refused(client: TestClient) -> None:
    problem = refused(client, {**planned(TASK), "checkpoint": "pick"})
    assert problem["field"] == "checkpoint"


@pytest.mark.usefixtures("checkpoint")
@pytest.mark.parametrize(
    ("member", "value", "field"),
    [
        ("seen", ["0" * 16] * 1000, "monitor.seen"),
        ("seen", ["zero"], "monitor.seen[0]"),
        ("last", "0" * 4000, "monitor.last"),
        ("attempts", -1, "monitor.attempts"),
        ("attempts", 10**30, "monitor.attempts"),
        ("budget", -1.0, "monitor.budget"),
        ("planner_fallback", "bribed", "monitor.planner_fallback"),
        ("more", 1, "monitor.more"),
    ],
)
def test_record_that_was_tampered_with_is_refused(
    client: TestClient, member: str, value: Any, field: str
) -> None:
    monitor = asked(client, {**TASK, "checkpoint": ALIAS})["monitor"]
    problem = refused(
        client, {**TASK, "checkpoint": ALIAS, "monitor": {**monitor, member: value}}
    )
    assert problem["field"] == field


def test_policy_that_sorts_is_refused_where_tasks_are_chosen(
    client: TestClient, checkpoint: str
) -> None:
    body = {
        "cell": "pick-and-place",
        "robot": {"q": [0.99, -2.33, 2.08, -1.32, -1.57, 0], "qd": [0.0] * 6},
        "people": [],
        "candidates": [{"id": "left", "position": [-0.5, 0.7, 0.12]}],
        "checkpoint": checkpoint,
    }
    answer = client.post("/v1/task-selection", json=body)
    assert answer.status_code == 409
    assert (
        answer.json()["detail"] == "checkpoint purpose is 'sorting', expected 'choosing tasks'"
    )


def test_policy_that_sorts_is_refused_as_the_one_that_moves_an_arm(
    client: TestClient, checkpoint: str
) -> None:
    command = {"tag": "set-policy", "checkpoint": checkpoint}
    answer = client.post("/v1/worlds/main/commands", json=command)
    assert (answer.status_code, answer.json()["field"]) == (409, "checkpoint")


def test_policy_that_chooses_tasks_is_refused_where_moves_are(client: TestClient) -> None:
    problem = refused(client, {**TASK, "checkpoint": "pick"}, status=409)
    assert (problem["field"], problem["property"]) == ("checkpoint", "purpose")
    assert problem["value"] == "<purpose 'choosing tasks'>"
    assert problem["rule"] == "must have the purpose 'sorting'"
    assert problem["expected"] == "'sorting'"
    assert problem["actual"] == "'choosing tasks'"
