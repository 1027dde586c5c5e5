from typing import Any

import pytest
import sqlalchemy as sa
from fastapi.testclient import TestClient

from app.main import acting_in
from app.store.database import tables
from tests.api.answers import problem_of
from tests.api.conftest import services_of

TRAIN = {"kind": "train", "preset": "pick-td3", "seed": 1, "priority": -100}


@pytest.fixture
def ended(client: TestClient) -> dict[str, Any]:
    """A training that was cancelled before it could start or learn."""
    overrides = {"learning": {"gamma": 0.97, "total_steps": 40960}}
    body = {**TRAIN, "overrides": overrides, "name": "first"}
    job = client.post("/v1/jobs", json=body).json()
    return cancelled(client, job)


def cancelled(client: TestClient, job: dict[str, Any]) -> dict[str, Any]:
    client.post(f"/v1/jobs/{job['id']}/cancel").raise_for_status()
    client.get(f"/v1/jobs/{job['id']}/events").raise_for_status()  # ends with the job
    found: dict[str, Any] = client.get(f"/v1/jobs/{job['id']}").json()
    assert found["state"] == "cancelled"
    return found


def test_labels_of_a_posted_job_are_not_part_of_its_spec(ended: dict[str, Any]) -> None:
    assert (ended["name"], ended["priority"]) == ("first", -100)
    assert ended["spec"].keys() == {"kind", "preset", "seed", "overrides"}


def test_retry_queues_a_new_job_with_the_same_spec(
    client: TestClient, ended: dict[str, Any]
) -> None:
    answer = client.post(f"/v1/jobs/{ended['id']}/retry")
    job = answer.json()
    assert answer.status_code == 202
    assert answer.headers["location"] == f"/v1/jobs/{job['id']}"
    assert (job["parent"], job["spec"], job["name"]) == (ended["id"], ended["spec"], "first")
    again = client.post(f"/v1/jobs/{ended['id']}/retry")
    assert again.status_code == 409
    assert again.json()["field"] == "state" and f"of job {job['number']}" in again.text
    cancelled(client, job)


@pytest.mark.parametrize("action", ["retry", "resume"])
def test_job_that_has_not_ended_is_not_repeated(client: TestClient, action: str) -> None:
    job = client.post("/v1/jobs", json=TRAIN).json()
    problem = problem_of(client.post(f"/v1/jobs/{job['id']}/{action}"), 409)
    assert (problem["field"], problem["choices"]) == ("state", ["cancelled", "failed"])
    assert problem["value"] in ("'queued'", "'running'")
    cancelled(client, job)


def test_job_without_a_state_says_what_to_do(client: TestClient, ended: dict[str, Any]) -> None:
    assert ended["resume_step"] is None
    problem = problem_of(client.post(f"/v1/jobs/{ended['id']}/resume"), 409)
    assert problem["field"] == "resume_step" and "retry it" in problem["detail"]


def test_clone_merges_changes_into_the_spec(client: TestClient, ended: dict[str, Any]) -> None:
    changes = {
        "seed": 2,
        "name": "second",
        "overrides": {"learning": {"gamma": None, "n_envs": 64}},
    }
    answer = client.post(f"/v1/jobs/{ended['id']}/clone", json={**changes, "priority": -100})
    job = answer.json()
    assert answer.status_code == 202
    assert job["overrides"] == {"learning": {"total_steps": 40960, "n_envs": 64}}
    assert (job["seed"], job["name"], job["parent"]) == (2, "second", ended["id"])
    assert job["preset"] == ended["preset"]
    cancelled(client, job)


@pytest.mark.parametrize(
    ("changes", "field", "text"),
    [
        ({"seed": -1}, "seed", "at least 0"),
        ({"kind": "evaluate"}, "kind", "train"),
        ({"preset": None}, "preset", "required"),
        ({"colour": "red"}, "colour", "priority"),
        ({"priority": 101}, "priority", "100"),
        ({"name": "two\nlines"}, "name", "match"),
        ({"overrides": {"learning": {"gamma": 2.0}}}, "overrides.learning.gamma", "1"),
    ],
)
def test_bad_change_is_refused_by_field(
    client: TestClient, ended: dict[str, Any], changes: dict[str, Any], field: str, text: str
) -> None:
    problem = problem_of(client.post(f"/v1/jobs/{ended['id']}/clone", json=changes))
    assert problem["field"] == field and text in str(problem)


def test_labels_are_changed_and_removed(client: TestClient, ended: dict[str, Any]) -> None:
    path = f"/v1/jobs/{ended['id']}"
    changed = client.patch(path, json={"notes": " a baseline ", "priority": 7}).json()
    assert (changed["name"], changed["notes"], changed["priority"]) == (
        "first",
        "a baseline",
        7,
    )
    removed = client.patch(path, json={"name": None, "notes": ""}).json()
    assert (removed["name"], removed["notes"], removed["priority"]) == (None, None, 7)
    assert client.get(path).json() == removed
    refused = client.patch(path, json={"priority": 1.5})
    assert refused.status_code == 422 and refused.json()["field"] == "priority"
    long = client.patch(path, json={"name": 81 * "x"}).json()
    assert (long["field"], long["rule"]) == ("name", "must have at most 80 characters")


