import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from prometheus_client.parser import text_string_to_metric_families
from starlette.websockets import WebSocketDisconnect

from app.api.metrics import Metrics
from tests.api.conftest import services_of

SOCKET = "ws://127.0.0.1:8000/v1/motion/stream"
PAGE = (Path(__file__).resolve().parents[3] / "docs" / "operations.md").read_text("utf-8")


def scrape(client: TestClient) -> dict[str, Any]:
    answer = client.get("/metrics")
    assert answer.status_code == 200
    return {one.name: one for one in text_string_to_metric_families(answer.text)}


def values(client: TestClient, name: str, labels: dict[str, str]) -> list[float]:
    family = name.removesuffix("_total").removesuffix("_count")
    samples = scrape(client)[family].samples
    return [s.value for s in samples if s.name == name and labels.items() <= s.labels.items()]


def value(client: TestClient, name: str, **labels: str) -> float:
    """Return the sum of the samples with some labels, of which there is one at least."""
    found = values(client, name, labels)
    assert found, f"no sample of {name} with {labels}"
    return sum(found)


def count(client: TestClient, name: str, **labels: str) -> float:
    """Return the sum of the samples with some labels; 0 before the first."""
    return sum(values(client, name, labels))


def test_request_is_counted_by_route_method_and_status(client: TestClient) -> None:
    name = "tandem_request_duration_seconds_count"
    labels = {"method": "GET", "endpoint": "/v1/jobs/{job_id}", "status": "404"}
    before = count(client, name, **labels)
    client.get("/v1/jobs/none")
    client.get("/v1/jobs/nothing")
    assert value(client, name, **labels) == before + 2


def test_unknown_paths_and_methods_share_one_endpoint(client: TestClient) -> None:
    name = "tandem_request_duration_seconds_count"
    client.request("BREW", "/pot-1")
    client.get("/pot-2")
    assert value(client, name, endpoint="none", status="404", method="other") >= 1
    assert value(client, name, endpoint="none", status="404", method="GET") >= 1
    assert "pot" not in client.get("/metrics").text


def test_decision_outside_the_training_range_is_counted(
    client: TestClient, state: dict[str, Any]
) -> None:
    name, labels = "tandem_decisions_outside_training_total", {"endpoint": "/v1/task-selection"}
    before = value(client, name, **labels)
    far = [{"id": "far", "position": [0.0, 3.0, 0.1]}]
    answer = client.post("/v1/task-selection", json={**state, "candidates": far})
    assert answer.json()["candidates"][0]["outside"]
    assert value(client, name, **labels) == before + 1


def test_decisions_outside_the_training_range_are_counted_from_zero_on() -> None:
    # Prometheus sees no increase where a series begins with 1.
    registry = Metrics("1").registry
    for endpoint in ("/v1/motion", "/v1/plan", "/v1/sorting", "/v1/task-selection"):
        name, labels = "tandem_decisions_outside_training_total", {"endpoint": endpoint}
        assert registry.get_sample_value(name, labels) == 0.0


