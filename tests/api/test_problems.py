import logging

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient

from app.api import problems
from app.errors import (
    CheckpointMismatch,
    Conflict,
    InvalidInput,
    NotFound,
    NotReady,
    ServiceError,
    SimulationError,
    StorageFull,
)

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


def test_bug_answers_without_its_trace(caplog: pytest.LogCaptureFixture) -> None:
    app = FastAPI()
    problems.install(app)

    @app.get("/")
    async def fail() -> None:
        raise RuntimeError("secret")

    caplog.set_level(logging.CRITICAL)
    answer = TestClient(app, raise_server_exceptions=False).get("/")
    assert answer.status_code == 500
    assert "secret" not in answer.text


def test_unknown_path_is_a_problem(client: TestClient) -> None:
    answer = client.get("/v1/nothing")
    assert answer.status_code == 404
    assert answer.json()["instance"] == "/v1/nothing"
    assert answer.headers["content-type"] == "application/problem+json"


def test_missing_file_of_the_page_is_a_problem(client: TestClient) -> None:
    answer = client.get("/static/nothing.js")
    assert answer.status_code == 404
    assert answer.headers["content-type"] == "application/problem+json"


def test_wrong_method_lists_those_that_are_answered(client: TestClient) -> None:
    answer = client.delete("/v1/jobs")
    assert answer.status_code == 405
    assert answer.json()["choices"] == ["GET", "POST"]
    assert answer.headers["allow"] == "GET, POST"


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


def test_body_that_is_no_json_is_refused(client: TestClient) -> None:
    answer = client.post("/v1/jobs", data={"kind": "train"})
    assert answer.status_code == 415
    assert answer.json()["choices"] == ["application/json"]
