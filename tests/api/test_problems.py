import gzip
import json
import logging
from typing import Any

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient
from starlette.types import ASGIApp, Receive, Scope, Send

from app.api import problems
from app.api.metrics import Metrics
from app.api.responses import ResponseMiddleware
from app.api.schemas.examples import MOTION
from app.errors import (
    CheckpointMismatch,
    Conflict,
    InvalidInput,
    NotFound,
    NotReady,
    ServiceError,
    SimulationError,
)
from app.storage_errors import StorageFull
from tests.api.answers import problem_of

JOB_PARAMETERS = ["cursor", "limit", "state", "part_of", "kind", "preset"]
PLAIN_DIGITS = "must be a whole number in plain digits"

ERRORS: list[tuple[ServiceError, int]] = [
    (NotFound("job", "x"), 404),
    (InvalidInput("seed", -1, "must be positive"), 422),
    (Conflict("already done"), 409),
    (CheckpointMismatch("cell", "a", "b"), 409),
    (NotReady("warming up"), 503),
    (StorageFull("sqlite:///x"), 507),
    (SimulationError("seed 1"), 500),
]


@pytest.mark.parametrize(("error", "status"), ERRORS)
def test_each_error_becomes_a_problem_with_its_data(error: ServiceError, status: int) -> None:
    app = FastAPI()
    problems.install(app)

    @app.get("/")
    async def fail() -> None:
        raise error

    answer = TestClient(app).get("/")
    assert answer.status_code == answer.json()["status"] == status
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.json()["detail"] == error.message
    assert error.problem().items() <= answer.json().items()


def broken_app(where: str) -> FastAPI:
    """An application with an unforeseen error in a route or in a layer around it."""
    app = FastAPI()
    problems.install(app)

    @app.get("/")
    async def fail() -> None:
        if where == "route":
            raise RuntimeError("secret")

    class Layer:
        def __init__(self, app: ASGIApp) -> None:
            self.app = app

        async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
            if where == "layer" and scope["type"] == "http":
                raise TypeError("secret")
            await self.app(scope, receive, send)

    app.add_middleware(Layer)
    app.add_middleware(ResponseMiddleware, metrics=Metrics("0"))
    return app


@pytest.mark.parametrize("where", ["route", "layer"])
def test_bug_answers_with_a_problem_and_the_security_headers_but_without_its_trace(
    where: str, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.CRITICAL)
    answer = TestClient(broken_app(where)).get("/")
    assert answer.status_code == answer.json()["status"] == 500
    assert answer.headers["content-type"] == "application/problem+json"
    assert "frame-ancestors" in answer.headers["content-security-policy"]
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert "secret" not in answer.text


def test_problem_may_show_half_of_a_surrogate_pair() -> None:
    answer = problems.problem(422, "\ud800 \u00e4 \U0001f600")
    assert json.loads(bytes(answer.body))["detail"] == "\ud800 \u00e4 \U0001f600"


@pytest.mark.parametrize("path", ["/v1/nothing", "/static/nothing.js"])
def test_unknown_path_is_a_problem(client: TestClient, path: str) -> None:
    answer = client.get(path)
    assert answer.headers["content-type"] == "application/problem+json"
    assert problem_of(answer, 404)["instance"] == path


def test_wrong_method_lists_those_that_are_answered(client: TestClient) -> None:
    answer = client.delete("/v1/jobs")
    assert answer.status_code == 405
    assert answer.json()["choices"] == ["GET", "HEAD", "POST"]
    assert answer.headers["allow"] == "GET, HEAD, POST"
    for path in ("/static/app.js", "/"):
        answer = client.post(path)
        assert (answer.status_code, answer.headers["allow"]) == (405, "GET, HEAD")


def test_body_over_the_limit_is_refused(client: TestClient) -> None:
    answer = client.post("/v1/task-selection", content=b" " * ((1 << 20) + 1))
    assert answer.status_code == 413
    assert answer.json()["field"] == "body"
    assert "1048576" in answer.json()["rule"]


def test_body_over_the_limit_without_a_length_is_refused(client: TestClient) -> None:
    chunks = (b" " * 65536 for _ in range(20))
    headers = {"Content-Type": "application/json"}
    answer = client.post("/v1/task-selection", content=chunks, headers=headers)
    assert answer.status_code == 413
    assert answer.headers["content-type"] == "application/problem+json"


@pytest.mark.parametrize("encoding", ["gzip", "br", "deflate", "GZIP", "identity, gzip"])
@pytest.mark.parametrize("path", ["/v1/trackers", "/v1/recordings?file_name=a.bvh"])
def test_compressed_bodies_are_refused(client: TestClient, path: str, encoding: str) -> None:
    body = gzip.compress(b'{"cell": "pick-and-place"}')
    headers = {"Content-Encoding": encoding}
    if "trackers" in path:
        headers["Content-Type"] = "application/json"
    answer = client.post(path, content=body, headers=headers)
    assert answer.status_code == 415
    assert answer.json()["field"] == "Content-Encoding"
    assert answer.json()["choices"] == ["identity"]
    assert answer.headers["accept-encoding"] == "identity"


def test_body_of_identity_encoding_is_taken(client: TestClient) -> None:
    headers = {"Content-Encoding": "identity"}
    answer = client.post("/v1/jobs", json={"kind": "nothing"}, headers=headers)
    assert answer.json()["field"] == "kind"


