import time

import pytest
from fastapi.testclient import TestClient

from app.errors import Conflict
from app.main import create_app
from app.settings import Settings

ADDRESS = "http://127.0.0.1:8000"


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


def test_second_app_on_the_same_database_is_refused(
    cold_app_settings: Settings,
) -> None:
    with TestClient(create_app(cold_app_settings), base_url=ADDRESS):
        second = TestClient(create_app(cold_app_settings), base_url=ADDRESS)
        with pytest.raises(Conflict, match="another Tandem server"), second:
            pass


def test_app_can_be_started_again_after_it_was_closed(cold_app_settings: Settings) -> None:
    for _ in range(2):
        with TestClient(create_app(cold_app_settings), base_url=ADDRESS) as one:
            assert one.get("/v1/jobs").status_code == 200
