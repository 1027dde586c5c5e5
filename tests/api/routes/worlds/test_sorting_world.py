"""The live world in a sorting cell, over HTTP."""

from collections.abc import Iterator
from typing import Any

import pytest
from fastapi.testclient import TestClient

from tests.api.answers import problem_of
from tests.api.routes.worlds.live_world import COMMANDS, WORLD, send, until


@pytest.fixture(scope="module", autouse=True)
def sorting_cell(client: TestClient) -> Iterator[None]:
    shown = client.put(f"{WORLD}/cell", json={"cell": "sorting-e0"})
    assert shown.status_code == 200, shown.text
    yield
    client.put(f"{WORLD}/cell", json={"cell": "pick-and-place"}).raise_for_status()


@pytest.fixture(autouse=True)
def at_rest(client: TestClient) -> None:
    """Draw a new task and empty its goal, so that blocks stay where they are."""
    before = blocks(client.get(WORLD).json())
    send(client, tag="resume")
    send(client, tag="reset")
    send(client, tag="set-goal", towers={})
    until(
        client,
        lambda now: now["sorting"]["goal"] == [] and not before.keys() & blocks(now).keys(),
    )


def blocks(world: dict[str, Any]) -> dict[str, Any]:
    return {one["id"]: one for one in world["sorting"]["blocks"]}


def test_world_shows_blocks_goal_and_failure_map(client: TestClient) -> None:
    world = client.get(WORLD).json()
    sorting = world["sorting"]
    assert world["cell"] == "sorting-e0"
    assert len(sorting["blocks"]) == 6
    assert (sorting["failure"][2], sorting["colours"]) == (0.4, ["red", "blue"])
    assert world["checkpoint"] is not None
    listed = client.get("/v1/worlds").json()["items"][0]
    assert (listed["cell"], listed["checkpoint"]) == ("sorting-e0", world["checkpoint"])


def test_choice_among_places_can_be_asked_again(client: TestClient) -> None:
    send(client, tag="toggle-goal", id=next(iter(blocks(client.get(WORLD).json()))))
    moving = until(
        client, lambda now: now["sorting"]["phase"] == "approach" and now["chosen"] is not None
    )
    asked = client.post("/v1/task-selection", json=moving["state"]).json()
    assert asked["chosen"] == moving["chosen"]


def test_objects_and_goal_change_while_the_robot_works(client: TestClient) -> None:
    before = client.get(WORLD).json()
    free = {f"slot{k}" for k in range(10)} - {one["place"] for one in blocks(before).values()}
    first, second = sorted(free)[:2]
    assert (
        send(client, tag="add-block", colour="red", size="large", at=first).status_code == 202
    )
    added = until(client, lambda now: len(blocks(now)) == 7)
    (id,) = set(blocks(added)) - set(blocks(before))
    send(client, tag="move-block", id=id, to=second)
    until(client, lambda now: blocks(now)[id]["place"] == second)
    send(client, tag="toggle-goal", id="red-large")
    wanted = until(client, lambda now: now["sorting"]["moves_to_go"] > 0)
    assert [one["size"] for one in wanted["sorting"]["goal"]] == ["large"]
    send(client, tag="remove-block", id=id)
    until(client, lambda now: id not in blocks(now))


def test_test_is_started(client: TestClient) -> None:
    tests = client.get("/v1/cells/sorting-e0").json()["sorting_tests"]
    assert [one["id"] for one in tests] == [f"test-{k}" for k in range(1, 7)]
    assert send(client, tag="start-test", id="test-2").status_code == 202
    world = until(client, lambda now: now["sorting"]["test"] == "test-2")
    assert len(blocks(world)) == 10


@pytest.mark.parametrize(("name", "status"), [("nope", 422), ("reach", 409)])
def test_wrong_sorting_policy_is_named_by_its_field(
    client: TestClient, name: str, status: int
) -> None:
    body = {"cell": "sorting-e0", "sorting_policy": name}
    refused = client.put("/v1/worlds/main/cell", json=body)
    assert (refused.status_code, refused.json()["field"]) == (status, "sorting_policy")


def test_planner_decides_alone_where_no_sorting_policy_is_set(client: TestClient) -> None:
    assert send(client, tag="set-sorting-policy", checkpoint=None).status_code == 202
    send(client, tag="toggle-goal", id=next(iter(blocks(client.get(WORLD).json()))))
    world = until(client, lambda now: now["sorting"]["move"] is not None)
    assert world["sorting"]["decided_by"] == "planner"
    assert world["sorting"]["sorting_policy"] is None


@pytest.mark.parametrize(
    ("command", "field"),
    [
        ({"tag": "add-block", "colour": "green", "size": "small"}, "colour"),
        ({"tag": "add-block", "colour": "red", "size": "small", "at": "shelf"}, "at"),
        ({"tag": "remove-block", "id": "block999"}, "id"),
        ({"tag": "move-block", "id": "block999", "to": "slot0"}, "id"),
        ({"tag": "set-goal", "towers": {"red": ["large"] * 11}}, "towers.red"),
        ({"tag": "set-goal", "towers": {"red": ["large"] * 10}}, "towers"),
        ({"tag": "toggle-goal", "id": "purple-large"}, "id"),
        ({"tag": "start-test", "id": "test-9"}, "id"),
        ({"tag": "set-sorting-policy", "checkpoint": "nothing"}, "checkpoint"),
        ({"tag": "set-order", "order": "random"}, "order"),
        ({"tag": "set-candidates", "ids": ["slot0"]}, "tag"),
    ],
)
def test_bad_command_is_a_problem_that_names_the_field(
    client: TestClient, command: dict[str, Any], field: str
) -> None:
    assert problem_of(client.post(COMMANDS, json=command))["field"] == field


def test_policy_that_chooses_tasks_does_not_sort(client: TestClient) -> None:
    refused = send(client, tag="set-sorting-policy", checkpoint="pick")
    assert refused.status_code in (409, 422)


def test_full_table_takes_no_more_blocks(client: TestClient) -> None:
    send(client, tag="start-test", id="test-2")
    until(client, lambda now: len(blocks(now)) == 10)
    refused = send(client, tag="add-block", colour="red", size="small")
    assert refused.status_code == 422
    assert refused.json()["field"] == "blocks"
