import json
from collections.abc import Iterator
from typing import Any

import pytest
from fastapi.testclient import TestClient

from app.sim.cells.cell import cell_names
from tests.api.answers import post_json, problem_of
from tests.support import workshop


@pytest.fixture
def added(client: TestClient) -> Iterator[dict[str, Any]]:
    """The answer to a cell that was posted; the cell is removed again."""
    answer = client.post("/v1/cells", json=workshop.definition())
    assert answer.status_code == 201
    assert answer.headers["Location"] == "/v1/cells/workshop"
    yield answer.json()
    client.delete("/v1/cells/workshop")


def test_cells_are_listed_with_stations_and_case_studies(client: TestClient) -> None:
    cell = client.get("/v1/cells").json()["items"][0]
    assert cell["name"] == "pick-and-place"
    names = [station["id"] for station in cell["stations"]]
    assert {"cube0", "cube5", "dock0", "dock1"} <= set(names)
    assert [case["id"] for case in cell["cases"]] == ["case-1", "case-2", "case-3", "case-4"]
    assert client.get("/v1/cells/pick-and-place").json() == cell


def test_shipped_cells_say_what_they_are_for(client: TestClient) -> None:
    cells = {cell["name"]: cell for cell in client.get("/v1/cells").json()["items"]}
    assert tuple(cells) == cell_names()
    assert all(cell["shipped"] for cell in cells.values())
    assert cells["pick-and-place"]["lacks_for_pick"] is None
    assert "kind cube" in cells["sorting-e1"]["lacks_for_pick"]
    assert cells["shared-workspace"]["people"][0]["kind"] == "walker"


def test_unknown_cell_is_not_found_with_the_known_ones(client: TestClient) -> None:
    problem = problem_of(client.get("/v1/cells/kitchen"), 404)
    assert problem["known"] == list(cell_names())


def test_own_cell_is_kept_listed_and_removed(client: TestClient, added: dict[str, Any]) -> None:
    assert (added["shipped"], added["cases"]) == (False, [])
    assert client.get("/v1/cells/workshop").json() == added
    assert client.get("/v1/cells").json()["items"][-1] == added
    assert client.delete("/v1/cells/workshop").status_code == 204
    assert client.get("/v1/cells/workshop").status_code == 404


def test_same_cell_again_is_fine_and_a_changed_one_a_conflict(
    client: TestClient, added: dict[str, Any]
) -> None:
    assert client.post("/v1/cells", json=workshop.definition()).status_code == 200
    changed = client.post("/v1/cells", json=workshop.definition(title="Changed"))
    assert changed.status_code == 409
    assert "remove it first" in changed.json()["detail"]
    assert (changed.json()["field"], changed.json()["value"]) == ("name", "'workshop'")
    assert client.get("/v1/cells/workshop").json() == added


def test_shipped_cell_can_be_neither_replaced_nor_removed(client: TestClient) -> None:
    own = workshop.definition(name="pick-and-place")
    taken = problem_of(client.post("/v1/cells", json=own), 409)
    assert (taken["field"], taken["value"]) == ("name", "'pick-and-place'")
    assert client.delete("/v1/cells/pick-and-place").status_code == 409


def test_all_faults_of_a_cell_come_back_at_once(client: TestClient) -> None:
    cell = workshop.definition()
    cell["stations"][0]["position"] = [-450, 620, 120]
    cell["robot"]["dt"] = 50.0
    cell["wheels"] = 4
    problem = problem_of(client.post("/v1/cells", json=cell))
    assert problem["type"] == "urn:tandem:problem:invalid-input"
    errors = {error["field"]: error for error in problem["errors"]}
    assert set(errors) == {
        "wheels",
        "robot.dt",
        *(f"stations.part0.position[{axis}]" for axis in range(3)),
    }
    assert "millimetres" in errors["stations.part0.position[0]"]["hint"]
    assert problem["field"] == problem["errors"][0]["field"]


@pytest.mark.parametrize(
    ("content", "rule"),
    [
        (b"{", "must be JSON"),
        (b"", "must be JSON"),
        (b"\xff", "must be text in UTF-8"),
        (b" " * 300_000, "must have at most 262144 bytes"),
        (b"[" * 5000, "must be nested at most"),
    ],
)
def test_body_that_is_no_cell_is_named(client: TestClient, content: bytes, rule: str) -> None:
    assert rule in problem_of(post_json(client, "/v1/cells", content))["detail"]


def test_description_of_the_api_tells_the_fields_of_a_cell(client: TestClient) -> None:
    api = client.get("/openapi.json").json()
    body = api["paths"]["/v1/cells"]["post"]["requestBody"]["content"]["application/json"]
    assert "[rad/s]" in json.dumps(body["schema"]["properties"]["robot"])
    assert "$ref" not in json.dumps(body)
    length = body["schema"]["properties"]["robot"]["properties"]["tool_length"]
    assert (length["minimum"], length["maximum"]) == (0.01, 0.6)


def test_training_form_offers_cells_once_there_is_a_choice(
    client: TestClient, added: dict[str, Any]
) -> None:
    field = client.get("/v1/presets").json()["items"][0]["fields"][0]
    assert (field["name"], field["default"]) == ("cell", "pick-and-place")
    assert field["choices"] == ["pick-and-place", added["name"]]


def test_job_in_a_cell_that_cannot_be_trained_in_is_refused(client: TestClient) -> None:
    for name, rule in (
        ("kitchen", "is not a known"),
        ("sorting-e0", "cannot be trained in"),
        (3, ""),
    ):
        body = {"kind": "train", "preset": "pick-td3", "overrides": {"cell": name}}
        problem = problem_of(client.post("/v1/jobs", json=body))
        assert problem["field"] == "overrides.cell" and rule in problem["rule"]


def test_cell_with_a_waiting_job_cannot_be_removed(
    client: TestClient, added: dict[str, Any]
) -> None:
    body = {"kind": "train", "preset": "pick-td3", "overrides": {"cell": added["name"]}}
    job = client.post("/v1/jobs", json=body).json()
    refused = client.delete("/v1/cells/workshop")
    client.post(f"/v1/jobs/{job['id']}/cancel")
    assert (refused.status_code, refused.json()["field"]) == (409, "cell")
    assert f"job {job['number']}" in refused.json()["rule"]


def test_job_may_name_a_shipped_cell(client: TestClient) -> None:
    body = {"kind": "train", "preset": "pick-td3", "overrides": {"cell": "pick-and-place"}}
    posted = client.post("/v1/jobs", json=body)
    assert posted.status_code == 202
    client.post(f"/v1/jobs/{posted.json()['id']}/cancel").raise_for_status()
