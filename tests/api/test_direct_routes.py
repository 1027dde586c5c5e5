"""Every answer of the decision routes is that of a plain FastAPI route, problems included."""

import copy
import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient
from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from app.api import problems
from app.api.application import decision_routes
from app.api.bodies import BodyMiddleware
from app.api.direct_routes import DirectRouteMiddleware
from app.api.schemas import examples
from tests.api.conftest import ADDRESS, services_of

SORTING = {name: examples.PLAN[name] for name in ("cell", "objects", "goal")}
BODIES: dict[str, dict[str, Any]] = {
    "/v1/task-selection": examples.TASK_SELECTION,
    "/v1/motion": examples.MOTION,
    "/v1/plan": examples.PLAN,
    "/v1/risk-map": examples.RISK_MAP,
    "/v1/sorting": SORTING,
}
VALUES = (
    *(None, True, 0, 1, 2**63, 10**400, -1.5, 1e300, float("nan"), float("inf")),
    *("", "1", "left", "\0", "\u20ac" * 300, [], [1.0] * 6, [[0.0, 0.0]], {}, {"id": "left"}),
)
TEXTS = (
    *(
        "",
        " ",
        "{",
        "null",
        "[]",
        "1",
        '"a"',
        "{}",
        "{'cell': 1}",
        '{"cell": 01}',
        "NaN",
        "nul",
    ),
    *(
        '{"cell": "a", "cell": "b"}',
        '{"cell": "\\ud800"}',
        '{"cell": "\n"}',
        "\ufeff{}",
        "[" * 99,
    ),
)


@pytest.fixture(scope="module")
def plain(client: TestClient) -> Iterator[TestClient]:
    """The same functions as plain routes of FastAPI, on the same service."""
    app = FastAPI()
    app.state.services = services_of(client)
    problems.install(app)
    routes = decision_routes()
    assert [one.path for one in routes] == list(BODIES)
    for route in routes:
        app.add_api_route(route.path, route.endpoint, methods=["POST"])
    app.add_middleware(BodyMiddleware, files={})
    yield TestClient(app, base_url=ADDRESS)


def answered(client: TestClient, url: str, text: str | bytes, kind: str) -> tuple[int, Any]:
    answer = client.post(url, content=text, headers={"Content-Type": kind})
    body = answer.json()
    for name in ("elapsed_ms", "request_id"):
        body.pop(name, None)
    return answer.status_code, (answer.headers["content-type"], body)


def paths(value: Any, before: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the paths of all members of a JSON value."""
    members = value.items() if isinstance(value, dict) else enumerate(value)
    for name, inner in members:
        yield (*before, name)
        if isinstance(inner, dict | list):
            yield from paths(inner, (*before, name))


def changed(body: dict[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    """Return a body with a member removed, added or replaced."""
    found = copy.deepcopy(body)
    places = list(paths(found))
    *outer, name = places[rng.integers(len(places))]
    inner: Any = found
    for part in outer:
        inner = inner[part]
    kind = rng.integers(6)
    if kind == 0:
        del inner[name]
    elif kind == 1 and isinstance(inner, dict):
        inner[f"{name}_2"] = 1
    else:
        inner[name] = VALUES[rng.integers(len(VALUES))]
    return found


@pytest.mark.parametrize("url", BODIES)
def test_changed_bodies_are_answered_as_by_a_plain_route(
    client: TestClient, plain: TestClient, url: str
) -> None:
    rng, statuses = np.random.default_rng(11), set[int]()
    for _ in range(80):
        text = json.dumps(changed(BODIES[url], rng))
        found = answered(client, url, text, "application/json")
        assert found == answered(plain, url, text, "application/json"), text
        statuses.add(found[0])
    assert statuses >= {200, 422}


@pytest.mark.parametrize("url", BODIES)
def test_texts_are_answered_as_by_a_plain_route(
    client: TestClient, plain: TestClient, url: str
) -> None:
    sound = json.dumps(BODIES[url])
    whole = [
        sound,
        sound + " ",
        "\ufeff" + sound,
        sound + "}",
        sound[:-1],
        sound.replace(":", ""),
    ]
    twice = sound[:-1] + ', "cell": "nowhere"}'
    for text in (*TEXTS, *whole, twice, sound.encode("utf-16"), b"\xff" + sound.encode()):
        found = answered(client, url, text, "application/json")
        assert found == answered(plain, url, text, "application/json"), text
    for kind in ("application/vnd.a+json; charset=utf-8", "text/json", "text/plain", ""):
        assert answered(client, url, sound, kind) == answered(plain, url, sound, kind), kind


def test_only_other_requests_and_failures_reach_the_framework(client: TestClient) -> None:
    reached: list[bytes] = []

    async def framework(scope: Scope, receive: Receive, send: Send) -> None:
        reached.append((await receive())["body"])
        await Response(status_code=204)(scope, receive, send)

    layer = DirectRouteMiddleware(framework, routes=decision_routes())

    async def served(scope: Scope, receive: Receive, send: Send) -> None:
        await layer({**scope, "app": client.app}, receive, send)

    alone = TestClient(served, base_url=ADDRESS)
    for url, body in BODIES.items():
        text = json.dumps(body)
        kind = {"Content-Type": "application/json"}
        answer = alone.post(url, content=text, headers=kind)
        assert (answer.status_code, answer.headers["content-type"]) == (200, "application/json")
        assert not reached
        cell = json.dumps({**body, "cell": "nowhere"})
        for sent in (text[:-1], cell):
            assert alone.post(url, content=sent, headers=kind).status_code == 204
            assert reached.pop() == sent.encode()
        assert alone.put(url, content=text, headers=kind).status_code == 204
        assert reached.pop() == text.encode()
        unusual = ({}, {"Content-Encoding": "gzip"}, {"Content-Length": f"{2**20 + 1}"})
        for changes in unusual:
            given = kind | changes if changes else changes
            assert alone.post(url, content=text, headers=given).status_code == 204
            assert reached.pop() == text.encode()
        assert alone.post(f"{url}?a=%00", content=text, headers=kind).status_code == 204
        assert reached.pop() == text.encode()


def test_decision_routes_are_documented_with_their_schemas(client: TestClient) -> None:
    document = client.get("/openapi.json").json()
    for url in BODIES:
        operation = document["paths"][url]["post"]
        assert operation["requestBody"]["required"]
        assert "$ref" in operation["responses"]["200"]["content"]["application/json"]["schema"]
