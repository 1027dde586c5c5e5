from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from app.store import completion, jobs
from app.store.engine import Store
from app.store.records import Claim, NewJob
from jobs.checkpoints import shipped
from tests.api.answers import problem_of
from tests.api.conftest import ADDRESS, require_description
from tests.support.databases import claimed
from tests.support.idle_service import app_of, idle_service

ROW = {"name": "critic", "n": 2, "success": {"mean": 0.5, "low": 0.1, "high": 0.9}}
RESULT = {
    "protocol": "pick-single",
    "seed": 3,
    "episodes": 2,
    "results": [ROW],
    "cpu_seconds": 0.5,
}


@pytest.fixture
def idle(store: Store, tmp_path: Path) -> Iterator[TestClient]:
    """A service without workers."""
    with TestClient(app_of(idle_service(store, tmp_path)), base_url=ADDRESS) as one:
        one.event_hooks = {"response": [require_description]}
        yield one


def started(store: Store) -> Claim:
    """Return the attempt of a new evaluation."""
    jobs.create_job(store, NewJob(kind="evaluate", spec={"kind": "evaluate"}))
    return claimed(store)[0]


@pytest.fixture(scope="module")
def evaluated(client: TestClient) -> Iterator[dict[str, Any]]:
    """A succeeded evaluation of two episodes."""
    body = {"kind": "evaluate", "protocol": "pick-single", "episodes": 2, "seed": 3}
    job = client.post("/v1/jobs", json={**body, "name": "short", "priority": 100}).json()
    client.get(f"/v1/jobs/{job['id']}/events").raise_for_status()  # ends with the job
    found: dict[str, Any] = client.get(f"/v1/jobs/{job['id']}").json()
    assert found["state"] == "succeeded", found["error"]
    yield found
    client.delete(f"/v1/jobs/{job['id']}").raise_for_status()


def test_result_is_a_resource_with_checkpoint_seed_and_intervals(
    client: TestClient, evaluated: dict[str, Any]
) -> None:
    found = client.get(f"/v1/evaluations/{evaluated['id']}").json()
    pick = client.get("/v1/checkpoints/pick").json()["sha256"]
    assert (found["protocol"], found["checkpoint"]) == ("pick-single", pick)
    assert (found["seed"], found["episodes"], found["name"]) == (3, 2, "short")
    assert found["results"] == evaluated["result"]["results"]
    assert {"mean", "low", "high"} <= found["results"][0]["success"].keys()
    assert "results" not in found["conditions"]


def test_evaluations_are_listed_by_protocol_and_checkpoint(
    client: TestClient, evaluated: dict[str, Any]
) -> None:
    def listed(**query: str) -> list[str]:
        items = client.get("/v1/evaluations", params=query).json()["items"]
        return [one["id"] for one in items]

    assert evaluated["id"] in listed()
    assert listed(protocol="pick-single", checkpoint="pick") == [evaluated["id"]]
    assert listed(protocol="pick-cases") == []
    assert listed(checkpoint="reach") == []


@pytest.mark.parametrize(
    "body",
    [
        {"kind": "evaluate", "protocol": "pick-single"},
        {"kind": "evaluate", "protocol": "pick-single", "checkpoint": "pick"},
        {"kind": "report", "measure": True},
    ],
)
def test_job_of_a_shipped_checkpoint_that_is_not_stored_yet_is_to_be_posted_again(
    store: Store, tmp_path: Path, body: dict[str, Any]
) -> None:
    services = idle_service(store, tmp_path)
    with TestClient(app_of(services), base_url=ADDRESS) as starting:
        starting.event_hooks = {"response": [require_description]}
        services.readiness.reason = "warming up: loading the shipped checkpoints"
        refused = starting.post("/v1/jobs", json=body)
        assert problem_of(refused, 503)["detail"] == services.readiness.reason
        assert refused.headers["Retry-After"] == "2"
        for alias in ("pick", "reach", "sorting-e0", "sorting-e1"):
            services.checkpoints.publish(alias, shipped(alias))
        assert starting.post("/v1/jobs", json=body).status_code == 202


def test_unknown_names_are_refused(client: TestClient) -> None:
    refused = client.get("/v1/evaluations", params={"protocol": "pick-luck"})
    assert refused.status_code == 422
    assert "pick-single" in refused.json()["choices"]
    assert client.get("/v1/evaluations/nothing").status_code == 404
    body = {"kind": "train", "preset": "pick-td3", "priority": -100}
    job = client.post("/v1/jobs", json=body).json()
    client.post(f"/v1/jobs/{job['id']}/cancel")
    assert client.get(f"/v1/evaluations/{job['id']}").status_code == 404


@pytest.mark.parametrize("result", [{}, {"results": "none"}])
def test_damaged_result_keeps_no_other_evaluation_from_being_listed(
    store: Store, idle: TestClient, result: dict[str, Any]
) -> None:
    sound, damaged = started(store), started(store)
    completion.finish(store, sound, result=RESULT)
    completion.finish(store, damaged, result=result)
    items = idle.get("/v1/evaluations").json()["items"]
    assert [(one["id"], one["results"]) for one in items] == [(sound.job_id, [ROW])]
    problem = problem_of(idle.get(f"/v1/evaluations/{damaged.job_id}"), 404)
    assert problem["name"] == damaged.job_id


@pytest.mark.parametrize(
    ("result", "field"),
    [
        (None, "result"),
        ({}, "result.protocol"),
        ({**RESULT, "results": "none"}, "result.results"),
        ({**RESULT, "results": []}, "result.results"),
        ({**RESULT, "results": [{"n": 2}]}, "result.results[0].name"),
        ({**RESULT, "checkpoint": 5}, "result.checkpoint"),
    ],
)
def test_end_of_an_evaluation_with_the_result_of_none_is_refused(
    store: Store, idle: TestClient, result: object, field: str
) -> None:
    claim = started(store)
    path = f"/v1/jobs/{claim.job_id}/attempts/{claim.attempt}/end"
    refused = idle.post(path, json={"state": "succeeded", "result": result})
    assert problem_of(refused, 422)["field"] == field
    assert jobs.get_job(store, claim.job_id).state == "running"
    ended = idle.post(path, json={"state": "succeeded", "result": {**RESULT, "more": [1]}})
    assert ended.status_code == 204
    found = idle.get(f"/v1/evaluations/{claim.job_id}").json()
    assert (found["results"], found["conditions"]) == ([ROW], {"more": [1]})
