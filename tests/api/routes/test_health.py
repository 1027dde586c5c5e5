import sqlite3
import time
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from app.errors import Conflict
from app.main import create_app
from app.settings import Settings

ADDRESS = "http://127.0.0.1:8000"
SMALL = {"learning": {"n_envs": 8, "batch_size": 16}, "networks": {"width": 16}}
"""A training that begins and ends quickly; it is stopped long before its end."""


def test_service_that_is_ready_says_so(client: TestClient) -> None:
    assert client.get("/healthz").json() == {"status": "ok", "worlds": ["main"]}
    assert client.get("/readyz").status_code == 200


def test_service_says_that_it_warms_up_and_then_decides(cold_app_settings: Settings) -> None:
    with TestClient(create_app(cold_app_settings), base_url=ADDRESS) as cold:
        first = cold.get("/readyz")
        assert first.status_code == 503
        assert first.headers["retry-after"] == "2"
        assert "warming up" in first.json()["detail"]
        assert cold.get("/healthz").status_code == 503
        assert cold.get("/v1/worlds/main").status_code == 503
        assert cold.post("/v1/task-selection", json={}).status_code in (422, 503)
        assert cold.get("/").status_code == 200
        give_up = time.monotonic() + 300.0
        while cold.get("/readyz").status_code != 200:
            assert time.monotonic() < give_up
            time.sleep(0.05)
        assert cold.get("/v1/worlds/main").status_code == 200


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

        def wait_for(waiting: str | None) -> None:
            give_up = time.monotonic() + 300.0
            while cold.get("/v1/jobs").json()["waiting"] != waiting:
                assert time.monotonic() < give_up
                time.sleep(0.05)

        wait_for("database locked")
        refused = cold.post("/v1/jobs", json=body)
        assert (refused.status_code, refused.headers["retry-after"]) == (503, "2")
        assert refused.json()["type"] == "urn:tandem:problem:storage-unavailable"
        other.execute("ROLLBACK")
        other.close()
        wait_for(None)
        (job,) = cold.get("/v1/jobs").json()["items"]
        give_up = time.monotonic() + 300.0
        while job["state"] == "queued":
            assert time.monotonic() < give_up
            time.sleep(0.05)
            (job,) = cold.get("/v1/jobs").json()["items"]
        assert (job["id"], job["state"], job["failures"]) == (posted["id"], "running", 0)
