"""The requests that the OpenAPI document shows are answered, and without a flag."""

import copy
from collections.abc import Iterator
from typing import Any

import pytest
from fastapi.testclient import TestClient

from tests.api.test_hostile_values import API, address_of, places, with_value
from tests.test_http_examples import flagged
from tools.generate_client import FOR_WORKERS

OF_A_STATE = {"/v1/jobs/{job_id}/resume", "/v1/worlds/{world_id}/follow"}
"""Routes that answer only for a job in a certain state; their own tests post to them."""


def shown() -> Iterator[tuple[str, str, Any]]:
    """Method, path and example body of each example of the OpenAPI document."""
    for path, operations in API["paths"].items():
        for method, operation in operations.items():
            content = operation.get("requestBody", {}).get("content", {})
            if (media := content.get("application/json")) is None:
                continue
            if FOR_WORKERS & set(operation["tags"]):
                continue
            name = media["schema"].get("$ref", "").rpartition("/")[2]
            examples = API["components"]["schemas"].get(name, {}).get("examples", [])
            examples += [one["value"] for one in media.get("examples", {}).values()]
            examples += [media["example"]] if "example" in media else []
            assert examples, f"{method} {path} shows no example"
            if path not in OF_A_STATE:
                yield from ((method, path, one) for one in examples)


SHOWN = list(shown())
WRONG: dict[type, list[Any]] = {
    str: [1, 0.5, True],
    int: [True, "1"],
    float: [True, "1", "0.5"],
    bool: [1, "true"],
}
"""Values of other types, by the type of the right one."""


@pytest.fixture(scope="module")
def names(client: TestClient) -> Iterator[dict[str, str]]:
    """Names that exist, by the name of the parameter of a path."""
    tracker = client.post("/v1/trackers", json={"cell": "pick-and-place"}).json()["id"]
    training = {"kind": "train", "preset": "pick-td3", "priority": -100}
    job = client.post("/v1/jobs", json=training).json()["id"]
    client.post(f"/v1/jobs/{job}/cancel")
    ids = {"tracker_id": tracker, "world_id": "main", "job_id": job}
    yield {"name": "line-2", "reference": "pick", **ids}
    client.delete(f"/v1/trackers/{tracker}")


def remove(client: TestClient, location: str) -> None:
    if location.startswith("/v1/jobs/"):
        client.post(f"{location}/cancel")
    elif location:
        client.delete(location)


@pytest.mark.parametrize(("method", "path", "body"), SHOWN)
def test_shown_request_is_answered_without_a_flag(
    client: TestClient, names: dict[str, str], method: str, path: str, body: Any
) -> None:
    answer = client.request(method, address_of(path, names), json=body)
    assert answer.is_success, answer.text
    assert flagged(answer.json()) == []
    remove(client, answer.headers.get("location", ""))


def leaves(body: Any) -> Iterator[tuple[tuple[Any, ...], Any]]:
    """Places and values of the numbers, texts and flags in a body."""
    for keys in places(body):
        value = body
        for key in keys:
            value = value[key]
        if isinstance(value, int | float | str):
            yield keys, value


@pytest.mark.parametrize(("method", "path", "body"), SHOWN)
def test_value_of_another_type_is_refused(
    client: TestClient, names: dict[str, str], method: str, path: str, body: Any
) -> None:
    for keys, value in leaves(body):
        for one in WRONG[type(value)]:
            changed = with_value(body, keys, one)
            answer = client.request(method, address_of(path, names), json=changed)
            assert answer.status_code == 422, (keys, one, answer.text)
            assert answer.json()["field"], answer.text


def with_integers(value: Any) -> Any:
    """Return a body with every whole number written without a point."""
    if isinstance(value, dict):
        return {name: with_integers(one) for name, one in value.items()}
    if isinstance(value, list):
        return [with_integers(one) for one in value]
    return int(value) if isinstance(value, float) and value.is_integer() else value


@pytest.mark.parametrize(("method", "path", "body"), SHOWN)
def test_whole_number_needs_no_point(
    client: TestClient, names: dict[str, str], method: str, path: str, body: Any
) -> None:
    whole = with_integers(copy.deepcopy(body))
    if "t" in whole:
        whole["t"] += 0.1
    answer = client.request(method, address_of(path, names), json=whole)
    assert answer.is_success, answer.text
    remove(client, answer.headers.get("location", ""))
