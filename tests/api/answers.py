"""Posts to the service of the tests, and the content of its answers."""

import json
from typing import Any

from fastapi.testclient import TestClient


def post_json(client: TestClient, url: str, body: Any) -> Any:
    """Post a text, or a value whose NaN and infinity strict JSON does not have."""
    text = body if isinstance(body, str | bytes) else json.dumps(body)
    return client.post(url, content=text, headers={"Content-Type": "application/json"})


def content_of(answer: Any, status: int = 200) -> dict[str, Any]:
    """Return the JSON of an answer with that status."""
    assert answer.status_code == status, answer.text
    found: dict[str, Any] = answer.json()
    return found


def problem_of(answer: Any, status: int = 422) -> dict[str, Any]:
    """Return the problem of an answer with that status."""
    assert answer.headers["content-type"] == "application/problem+json"
    return content_of(answer, status)
