"""The live world in a reach cell, over HTTP."""

from collections.abc import Iterator
from typing import Any

import pytest
from fastapi.testclient import TestClient

from app.api.registry import REACH_ALIAS
from app.policies.checkpoints import pretrained
from app.store.checkpoints import put_checkpoint
from jobs.checkpoints import to_store
from tests.api.answers import problem_of
from tests.api.conftest import services_of
from tests.api.routes.worlds.live_world import COMMANDS, WORLD, send, until
from tests.policies.untrained import untrained_reach


@pytest.fixture(scope="module", autouse=True)
def reach_cell(client: TestClient) -> Iterator[None]:
    shown = client.put(f"{WORLD}/cell", json={"cell": "shared-workspace"})
    assert shown.status_code == 200, shown.text
    send(client, tag="set-policy", checkpoint=None)
    yield
    client.put(f"{WORLD}/cell", json={"cell": "pick-and-place"}).raise_for_status()


def test_world_shows_goal_safety_layer_and_cylinders(client: TestClient) -> None:
    world = until(client, lambda one: one["checkpoint"] is None)
    reach, person = world["reach"], world["people"][0]
    assert (world["cell"], world["sorting"], world["candidates"]) == (
        "shared-workspace",
        None,
        [],
    )
    assert reach["tolerance"] == 0.1
    assert reach["inference_modes"] == []
    safety = world["safety"]
    total = safety["person_distance"] + safety["robot_distance"] + safety["margin"]
    assert safety["required"] == pytest.approx(total)
    assert 0.2 <= person["cylinder"]["radius"] <= 0.5
    assert world["state"] is None


def test_goal_safety_and_people_are_changed(client: TestClient) -> None:
    send(client, tag="set-goal-mode", mode="follow")
    assert send(client, tag="move-goal", position=[0.5, 0.6, 0.1]).status_code == 202
    send(client, tag="set-safety", on=False)
    send(client, tag="set-walking-speed", speed=0.25)
    send(client, tag="add-person")
    now = until(client, lambda one: one["reach"]["walk_speed"] == 0.25)
    until(client, lambda one: len(one["people"]) == 2)
    assert now["reach"]["goal"] == pytest.approx([0.5, 0.6, 0.1])
    assert (now["reach"]["goal_mode"], now["safety"]["on"]) == ("follow", False)
    send(client, tag="remove-person", person=1)
    send(client, tag="set-safety", on=True, use_measured_velocity=True)
    until(client, lambda one: one["safety"]["use_measured_velocity"])
    send(client, tag="set-walking-speed", speed=None)
    until(client, lambda one: len(one["people"]) == 1)
    send(client, tag="new-goal")
    until(client, lambda one: one["reach"]["goal"] != now["reach"]["goal"])


def test_policy_is_named_and_queried_in_its_inference_modes(client: TestClient) -> None:
    services = services_of(client)
    made = untrained_reach(width=32)
    put_checkpoint(services.store, to_store(made))
    assert send(client, tag="set-policy", checkpoint=made.sha256).status_code == 202
    acting = until(client, lambda one: one["checkpoint"] == made.sha256)
    assert acting["reach"]["inference_mode"] == "interpolated-rollout"
    assert "distance-weighted" in acting["reach"]["inference_modes"]
    assert send(client, tag="set-inference-mode", inference_mode="direct").status_code == 202
    until(client, lambda one: one["reach"]["inference_mode"] == "direct")
    refused = send(client, tag="set-inference-mode", inference_mode="sideways").json()
    assert (refused["field"], refused["choices"]) == (
        "inference_mode",
        acting["reach"]["inference_modes"],
    )
    send(client, tag="set-policy", checkpoint=None)
    until(client, lambda one: one["checkpoint"] is None)


@pytest.mark.parametrize(
    ("command", "field"),
    [
        ({"tag": "move-goal", "position": [0.0, 1.3, 0.3]}, "position.y"),
        ({"tag": "move-goal", "position": [0.0, 0.8]}, "position[2]"),
        ({"tag": "move-goal"}, "position"),
        ({"tag": "set-goal-mode", "mode": "run"}, "mode"),
        ({"tag": "set-safety", "on": "perhaps"}, "on"),
        ({"tag": "set-walking-speed", "speed": -1.0}, "speed"),
        ({"tag": "set-inference-mode", "inference_mode": "direct"}, "inference_mode"),
        ({"tag": "set-anthropometry", "stature": 50.0}, "tag"),
        ({"tag": "move-person", "left": [0.0, 0.0, 0.0]}, "left"),
        ({"tag": "toggle-goal", "id": "red-large"}, "tag"),
        ({"tag": "set-candidates", "ids": []}, "tag"),
        ({"tag": "set-policy", "checkpoint": "nobody"}, "checkpoint"),
    ],
)
def test_bad_command_is_refused_by_field(
    client: TestClient, command: dict[str, Any], field: str
) -> None:
    assert problem_of(client.post(COMMANDS, json=command))["field"] == field


def test_goal_outside_says_which_axis_and_by_how_much(client: TestClient) -> None:
    refused = send(client, tag="move-goal", position=[0.9, 0.8, 0.3]).json()
    assert refused["field"] == "position.x"
    assert "0.4 m outside" in refused["rule"]


def test_policy_that_chooses_tasks_cannot_reach(client: TestClient) -> None:
    refused = send(client, tag="set-policy", checkpoint="pick")
    assert refused.status_code in (409, 422)
    put = client.put(f"{WORLD}/cell", json={"cell": "shared-workspace", "checkpoint": "pick"})
    assert put.status_code in (409, 422)


def test_reach_commands_need_a_reach_cell(client: TestClient) -> None:
    client.put(f"{WORLD}/cell", json={"cell": "pick-and-place"}).raise_for_status()
    assert problem_of(send(client, tag="set-walking-speed", speed=0.5))["field"] == "tag"
    shown = client.put(f"{WORLD}/cell", json={"cell": "shared-workspace"})
    assert shown.status_code == 200
    assert shown.json()["checkpoint"] == pretrained.load(REACH_ALIAS).sha256