@pytest.mark.parametrize(
    "path",
    [
        "/",
        "/healthz",
        "/readyz",
        "/docs",
        "/openapi.json",
        "/static/index.html",
        "/v1/cells",
        "/v1/jobs",
        "/v1/worlds/main",
        "/viewer/main/",
        "/favicon.ico",
        "/v1/checkpoints/pick",
    ],
)
def test_head_has_the_headers_of_get_and_no_body(client: TestClient, path: str) -> None:
    get, head = client.get(path), client.head(path)
    assert head.status_code == get.status_code == 200
    assert head.content == b""
    changing = {"date", "x-request-id"} | (
        {"content-length"} if path == "/v1/worlds/main" else set()
    )
    assert {k: v for k, v in head.headers.items() if k not in changing} == {
        k: v for k, v in get.headers.items() if k not in changing
    }


def test_head_of_a_stream_ends(client: TestClient) -> None:
    answer = client.head("/v1/worlds/main/events")
    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith("text/event-stream")


@pytest.mark.parametrize(("path", "status"), [("/v1/nothing", 404), ("/v1/motion", 405)])
def test_head_of_what_get_refuses_is_refused(
    client: TestClient, path: str, status: int
) -> None:
    answer = client.head(path)
    assert answer.status_code == client.get(path).status_code == status
    assert answer.content == b""


def test_body_that_is_no_json_is_refused(client: TestClient) -> None:
    answer = client.post("/v1/jobs", data={"kind": "train"})
    assert answer.status_code == 415
    assert answer.json()["choices"] == ["application/json"]


@pytest.mark.parametrize(
    ("method", "path", "field", "rule", "choices"),
    [
        ("GET", "/v1/jobs?LIMIT=1", "LIMIT", "is not a parameter", JOB_PARAMETERS),
        ("GET", "/v1/jobs?limit=1&foo", "foo", "is not a parameter", JOB_PARAMETERS),
        ("GET", "/v1/jobs?limit=5&limit=6", "limit", "must be given once", []),
        ("GET", "/v1/jobs?limit=1_0", "limit", PLAIN_DIGITS, []),
        ("GET", "/v1/jobs?limit=1.0", "limit", PLAIN_DIGITS, []),
        ("GET", "/v1/jobs?limit=%2010", "limit", PLAIN_DIGITS, []),
        ("GET", "/v1/trackers/x?t=1_0", "t", "must be a number in plain digits", []),
        ("GET", "/v1/cells?x=1", "x", "is not a parameter: the route has none", []),
        ("GET", "/v1/cells/x?int=1", "int", "is not a parameter: the route has none", []),
        ("POST", "/v1/jobs?train=1", "train", "is not a parameter: the route has none", []),
        ("POST", "/v1/motion?a=1", "a", "is not a parameter: the route has none", []),
        ("POST", "/v1/checkpoints?sha265=zz", "sha265", "is not a parameter", ["sha256"]),
        (
            "POST",
            "/v1/recordings?file_name=x.csv&units=mm",
            "units",
            "is not a parameter",
            ["file_name", "name", "unit", "root_unit", "up", "map"],
        ),
    ],
)
def test_parameter_of_an_address_that_would_be_ignored_is_refused(
    client: TestClient, method: str, path: str, field: str, rule: str, choices: list[str]
) -> None:
    body = {"kind": "evaluate", "protocol": "pick-single"} if "?train" in path else None
    body = MOTION if "motion" in path else body
    problem = problem_of(client.request(method, path, json=body))
    assert (problem["field"], problem["rule"]) == (field, rule)
    assert problem["choices"] == choices and problem["errors"][0]["value"] == problem["value"]


@pytest.mark.parametrize(
    "path", ["/?v=1", "/docs?v=1", "/healthz?v=1", "/static/app.js?v=1", "/openapi.json?v=1"]
)
def test_page_and_checks_ignore_parameters(client: TestClient, path: str) -> None:
    assert client.get(path).status_code == 200


@pytest.mark.parametrize(
    "path",
    ["/v1/jobs?limit=1&state=queued", "/v1/checkpoints?limit=2", "/v1/jobs?part_of=none"],
)
def test_parameters_of_a_route_are_taken(client: TestClient, path: str) -> None:
    assert client.get(path).status_code == 200


@pytest.mark.parametrize("path", ["/v1/jobs/", "/v1/cells/", "/docs/"])
@pytest.mark.parametrize("method", ["GET", "POST"])
def test_address_with_a_trailing_slash_is_not_found(
    client: TestClient, method: str, path: str
) -> None:
    answer = client.request(method, path, follow_redirects=False)
    assert problem_of(answer, 404)["instance"] == path


@pytest.mark.parametrize(
    ("method", "path", "given", "status"),
    [
        ("GET", "/v1/nothing", {}, 404),
        ("GET", "/v1/jobs?limit=%00", {}, 422),
        ("POST", "/v1/jobs", {"content": b" " * ((1 << 20) + 1)}, 413),
        ("POST", "/v1/jobs", {"content": b"a=1"}, 415),
        ("POST", "/v1/jobs", {"json": {"kind": "\0"}}, 422),
        ("POST", "/v1/jobs", {"json": {"kind": "dream"}}, 422),
        ("GET", "/v1/jobs", {"headers": {"Host": "evil.example"}}, 421),
    ],
)
def test_instance_is_the_path_below_the_root_path(
    client: TestClient, method: str, path: str, given: dict[str, Any], status: int
) -> None:
    below = TestClient(client.app, base_url=str(client.base_url), root_path="/tandem")
    answer = below.request(method, f"/tandem{path}", **given)
    assert problem_of(answer, status)["instance"] == f"/tandem{path.partition('?')[0]}"


def test_instance_of_a_socket_is_its_path_below_the_root_path(client: TestClient) -> None:
    below = TestClient(client.app, base_url=str(client.base_url), root_path="/tandem")
    path = "/tandem/v1/motion/stream"
    with below.websocket_connect(f"ws://127.0.0.1:8000{path}") as socket:
        for text in ("{", "{}"):
            socket.send_text(text)
            assert socket.receive_json()["instance"] == path
