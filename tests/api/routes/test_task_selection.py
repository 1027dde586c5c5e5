import json
from typing import Any

import pytest
from fastapi.testclient import TestClient

from tests.api.answers import post_json, problem_of
from tests.support.waiting import wait_until

URL = "/v1/task-selection"
JSON = {"Content-Type": "application/json"}


def refused(client: TestClient, body: Any, status: int = 422) -> dict[str, Any]:
    problem = problem_of(post_json(client, URL, body), status)
    assert {"field", "value", "rule", "choices"} <= problem.keys()
    return problem


def test_answer_names_the_choice_every_value_and_the_checkpoint(
    client: TestClient, state: dict[str, Any]
) -> None:
    answer = client.post(URL, json={**state, "stamp": "2026-01-01T00:00:00Z"}).json()
    assert answer["chosen"] in [one["id"] for one in state["candidates"]]
    assert [one["id"] for one in answer["candidates"]] == [c["id"] for c in state["candidates"]]
    assert [one["chosen"] for one in answer["candidates"]].count(True) == 1
    assert all(len(one["action"]["qd_target"]) == 6 for one in answer["candidates"])
    assert len(answer["checkpoint"]) == 64
    assert answer["stamp"] == "2026-01-01T00:00:00Z"
    assert answer["elapsed_ms"] > 0.0


@pytest.mark.parametrize("stamp", [1764259200123456789, 12, 12.5, "12", None])
def test_stamps_are_returned_unchanged(
    client: TestClient, state: dict[str, Any], stamp: int | float | str | None
) -> None:
    found = client.post(URL, json={**state, "stamp": stamp}).json()["stamp"]
    assert (found, type(found)) == (stamp, type(stamp))


def test_a_stamp_that_is_none_is_one_fault_of_its_field(
    client: TestClient, state: dict[str, Any]
) -> None:
    (fault,) = problem_of(client.post(URL, json={**state, "stamp": [1]}))["errors"]
    assert fault["field"] == "stamp"
    assert "valid number or must be a valid string" in fault["rule"]


def test_state_of_a_world_gives_the_choice_and_values_that_the_world_shows(
    client: TestClient,
) -> None:
    world = wait_until(
        lambda: client.get("/v1/worlds/main").json(), lambda now: now["status"] == "moving"
    )
    assert world["state"]["robot"] == world["robot"]
    for posted, shown in zip(world["state"]["people"], world["people"], strict=True):
        assert all(posted[name] == shown[name] for name in ("q", "qd", "size"))
    answer = client.post(URL, json=world["state"]).json()
    assert answer["chosen"] == world["chosen"]
    assert answer["checkpoint"] == world["checkpoint"]
    said = [(one["id"], one["value"]) for one in answer["candidates"]]
    assert said == [(one["id"], one["value"]) for one in world["candidates"]]


def test_alias_and_hash_name_the_same_checkpoint(
    client: TestClient, state: dict[str, Any]
) -> None:
    by_alias = client.post(URL, json={**state, "checkpoint": "pick"}).json()
    by_default = client.post(URL, json={**state, "checkpoint": None}).json()
    by_hash = client.post(URL, json={**state, "checkpoint": by_alias["checkpoint"]}).json()
    assert by_alias["checkpoint"] == by_default["checkpoint"] == by_hash["checkpoint"]


def test_candidate_out_of_reach_is_answered_with_value_and_flag(
    client: TestClient, state: dict[str, Any]
) -> None:
    far = {"id": "far", "position": [9.0, 9.0, 0.2]}
    answer = client.post(URL, json={**state, "candidates": [*state["candidates"], far]}).json()
    assert answer["candidates"][-1]["reachable"] is False
    assert isinstance(answer["candidates"][-1]["value"], float)


def test_thousand_candidates_are_answered(client: TestClient, state: dict[str, Any]) -> None:
    many = [{"id": str(k), "position": [0.001 * k - 0.5, 0.7, 0.12]} for k in range(1000)]
    assert client.post(URL, json={**state, "candidates": many}).status_code == 200


@pytest.mark.parametrize(
    ("count", "rule"),
    [
        (0, "must have at least 1 item"),
        (1001, "must have at most 1000 items"),
        (10_000, "must have at most 1000 items"),
    ],
)
def test_wrong_number_of_candidates_is_refused(
    client: TestClient, state: dict[str, Any], count: int, rule: str
) -> None:
    many = [{"id": str(k), "position": [0.0, 0.7, 0.12]} for k in range(count)]
    problem = refused(client, {**state, "candidates": many})
    assert problem["field"] == "candidates"
    assert problem["rule"].partition(", not")[0] == rule


@pytest.mark.parametrize("joints", [0, 5, 7])
def test_wrong_joint_count_is_refused(
    client: TestClient, state: dict[str, Any], joints: int
) -> None:
    robot = {**state["robot"], "q": [0.0] * joints}
    problem = refused(client, {**state, "robot": robot})
    assert problem["field"] == "robot.q"


