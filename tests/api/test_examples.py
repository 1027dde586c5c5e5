"""The requests that the OpenAPI document shows are answered, and without a flag."""

import re
from typing import Any

import pytest
from fastapi.testclient import TestClient

from tests.test_http_examples import flagged


def shown(client: TestClient) -> dict[str, list[Any]]:
    """The example bodies of the OpenAPI document, by path."""
    document = client.get("/openapi.json").json()
    found = {}
    for path, methods in document["paths"].items():
        content = methods.get("post", {}).get("requestBody", {}).get("content", {})
        schema = content.get("application/json", {}).get("schema", {})
        name = schema.get("$ref", "").rsplit("/", 1)[-1]
        examples = document["components"]["schemas"].get(name, {}).get("examples", [])
        if examples:
            found[path] = examples
    return found


TRIED = (
    "/v1/task-selection",
    "/v1/motion",
    "/v1/trackers/{tracker_id}/frames",
    "/v1/plan",
    "/v1/risk-map",
)
"""Paths whose examples are tried."""


@pytest.mark.parametrize("path", TRIED)
def test_shown_request_is_answered_without_a_flag(client: TestClient, path: str) -> None:
    examples = shown(client)
    assert path in examples
    for body in examples[path]:
        tracker = client.post("/v1/trackers", json={"cell": "pick-and-place"}).json()["id"]
        answer = client.post(re.sub(r"\{\w+\}", tracker, path), json=body)
        assert answer.status_code in (200, 201), answer.text
        assert flagged(answer.json()) == []
        client.delete(f"/v1/trackers/{tracker}")


def test_no_shown_request_is_left_untried(client: TestClient) -> None:
    assert set(shown(client)) == set(TRIED)