def test_budgets_are_given_changed_and_kept_by_repetitions(client: TestClient) -> None:
    budgets = {"step_budget": 51200, "time_budget_s": 600}
    job = cancelled(client, client.post("/v1/jobs", json={**TRAIN, **budgets}).json())
    path = f"/v1/jobs/{job['id']}"
    assert (job["step_budget"], job["time_budget_s"], job["ended_by"]) == (51200, 600.0, None)
    assert job["spec"].keys() == {"kind", "preset", "seed"}
    clone = client.post(f"{path}/clone", json={"time_budget_s": None, "priority": -100}).json()
    assert (clone["step_budget"], clone["time_budget_s"]) == (51200, None)
    changed = client.patch(path, json={"step_budget": None}).json()
    assert (changed["step_budget"], changed["time_budget_s"]) == (None, 600.0)
    cancelled(client, clone)


@pytest.mark.parametrize(
    ("budget", "field"),
    [
        ({"step_budget": 0}, "step_budget"),
        ({"step_budget": 1.5}, "step_budget"),
        ({"time_budget_s": "1 h"}, "time_budget_s"),
        ({"time_budget_s": 0.1}, "time_budget_s"),
        ({"priority": 3}, "priority"),
    ],
)
def test_bad_budget_is_refused_by_field(
    client: TestClient, ended: dict[str, Any], budget: dict[str, Any], field: str
) -> None:
    answer = client.post(f"/v1/jobs/{ended['id']}/resume", json=budget)
    assert (answer.status_code, answer.json()["field"]) == (422, field)


def test_evaluation_has_no_budget(client: TestClient) -> None:
    body = {"kind": "evaluate", "protocol": "pick-single", "episodes": 2, "priority": -100}
    refused = client.post("/v1/jobs", json={**body, "step_budget": 10})
    assert (refused.status_code, refused.json()["field"]) == (422, "step_budget")
    job = cancelled(client, client.post("/v1/jobs", json=body).json())
    answer = client.patch(f"/v1/jobs/{job['id']}", json={"time_budget_s": 60})
    assert (answer.status_code, answer.json()["field"]) == (422, "time_budget_s")


def test_evaluation_is_retried_with_the_checkpoint_that_its_alias_named(
    client: TestClient,
) -> None:
    sha256 = client.get("/v1/checkpoints/pick").json()["sha256"]
    client.put("/v1/aliases/mine", json={"checkpoint": sha256}).raise_for_status()
    body = {"kind": "evaluate", "protocol": "pick-single", "episodes": 2, "priority": -100}
    job = cancelled(client, client.post("/v1/jobs", json=body | {"checkpoint": "mine"}).json())
    client.delete("/v1/aliases/mine").raise_for_status()
    again = client.post(f"/v1/jobs/{job['id']}/retry").json()
    assert again["checkpoint"] == job["checkpoint"] == sha256
    cancelled(client, again)


@pytest.mark.parametrize("action", ["retry", "clone"])
def test_older_evaluation_without_policy_is_repeated_without_its_checkpoint(
    client: TestClient, action: str
) -> None:
    body = {"kind": "evaluate", "protocol": "safety-ssm", "episodes": 2, "priority": -100}
    job = cancelled(client, client.post("/v1/jobs", json=body).json())
    older = sa.update(tables.jobs).where(tables.jobs.c.id == job["id"])
    with services_of(client).store.writing() as connection:
        connection.execute(older.values(spec={**job["spec"], "checkpoint": "pick"}))
    answer = client.post(f"/v1/jobs/{job['id']}/{action}", json={"priority": -100})
    assert answer.status_code == 202, answer.text
    assert answer.json()["spec"]["checkpoint"] is None
    cancelled(client, answer.json())


def test_actions_on_an_unknown_job_are_not_found(client: TestClient) -> None:
    for action in ("cancel", "resume", "retry", "clone"):
        assert client.post(f"/v1/jobs/nothing/{action}", json={}).status_code == 404
    assert client.patch("/v1/jobs/nothing", json={}).status_code == 404


def test_ended_job_is_deleted_a_queued_one_is_not(
    client: TestClient, ended: dict[str, Any]
) -> None:
    job = client.post(f"/v1/jobs/{ended['id']}/clone", json={"priority": -100}).json()
    refused = problem_of(client.delete(f"/v1/jobs/{job['id']}"), 409)
    assert refused["field"] == "state"
    assert refused["choices"] == ["succeeded", "failed", "cancelled"]
    assert client.delete(f"/v1/jobs/{ended['id']}").status_code == 204
    assert client.get(f"/v1/jobs/{ended['id']}").status_code == 404
    assert client.delete(f"/v1/jobs/{ended['id']}").status_code == 404
    assert cancelled(client, job)["parent"] == ended["id"]


def test_acting_checkpoints_are_known_with_their_place(client: TestClient) -> None:
    worlds = services_of(client).worlds
    acting = client.get("/v1/worlds/main").json()["checkpoint"]
    assert acting_in(worlds)[acting] == "world main"


def test_jobs_are_compared_by_what_differs(client: TestClient, ended: dict[str, Any]) -> None:
    job = client.post(f"/v1/jobs/{ended['id']}/clone", json={"seed": 2}).json()
    query = {"job": [ended["id"], job["id"]]}
    found = client.get("/v1/comparison", params=query).json()
    assert found["differences"] == [{"field": "seed", "values": [1, 2]}]
    assert [group["jobs"] for group in found["groups"]] == [query["job"]]
    table = client.get("/v1/comparison/csv", params=query)
    assert table.headers["content-type"].startswith("text/csv")
    assert table.text.startswith("job,number,name,preset,seed,step")
    twice = client.get("/v1/comparison", params={"job": [job["id"]] * 2})
    assert (twice.status_code, twice.json()["field"]) == (422, "job[1]")
    assert client.get("/v1/comparison", params={"job": "gone"}).status_code == 404
    cancelled(client, job)
