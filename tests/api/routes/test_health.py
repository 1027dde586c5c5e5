import sqlite3
import threading
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from app.api.routes import health
from app.api.schemas.examples import MOTION, PLAN, RISK_MAP, SORTING, TASK_SELECTION
from app.errors import Conflict
from app.live.commands import SetCandidates, SetPolicy
from app.main import create_app
from app.settings import Settings
from app.sim.cells.cell import Cell, load_cell
from app.sim.pick.task_policy import Decision
from tests.api.conftest import ADDRESS, services_of, wait_until_ready
from tests.api.live_server import WARM_UP_S
from tests.support.straight_policy import StraightPolicy
from tests.support.waiting import wait_until
from web.viewer.loop import LiveCell

SMALL = {"learning": {"n_envs": 8, "batch_size": 16}, "networks": {"width": 16}}
"""A training that begins and ends quickly; it is stopped long before its end."""
DECISIONS = {
    "/v1/motion": MOTION,
    "/v1/plan": PLAN,
    "/v1/risk-map": RISK_MAP,
    "/v1/sorting": SORTING,
    "/v1/task-selection": TASK_SELECTION,
}
"""Examples of requests by route."""


def test_service_that_is_ready_says_so(client: TestClient) -> None:
    assert client.get("/healthz").json() == {"status": "ok", "worlds": ["main"]}
    assert client.get("/readyz").status_code == 200


def test_service_says_that_it_warms_up_and_then_decides(cold_app_settings: Settings) -> None:
    with TestClient(create_app(cold_app_settings), base_url=ADDRESS) as cold:
        first = cold.get("/readyz")
        assert first.status_code == 503
        assert first.headers["retry-after"] == "2"
        assert "warming up" in first.json()["detail"]
        assert cold.get("/healthz").json() == {"status": "ok", "worlds": []}
        assert cold.get("/v1/worlds/main").status_code == 503
        assert cold.get("/").status_code == 200
        wait_until_ready(cold)
        assert cold.get("/v1/worlds/main").status_code == 200
        assert cold.post("/v1/task-selection", json=TASK_SELECTION).status_code == 200


@pytest.mark.parametrize("path", DECISIONS)
def test_decisions_are_refused_until_the_service_is_ready(
    client: TestClient, monkeypatch: pytest.MonkeyPatch, path: str
) -> None:
    with monkeypatch.context() as cold:
        cold.setattr(services_of(client).readiness, "ready", False)
        refused = client.post(path, json=DECISIONS[path])
        assert (refused.status_code, refused.headers.get("retry-after")) == (503, "2")
        assert refused.json()["type"] == "urn:tandem:problem:not-ready"
    assert client.post(path, json=DECISIONS[path]).status_code == 200


class HangingPolicy(StraightPolicy):
    """A policy whose decision does not end before it is released."""

    def __init__(self, cell: Cell) -> None:
        super().__init__(cell)
        self.released = threading.Event()

    def decide(self, *state: Any, **terms: Any) -> Decision:
        self.released.wait()
        return super().decide(*state, **terms)


@pytest.fixture
def other(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> Iterator[LiveCell]:
    """A second live world, which counts as stalled soon."""
    monkeypatch.setattr(health, "STALLED_S", 1.0)
    live = LiveCell(load_cell("pick-and-place"), None, id="other")
    live.start()
    services_of(client).worlds["other"] = live
    yield live
    services_of(client).worlds.pop("other").stop()


def test_readiness_names_a_live_world_whose_loop_hangs_until_it_is_replaced(
    client: TestClient, other: LiveCell
) -> None:
    before = datetime.now(UTC) - timedelta(seconds=30)
    hanging = HangingPolicy(other.cell)
    other.handle.submit(SetCandidates(ids=("cube1",)))
    other.handle.submit(SetPolicy(checkpoint="hanging").with_loaded(hanging))
    found = wait_until(
        lambda: client.get("/readyz").json(), lambda now: now["status"] == "degraded"
    )
    assert list(found["stalled"]) == ["other"]
    last_tick = datetime.fromisoformat(found["stalled"]["other"])
    assert before < last_tick < datetime.now(UTC) - timedelta(seconds=health.STALLED_S)
    assert client.get("/readyz").status_code == 200
    assert client.get("/healthz").status_code == 200
    started = client.put("/v1/worlds/other/cell", json={"cell": other.cell.name})
    assert started.status_code == 200
    hanging.released.set()
    wait_until(lambda: "stalled" not in client.get("/readyz").json())


def test_readiness_names_a_live_world_whose_thread_has_ended(
    client: TestClient, other: LiveCell
) -> None:
    wait_until(lambda: "stalled" not in client.get("/readyz").json())
    other.stop()
    wait_until(lambda: list(client.get("/readyz").json().get("stalled", ())) == ["other"])


def test_second_app_on_the_same_database_is_refused(cold_app_settings: Settings) -> None:
    with TestClient(create_app(cold_app_settings), base_url=ADDRESS):
        second = TestClient(create_app(cold_app_settings), base_url=ADDRESS)
        with pytest.raises(Conflict, match="another Tandem server"), second:
            pass


def test_app_can_be_started_again_after_it_was_closed(cold_app_settings: Settings) -> None:
    for _ in range(2):
        with TestClient(create_app(cold_app_settings), base_url=ADDRESS) as one:
            assert one.get("/v1/jobs").status_code == 200


def test_list_of_jobs_says_that_the_database_is_locked_and_the_start_waits(
    tmp_path: Path,
) -> None:
    file = tmp_path / "tandem.db"
    settings = Settings(data=tmp_path, database_url=f"sqlite:///{file}?timeout=0.2")
    with TestClient(create_app(settings), base_url=ADDRESS) as cold:
        body = {"kind": "train", "preset": "pick-td3", "overrides": SMALL}
        posted = cold.post("/v1/jobs", json=body, headers={"Idempotency-Key": "first"}).json()
        other = sqlite3.connect(file, isolation_level=None, timeout=60.0)
        other.execute("BEGIN IMMEDIATE")

        def listed(holds: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
            return wait_until(lambda: cold.get("/v1/jobs").json(), holds, within_s=WARM_UP_S)

        listed(lambda page: page["waiting"] == "database locked")
        refused = cold.post("/v1/jobs", json=body)
        assert (refused.status_code, refused.headers["retry-after"]) == (503, "2")
        assert refused.json()["type"] == "urn:tandem:problem:storage-unavailable"
        other.execute("ROLLBACK")
        other.close()
        listed(lambda page: page["waiting"] is None)
        (job,) = listed(lambda page: page["items"][0]["state"] != "queued")["items"]
        assert (job["id"], job["state"], job["failures"]) == (posted["id"], "running", 0)