def test_wrong_joint_count_of_a_person_is_refused(
    client: TestClient, state: dict[str, Any]
) -> None:
    person = {**state["people"][0], "qd": [0.0] * 17}
    assert refused(client, {**state, "people": [person]})["field"] == "people[0].qd"


@pytest.mark.parametrize("text", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_number_that_is_not_finite_is_refused(
    client: TestClient, state: dict[str, Any], text: str
) -> None:
    body = json.dumps({**state, "robot": {**state["robot"], "qd": ["X", 0, 0, 0, 0, 0]}})
    problem = refused(client, body.replace('"X"', text))
    assert problem["field"] == "robot.qd[0]"
    assert problem["rule"] == "must be a finite number"


def test_robot_joint_outside_its_limits_is_refused(
    client: TestClient, state: dict[str, Any]
) -> None:
    q = [*state["robot"]["q"][:2], 7.5, *state["robot"]["q"][3:]]
    problem = refused(client, {**state, "robot": {**state["robot"], "q": q}})
    assert problem["field"] == "robot.q[2]"
    assert problem["value"] == "7.5"
    assert "must lie in [" in problem["rule"]


def test_joint_of_a_person_outside_its_limits_is_refused(
    client: TestClient, state: dict[str, Any]
) -> None:
    q = [*state["people"][0]["q"][:13], 4.0, *state["people"][0]["q"][14:]]
    problem = refused(client, {**state, "people": [{**state["people"][0], "q": q}]})
    assert problem["field"] == "people[0].q[13]"


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"cell": "kitchen"}, "cell"),
        ({"frame": "world"}, "frame"),
        ({"checkpoint": "0" * 64}, "checkpoint"),
        ({"checkpoint": "best"}, "checkpoint"),
        ({"preivous": "cube1"}, "preivous"),
    ],
)
def test_unknown_name_is_refused_with_the_choices(
    client: TestClient, state: dict[str, Any], change: dict[str, Any], field: str
) -> None:
    problem = refused(client, {**state, **change})
    assert problem["field"] == field
    assert problem["choices"]


def test_same_id_twice_is_refused(client: TestClient, state: dict[str, Any]) -> None:
    twice = [state["candidates"][0], state["candidates"][0]]
    assert refused(client, {**state, "candidates": twice})["field"] == "candidates[1].id"


def test_missing_part_is_named(client: TestClient, state: dict[str, Any]) -> None:
    del state["robot"]["qd"]
    problem = refused(client, state)
    assert problem["field"] == "robot.qd"
    assert problem["detail"] == "robot.qd is required"


def test_broken_json_is_refused_with_the_place(client: TestClient) -> None:
    problem = refused(client, '{"cell": ', status=400)
    assert problem["field"] == "body"
    assert "must be JSON" in problem["rule"]


@pytest.mark.parametrize("content", ["[1, 2]", "7", "null", '"text"'])
def test_json_that_is_no_object_is_refused(client: TestClient, content: str) -> None:
    assert refused(client, content)["field"] == "body"


def test_deeply_nested_json_is_refused(client: TestClient) -> None:
    answer = client.post(URL, content="[" * 100_000, headers=JSON)
    assert answer.status_code == 422
    assert "nested at most" in answer.json()["rule"]
    assert answer.headers["content-type"] == "application/problem+json"


def test_service_goes_on_after_bad_input(client: TestClient, state: dict[str, Any]) -> None:
    refused(client, "{}")
    assert client.post(URL, json=state).status_code == 200


def test_progress_objective_and_probabilities_go_over_the_wire(
    client: TestClient, state: dict[str, Any]
) -> None:
    last = state["candidates"][-1]["id"]
    body = {**state, "previous": last, "phase": "lift", "closing_s": 1.25}
    assert client.post(URL, json=body).json()["chosen"] == last
    answer = client.post(URL, json={**state, "objective": "success"}).json()
    rates = {one["id"]: one["outcome"]["success"] for one in answer["candidates"]}
    assert answer["chosen"] == max(rates, key=lambda name: rates[name]["mean"])
    for one in rates.values():
        assert 0.0 <= one["low"] <= one["mean"] <= one["high"] <= 1.0
    assert refused(client, {**state, "objective": "luck"})["field"] == "objective"
    assert refused(client, {**state, "phase": "hover"})["field"] == "phase"
    assert refused(client, {**state, "checkpoint": ""})["field"] == "checkpoint"
    assert refused(client, {**state, "closing_s": -1.0})["field"] == "closing_s"


@pytest.mark.parametrize("previous", [None, "nobody's"])
def test_lifted_object_is_one_of_the_candidates(
    client: TestClient, state: dict[str, Any], previous: str | None
) -> None:
    ids = [one["id"] for one in state["candidates"]]
    found = refused(client, {**state, "phase": "lift", "previous": previous})
    assert (found["field"], found["value"], found["choices"]) == (
        "previous",
        repr(previous),
        ids,
    )
    for phase in ("approach", "descend"):
        body = {**state, "phase": phase, "previous": previous}
        assert client.post(URL, json=body).status_code == 200
