from typing import Any

import pytest
from fastapi.testclient import TestClient

from tests.api.answers import post_json, problem_of
from tests.api.routes.worlds.live_world import COMMANDS, WORLD, send, until
from tests.sim.recorded_person import csv_text, working
from tests.support import workshop


@pytest.fixture(autouse=True)
def fresh(client: TestClient) -> None:
    send(client, tag="set-mode", mode="manual")
    send(client, tag="reset")
    send(client, tag="resume")
    until(client, lambda world: not world["paused"] and world["mode"] == "manual")


def test_worlds_are_listed_with_their_viewer(client: TestClient) -> None:
    listed = client.get("/v1/worlds").json()["items"]
    assert [(one["id"], one["viewer"]) for one in listed] == [("main", "/viewer/main/")]


def test_clock_runs_until_it_is_paused(client: TestClient) -> None:
    start = client.get(WORLD).json()["tick"]
    until(client, lambda world: world["tick"] > start)
    accepted = send(client, tag="pause")
    assert accepted.status_code == 202
    paused = until(client, lambda world: world["paused"])
    assert client.get(WORLD).json()["tick"] == paused["tick"]


def test_step_advances_a_paused_world_by_one_period(client: TestClient) -> None:
    send(client, tag="pause")
    before = until(client, lambda world: world["paused"])
    send(client, tag="step")
    after = until(client, lambda world: world["tick"] > before["tick"])
    assert after["tick"] == before["tick"] + 1
    assert after["t_s"] - before["t_s"] == pytest.approx(0.05)


def test_clock_runs_faster_when_asked_and_not_at_any_speed(client: TestClient) -> None:
    send(client, tag="set-speed", factor=2)
    until(client, lambda world: world["speed"] == 2)
    send(client, tag="set-speed", factor=1)
    until(client, lambda world: world["speed"] == 1)
    refused = send(client, tag="set-speed", factor=3)
    assert refused.status_code == 422
    assert "factor" in refused.text


def test_candidates_are_toggled(client: TestClient) -> None:
    before = client.get(WORLD).json()["selected"]
    send(client, tag="toggle-candidate", id=before[0])
    until(client, lambda world: before[0] not in world["selected"])
    send(client, tag="set-candidates", ids=before)
    until(client, lambda world: world["selected"] == before)


def test_person_is_moved(client: TestClient) -> None:
    pelvis = [0.3, 1.5, -1.5708]
    send(client, tag="move-person", pelvis=pelvis)
    moved = until(
        client, lambda world: abs(world["state"]["people"][0]["q"][0] - pelvis[0]) < 0.02
    )
    assert moved["mode"] == "manual"


def test_acting_checkpoint_is_changed(client: TestClient) -> None:
    send(client, tag="set-policy", checkpoint=None)
    until(client, lambda world: world["checkpoint"] is None)
    send(client, tag="set-policy", checkpoint="pick")
    until(client, lambda world: world["checkpoint"] is not None)


def test_checkpoint_that_acts_is_not_deleted(client: TestClient) -> None:
    observed = [{"success": 0.8, "contact": 0.1, "outcome": "success"}] * 30
    made = client.post("/v1/checkpoints/pick/recalibration", json={"outcomes": observed})
    own = made.json()["sha256"]
    client.post(COMMANDS, json={"tag": "set-policy", "checkpoint": own})
    until(client, lambda world: world["checkpoint"] == own)
    refused = client.delete(f"/v1/checkpoints/{own}")
    assert (refused.status_code, refused.json()["field"]) == (409, "checkpoint")
    assert "acts in world main" in refused.json()["rule"]
    client.post(COMMANDS, json={"tag": "set-policy", "checkpoint": "pick"})
    until(client, lambda world: world["checkpoint"] != own)
    assert client.delete(f"/v1/checkpoints/{own}").status_code == 204


def test_case_study_is_started(client: TestClient) -> None:
    case = client.get("/v1/cells/pick-and-place").json()["cases"][0]
    send(client, tag="start-case", id=case["id"])
    started = until(client, lambda world: world["case"] == case["id"])
    assert sorted(started["selected"]) == sorted(case["goals"])


def test_second_person_works_and_the_state_repeats_the_choice(client: TestClient) -> None:
    send(client, tag="add-person")
    send(client, tag="set-anthropometry", person=1, stature=95, arms=20)

    def there(now: dict[str, Any]) -> bool:
        tall = len(now["people"]) == 2 and now["people"][1]["anthropometry"]["stature"] == 95
        return tall and now["status"] == "moving"

    try:
        world = until(client, there)
        assert [one["id"] for one in world["people"]] == [0, 1]
        assert sum(one["nearest"] for one in world["people"]) == 1
        body = world["people"][1]["anthropometry"]
        assert (body["stature"], body["arms"], body["shoulders"]) == (95, 20, 50)
        assert body["stature_m"] == pytest.approx(1.87, abs=0.01)
        assert len(world["state"]["people"]) == 2
        asked = client.post("/v1/task-selection", json=world["state"]).json()
        assert asked["chosen"] == world["chosen"]
        values = {one["id"]: one["value"] for one in world["candidates"]}
        assert {one["id"]: one["value"] for one in asked["candidates"]} == values
    finally:
        send(client, tag="remove-person", person=1)
        send(client, tag="set-anthropometry", stature=50)
    until(client, lambda now: len(now["people"]) == 1)


