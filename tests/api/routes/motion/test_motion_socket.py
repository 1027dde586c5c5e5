"""The socket of ``/v1/motion``: answers of the route, problems, and what ends it."""

import json
from collections.abc import Iterator
from typing import Any

import pytest
from fastapi.testclient import TestClient
from starlette.testclient import WebSocketTestSession
from starlette.websockets import WebSocketDisconnect

from tests.api.answers import post_json
from tests.api.conftest import services_of
from tests.api.routes.motion.motion_requests import (
    BAD,
    SOCKET,
    STREAM,
    TASK,
    URL,
    asked,
    refused,
)

pytestmark = pytest.mark.usefixtures("policies")


@pytest.fixture
def socket(client: TestClient) -> Iterator[WebSocketTestSession]:
    with client.websocket_connect(SOCKET) as one:
        yield one


def without_time(answer: dict[str, Any]) -> dict[str, Any]:
    return {k: v for k, v in answer.items() if k not in ("elapsed_ms", "stream")}


def test_socket_gives_the_answers_of_the_route(
    client: TestClient, socket: WebSocketTestSession
) -> None:
    for k in range(5):
        changes = {"stamp": k, "goal": [0.1 * k, 0.7, 0.2]}
        socket.send_json({**TASK, **changes, "rollout": True})
        found = socket.receive_json()
        assert found["stream"]["superseded"] == 0 and found["stream"]["waited_ms"] >= 0.0
        expected = asked(client, **changes)
        assert without_time(found) == without_time(expected) and expected["stream"] is None


@pytest.mark.parametrize(
    ("message", "status"),
    [
        ("", 400),
        ("{", 400),
        ("[" * 50_000, 422),
        ("null", 422),
        ("[1, 2]", 422),
        ('{"cell": "shared-workspace"}', 422),
        (json.dumps({**TASK, "goal": [9.0, 0.8, 0.3], "stamp": 7}), 422),
        (json.dumps({**TASK, "goal": [float("nan"), 0.8, 0.3]}), 422),
        (json.dumps({**TASK, "stamp": float("nan")}), 422),
        (json.dumps({**TASK, "cell": "pick-and-place"}), 409),
        (json.dumps({**TASK, "cell": "x" * 70_000}), 413),
    ],
)
def test_a_bad_message_is_answered_by_a_problem_and_the_socket_lives_on(
    socket: WebSocketTestSession, message: str, status: int
) -> None:
    socket.send_text(message)
    problem = json.loads(socket.receive_text(), parse_constant=pytest.fail)
    assert problem["status"] == status and problem["detail"]
    assert problem["field"] and problem["value"] and problem["rule"]
    assert problem["instance"] == STREAM
    assert problem.get("stamp") in (None, 7)
    socket.send_json({**TASK, "stamp": "next"})
    assert socket.receive_json()["stamp"] == "next"


def test_bytes_are_no_message(socket: WebSocketTestSession) -> None:
    socket.send_bytes(json.dumps(TASK).encode())
    problem = socket.receive_json()
    assert (problem["status"], problem["field"]) == (400, "body")
    socket.send_json(TASK)
    assert socket.receive_json()["inference_mode"] == "interpolated"


def test_problems_on_the_socket_are_those_of_the_route(
    client: TestClient, socket: WebSocketTestSession
) -> None:
    for changes, status, _ in BAD:
        socket.send_text(json.dumps({**TASK, **changes}))
        found, expected = socket.receive_json(), refused(client, status, **changes)
        assert found.pop("stream")["left_out"] == []
        differ = {"instance": "", "request_id": ""}
        assert found | differ == expected | differ


@pytest.mark.parametrize(
    "message", ["{", '{"a": 1,}', "[" * 50_000, "1" * 5_000, '{"cell": "\\ud800"}']
)
def test_message_that_is_no_json_is_answered_as_by_the_route(
    client: TestClient, socket: WebSocketTestSession, message: str
) -> None:
    socket.send_text(message)
    found, expected = socket.receive_json(), post_json(client, URL, message).json()
    assert found.pop("stream")["left_out"] == []
    differ = {"instance": "", "request_id": ""}
    assert found | differ == expected | differ


def test_socket_refuses_pages_of_other_sites(client: TestClient) -> None:
    with (
        pytest.raises(WebSocketDisconnect) as caught,
        client.websocket_connect(SOCKET, headers={"Origin": "http://evil.example"}),
    ):
        pass
    assert caught.value.code == 1008


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"cell": "\ud800"}, "cell"),
        ({"cell": "a\0"}, "cell"),
        ({"t\0": 1}, "t\0"),
        ({"checkpoint": 2**70}, "checkpoint"),
        ({"people": [[[2**64]]]}, "people[0][0][0]"),
    ],
)
def test_a_socket_outlives_text_and_integers_that_nothing_takes(
    client: TestClient, change: dict[str, Any], field: str
) -> None:
    with client.websocket_connect(SOCKET) as one:
        one.send_text(json.dumps({**TASK, **change, "stamp": "s1"}))
        reply = one.receive_json()
        assert (reply["status"], reply["field"], reply["stamp"]) == (422, field, "s1")
        for text in ("[" * 60_000, '{"a": ' * 10_000, "[" * 100 + "]" * 100):
            one.send_text(text)
            assert one.receive_json()["status"] in (400, 422)
        one.send_json(TASK)
        assert one.receive_json()["inference_mode"] == "interpolated"


def test_a_stopping_server_ends_its_sockets(client: TestClient) -> None:
    stopping = services_of(client).stopping
    with client.websocket_connect(SOCKET) as one:
        one.send_json(TASK)
        assert one.receive_json()["inference_mode"] == "interpolated"
        stopping.set()
        try:
            assert one.receive()["code"] == 1001
        finally:
            stopping.clear()
