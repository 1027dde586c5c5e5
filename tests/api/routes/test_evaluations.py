from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from app.store.engine import Store
from jobs.checkpoints import shipped
from tests.api.answers import problem_of
from tests.api.conftest import ADDRESS, require_description
from tests.support.idle_service import app_of, idle_service


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