def test_imported_motion_is_played(client: TestClient) -> None:
    posted = client.post(
        "/v1/recordings",
        params={"file_name": "played.csv"},
        content=csv_text(working()),
        headers={"Content-Type": "text/csv"},
    )
    assert posted.status_code == 201
    try:
        send(client, tag="set-motion", name="played")
        moving = until(
            client, lambda now: (now["people"][0]["motion"] or {}).get("t_s", 0) > 0.3
        )
        assert moving["mode"] == "recorded"
        motion = moving["people"][0]["motion"]
        assert (motion["name"], motion["run"], motion["n_runs"]) == ("played", 0, 1)
        assert motion["duration_s"] == pytest.approx(3.98)
        assert moving["people"][0]["anthropometry"]["recorded"]
        refused = send(client, tag="set-motion", name="played", run=4)
        assert (refused.status_code, refused.json()["field"]) == (422, "run")
        assert refused.json()["rule"].startswith("is not a run of this recording")
        unknown = send(client, tag="set-motion", name="unknown").json()
        assert (unknown["field"], unknown["choices"]) == ("name", ["played"])
        assert unknown["rule"] == "is not a stored recording"
    finally:
        client.delete("/v1/recordings/played")


@pytest.mark.parametrize(
    ("command", "field"),
    [
        ({"tag": "set-mode", "mode": "recorded"}, "mode"),
        ({"tag": "set-mode", "mode": "auto", "person": 1}, "person"),
        ({"tag": "move-person", "person": -1}, "person"),
        ({"tag": "remove-person"}, "person"),
        ({"tag": "set-anthropometry", "stature": 100}, "stature"),
        ({"tag": "set-anthropometry", "arms": 0.5}, "arms"),
        ({"tag": "set-motion", "name": "nothing-there"}, "name"),
        ({"tag": "set-motion", "name": "x", "run": -1}, "run"),
        ({"tag": "fly"}, "tag"),
        ({}, "tag"),
        ({"tag": "set-mode", "mode": "wild"}, "mode"),
        ({"tag": "toggle-candidate", "id": "cube9"}, "id"),
        ({"tag": "set-candidates", "ids": ["cube0", "x"]}, "ids[1]"),
        ({"tag": "start-case", "id": "case-9"}, "id"),
        ({"tag": "set-policy", "checkpoint": "best"}, "checkpoint"),
        ({"tag": "move-person", "pelvis": [0.0, 1.0]}, "pelvis[2]"),
        ({"tag": "pause", "why": "tea"}, "why"),
    ],
)
def test_bad_command_is_refused_by_field(
    client: TestClient, command: dict[str, Any], field: str
) -> None:
    assert problem_of(client.post(COMMANDS, json=command))["field"] == field


def test_infinite_position_is_refused(client: TestClient) -> None:
    body = '{"tag": "move-person", "right": [Infinity, 0.0, 0.3]}'
    assert problem_of(post_json(client, COMMANDS, body))["field"] == "right[0]"


def test_unknown_world_is_not_found(client: TestClient) -> None:
    for path in ("", "/events"):
        answer = client.get(f"/v1/worlds/other{path}")
        assert answer.status_code == 404
        assert answer.json()["known"] == ["main"]


def test_world_restarts_in_a_cell_of_the_user(client: TestClient) -> None:
    slower = {**workshop.definition()["robot"], "qd_max": [0.4] * 6}
    cell = workshop.definition(name="untrained", robot=slower)
    client.post("/v1/cells", json=cell).raise_for_status()
    try:
        answer = client.put(f"{WORLD}/cell", json={"cell": "untrained"})
        assert answer.status_code == 200
        assert (answer.json()["cell"], answer.json()["checkpoint"]) == ("untrained", None)
        shown = until(client, lambda world: world["tick"] > 1)
        assert (shown["status"], shown["selected"][0]) == ("no policy", "part0")
        assert client.get("/viewer/main/").status_code == 200
        assert client.delete("/v1/cells/untrained").status_code == 409
        refused = send(client, tag="set-policy", checkpoint="pick")
        assert refused.status_code == 422
        assert send(client, tag="start-case", id="case-1").status_code == 422
    finally:
        back = client.put(f"{WORLD}/cell", json={"cell": "pick-and-place"})
    assert back.json()["checkpoint"] is not None
    assert client.delete("/v1/cells/untrained").status_code == 204
    until(client, lambda world: world["chosen"] is not None)


@pytest.mark.parametrize(
    ("body", "field"),
    [
        ({"cell": "kitchen"}, "cell"),
        ({"cell": "shared-workspace", "checkpoint": "nobody"}, "checkpoint"),
        ({"cell": "pick-and-place", "checkpoint": "nobody"}, "checkpoint"),
        ({}, "cell"),
    ],
)
def test_world_stays_as_it_is_when_a_cell_is_refused(
    client: TestClient, body: dict[str, str], field: str
) -> None:
    before = client.get(WORLD).json()
    problem = problem_of(client.put(f"{WORLD}/cell", json=body))
    assert problem["field"] == field
    assert body.get("cell") != "kitchen" or "pick-and-place" in problem["choices"]
    after = client.get(WORLD).json()
    assert (after["cell"], after["checkpoint"]) == (before["cell"], before["checkpoint"])
    assert after["tick"] >= before["tick"]
