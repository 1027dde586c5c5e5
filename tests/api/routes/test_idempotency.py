"""The header Idempotency-Key on a service without supervisor and live worlds."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import sqlalchemy as sa
from fastapi.testclient import TestClient

from app.store.database import tables
from app.store.engine import Store
from tests.api.conftest import ADDRESS, require_description
from tests.support import workshop
from tests.support.idle_service import app_of, idle_service

TRAIN = {"kind": "train", "preset": "pick-td3", "step_budget": 1000}
KEY = {"Idempotency-Key": "z1"}


@pytest.fixture
def idle(store: Store, tmp_path: Path) -> Iterator[TestClient]:
    """A client of the routes; no job runs."""
    app = app_of(idle_service(store, tmp_path))
    with TestClient(app, base_url=ADDRESS) as client:
        client.event_hooks = {"response": [require_description]}
        yield client


@pytest.fixture
def ended(idle: TestClient) -> str:
    """Path of a training that was cancelled while it was queued."""
    job = idle.post("/v1/jobs", json={**TRAIN, "name": "first"}).json()
    path = f"/v1/jobs/{job['id']}"
    idle.post(f"{path}/cancel").raise_for_status()
    return path


@pytest.mark.parametrize(
    "change",
    [
        {"name": "second"},
        {"notes": "slow"},
        {"priority": 3},
        {"step_budget": 2000},
        {"step_budget": None},
        {"time_budget_s": 60},
    ],
    ids=str,
)
def test_key_of_another_body_is_a_conflict(idle: TestClient, change: dict[str, Any]) -> None:
    first = idle.post("/v1/jobs", json=TRAIN, headers=KEY).json()
    other = idle.post("/v1/jobs", json={**TRAIN, **change}, headers=KEY)
    assert other.status_code == 409
    assert "was submitted with another body" in other.json()["detail"]
    idle.patch(f"/v1/jobs/{first['id']}", json=change).raise_for_status()
    again = idle.post("/v1/jobs", json=TRAIN, headers=KEY)
    assert (again.status_code, again.json()["id"]) == (202, first["id"])


@pytest.mark.parametrize("action", ["retry", "clone"])
def test_repetition_is_the_same_job_after_its_parent_was_changed(
    idle: TestClient, ended: str, action: str
) -> None:
    first = idle.post(f"{ended}/{action}", json={}, headers=KEY).json()
    changes = {"name": "second", "priority": 3, "step_budget": 2000, "time_budget_s": 60}
    idle.patch(ended, json=changes).raise_for_status()
    again = idle.post(f"{ended}/{action}", json={}, headers=KEY)
    assert (again.status_code, again.json()["id"]) == (202, first["id"])


@pytest.mark.parametrize("action", ["retry", "clone"])
def test_repetition_is_the_same_job_after_its_parent_was_deleted(
    idle: TestClient, ended: str, action: str
) -> None:
    first = idle.post(f"{ended}/{action}", json={}, headers=KEY).json()
    idle.delete(ended).raise_for_status()
    again = idle.post(f"{ended}/{action}", json={}, headers=KEY)
    assert (again.status_code, again.json()["id"]) == (202, first["id"])
    assert again.headers["location"] == f"/v1/jobs/{first['id']}"
    other = idle.post(f"{ended}/clone", json={"seed": 1}, headers=KEY)
    assert other.status_code == 409
    new = idle.post(f"{ended}/{action}", json={}, headers={"Idempotency-Key": "z2"})
    assert new.status_code == 404


@pytest.mark.parametrize("action", ["", "/retry", "/clone"])
def test_repetition_is_the_same_job_after_its_cell_was_removed(
    idle: TestClient, action: str
) -> None:
    body, path = {**TRAIN, "overrides": {"cell": "workshop"}}, "/v1/jobs"
    idle.post("/v1/cells", json=workshop.definition()).raise_for_status()
    if action:
        parent = idle.post("/v1/jobs", json=body).json()
        idle.post(f"/v1/jobs/{parent['id']}/cancel").raise_for_status()
        body, path = {}, f"/v1/jobs/{parent['id']}{action}"
    first = idle.post(path, json=body, headers=KEY).json()
    idle.post(f"/v1/jobs/{first['id']}/cancel").raise_for_status()
    idle.delete("/v1/cells/workshop").raise_for_status()
    again = idle.post(path, json=body, headers=KEY)
    assert (again.status_code, again.json()["id"]) == (202, first["id"])
    refused = idle.post(path, json=body, headers={"Idempotency-Key": "z2"})
    assert (refused.status_code, refused.json()["field"]) == (422, "overrides.cell")


def test_repeated_retry_is_the_same_job_after_its_parent_was_resumed(
    idle: TestClient, ended: str, store: Store
) -> None:
    first = idle.post(f"{ended}/retry", headers=KEY).json()
    is_parent = tables.jobs.c.id == ended.rpartition("/")[2]
    with store.writing() as connection:
        queued = {"state": "queued", "cancel_requested": False}
        connection.execute(sa.update(tables.jobs).where(is_parent).values(queued))
    again = idle.post(f"{ended}/retry", headers=KEY)
    assert (again.status_code, again.json()["id"]) == (202, first["id"])
    assert idle.post(f"{ended}/retry").status_code == 409


@pytest.mark.parametrize(
    "change",
    [{"seed": 1}, {"name": "second"}, {"priority": 3}, {"step_budget": None}],
    ids=str,
)
def test_key_of_another_clone_is_a_conflict(
    idle: TestClient, ended: str, change: dict[str, Any]
) -> None:
    assert idle.post(f"{ended}/clone", json={}, headers=KEY).status_code == 202
    assert idle.post(f"{ended}/clone", json=change, headers=KEY).status_code == 409


@pytest.mark.parametrize("action", ["retry", "clone"])
def test_key_of_another_action_or_parent_is_a_conflict(
    idle: TestClient, ended: str, action: str
) -> None:
    assert idle.post(f"{ended}/{action}", json={}, headers=KEY).status_code == 202
    other = idle.post("/v1/jobs", json={**TRAIN, "name": "first"}).json()
    path = f"/v1/jobs/{other['id']}"
    idle.post(f"{path}/cancel").raise_for_status()
    assert idle.post(f"{path}/{action}", json={}, headers=KEY).status_code == 409
    different = {"retry": "clone", "clone": "retry"}[action]
    assert idle.post(f"{ended}/{different}", json={}, headers=KEY).status_code == 409
    assert idle.post("/v1/jobs", json=TRAIN, headers=KEY).status_code == 409