def test_live_world_is_read(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    handle = services_of(client).worlds["main"].handle
    now = handle.snapshot()
    slowed = replace(now, safety=replace(now.safety, override=0.375))
    monkeypatch.setattr(handle, "snapshot", lambda: slowed)
    world = {"world": "main", "cell": "pick-and-place"}
    assert value(client, "tandem_live_override_ratio", **world) == 0.375
    ticks = value(client, "tandem_live_tick_lateness_seconds_count", world="main")
    assert ticks > 0
    assert value(client, "tandem_ready") == 1.0


def test_tracker_has_an_age_until_it_is_deleted(client: TestClient) -> None:
    tracker = client.post("/v1/trackers", json={"cell": "pick-and-place"}).json()["id"]
    samples = scrape(client)["tandem_tracker_age_seconds"].samples
    assert [s.value >= 0.0 for s in samples if s.labels["tracker"] == tracker] == [True]
    client.delete(f"/v1/trackers/{tracker}")
    samples = scrape(client)["tandem_tracker_age_seconds"].samples
    assert tracker not in {s.labels["tracker"] for s in samples}


def test_jobs_are_counted_by_state(client: TestClient) -> None:
    body = {"kind": "train", "preset": "sorting-e0-dqn", "seed": 1}
    job = client.post("/v1/jobs", json=body).json()
    client.post(f"/v1/jobs/{job['id']}/cancel")
    found = {one.labels["state"]: one.value for one in scrape(client)["tandem_jobs"].samples}
    assert found["cancelled"] + found["cancelling"] >= 1.0
    assert found["failed"] == 0.0
    assert value(client, "tandem_database_up") == 1.0


def test_open_sockets_are_counted(client: TestClient) -> None:
    with client.websocket_connect(SOCKET):
        assert value(client, "tandem_sockets_open", kind="motion") == 1.0
    assert value(client, "tandem_sockets_limit", kind="motion") >= 1.0


def test_openmetrics_is_answered_where_it_is_accepted(client: TestClient) -> None:
    answer = client.get("/metrics", headers={"Accept": "application/openmetrics-text"})
    assert answer.headers["content-type"].startswith("application/openmetrics-text")
    assert answer.text.endswith("# EOF\n")


def test_operations_page_lists_every_metric_and_no_other(client: TestClient) -> None:
    offered = {name for name in scrape(client) if name.startswith("tandem_")}
    offered -= {name for name in offered if name.endswith("_created")}
    table = PAGE.split("## Metrics\n")[1].split("\n## ")[0]
    listed = set(re.findall(r"^\| `(tandem_\w+?)(?:_total)?`", table, re.MULTILINE))
    assert listed == offered


def test_two_applications_count_apart() -> None:
    one, two = Metrics("1"), Metrics("1")
    one.observe("GET", "/a", 200, 0.001)
    text = "tandem_request_duration_seconds_count"
    labels = {"method": "GET", "endpoint": "/a", "status": "200"}
    assert one.registry.get_sample_value(text, labels) == 1.0
    assert two.registry.get_sample_value(text, labels) is None


@pytest.mark.parametrize("given", ["build-7:step/2", "a" * 128, "0af7-65.1_x+y="])
def test_well_formed_request_id_is_returned(client: TestClient, given: str) -> None:
    answer = client.get("/v1/jobs/none", headers={"X-Request-ID": given})
    assert answer.headers["x-request-id"] == given == answer.json()["request_id"]


@pytest.mark.parametrize("given", ["", "a" * 129, "two words", 'quo"te', "ünicode"])
def test_other_request_id_is_replaced(client: TestClient, given: str) -> None:
    answer = client.get("/v1/jobs/none", headers={"X-Request-ID": given.encode()})
    assert re.fullmatch("[0-9a-f]{16}", answer.headers["x-request-id"])
    assert answer.json()["request_id"] == answer.headers["x-request-id"]


def test_handshake_of_a_socket_has_the_request_id(client: TestClient) -> None:
    headers = {"X-Request-ID": "socket-1"}
    with client.websocket_connect(SOCKET, headers=headers) as socket:
        accepted = dict(socket.extra_headers or [])
        assert accepted[b"x-request-id"] == b"socket-1"


def test_space_of_the_data_folder_and_size_of_the_database_are_stated(
    client: TestClient,
) -> None:
    data = services_of(client).data
    free = value(client, "tandem_data_free_bytes")
    assert free == pytest.approx(shutil.disk_usage(data).free, rel=0.2)
    size = (data / "tandem.db").stat().st_size
    assert size <= value(client, "tandem_database_size_bytes") < 2 * size + 256 * 2**20


def test_messages_on_a_socket_are_counted_with_their_wait(client: TestClient) -> None:
    name = "tandem_request_duration_seconds_count"
    labels = {"method": "MESSAGE", "endpoint": "/v1/motion/stream"}
    before = count(client, name, **labels, status="422")
    waits = value(client, "tandem_socket_wait_seconds_count")
    with client.websocket_connect(SOCKET) as socket:
        socket.send_json({"cell": "nothing"})
        assert socket.receive_json()["status"] == 422
    assert value(client, name, **labels, status="422") == before + 1
    assert value(client, "tandem_socket_wait_seconds_count") == waits + 1


def log_fields(caplog: pytest.LogCaptureFixture, message: str) -> dict[str, Any]:
    """Return the fields of the newest line with a message."""
    return next(vars(one) for one in reversed(caplog.records) if one.message == message)


def test_line_of_a_request_names_the_job_that_it_creates_or_changes(
    client: TestClient, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO", "app.api.responses")
    job = client.post("/v1/jobs", json={"kind": "evaluate", "protocol": "pick-single"}).json()
    assert log_fields(caplog, "POST /v1/jobs")["job_id"] == job["id"]
    client.post(f"/v1/jobs/{job['id']}/cancel")
    assert log_fields(caplog, f"POST /v1/jobs/{job['id']}/cancel")["job_id"] == job["id"]
    client.get("/v1/jobs/nothing")
    assert "job_id" not in log_fields(caplog, "GET /v1/jobs/nothing")


def test_refused_socket_has_a_line_in_the_log(
    client: TestClient, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO", "app.api.responses")
    foreign = {"Origin": "http://evil.example"}
    with pytest.raises(WebSocketDisconnect), client.websocket_connect(SOCKET, headers=foreign):
        pass
    assert log_fields(caplog, "WS /v1/motion/stream")["status"] == 403
    with client.websocket_connect(f"{SOCKET}?deadline_ms=soon") as socket:
        with pytest.raises(WebSocketDisconnect):
            socket.receive_json()
    fields = log_fields(caplog, "WS /v1/motion/stream")
    assert fields["code"] == 1008 and "deadline_ms" in fields["reason"]


def test_socket_that_the_client_closes_has_no_line(
    client: TestClient, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO", "app.api.responses")
    with client.websocket_connect(SOCKET) as socket:
        socket.send_json({"cell": "nothing"})
        socket.receive_json()
    assert not [one for one in caplog.records if one.message.startswith("WS ")]
