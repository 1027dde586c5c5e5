"""No value from outside makes any route of the API description answer with a 5xx."""

import copy
import json
import sys
from collections.abc import Iterable, Iterator
from typing import Any

import pytest
from fastapi.testclient import TestClient
from httpx2 import ASGITransport, AsyncClient, Response

from app.main import create_app
from app.settings import Settings
from tests.api.conftest import ADDRESS, wait_until_ready
from tests.api.described import api_document, undescribed

API = api_document()
ROUTES = [
    (method, path)
    for path, operations in API["paths"].items()
    for method in operations
    if method in ("get", "post", "put", "patch", "delete")
]
TEXTS = [
    "",
    "x" * 300,
    "\ud800",
    "a\udfffb",
    "a\0b",
    "\U0001f600",
    "\u202e\ufeff\uffff",
    "../../etc/passwd",
    "'; drop table jobs; --",
    "n" + "9" * 40,
    "bjk5OTk5OTk5OTk5OTk5OTk5OTk5OTk5OQ",  # a cursor beyond 64 bits
]
NUMBERS = [0, -1, 2**31, 2**63 - 1, 2**63, -(2**63) - 1, 10**40, 1e308, -1e308, 5e-324]
OTHERS: list[Any] = [None, True, [], {}, [[[[[[1]]]]]], {"a": {"b": {"c": [None]}}}]
RAW = [
    b"",
    b"\xff\xfe{\x00}\x00",
    b'{"a": "\xed\xa0\x80"}',
    b"\x00",
    b"null",
    b"[]",
    b'"\\ud800"',
    b"[" * 100_000,
    b'{"a":' * 100_000,
    b"[" * 500 + b"]" * 500,
    b"9" * 5000,
    b'"' + b'\\"' * 200_000,
    b'{"\\ud800": 1, "\\u0000": 2}',
]
URL_TEXTS = [
    "%00",
    "a%00b",
    "%ff",
    "%ed%a0%80",
    "x" * 300,
    "%F0%9F%98%80",
    "9" * 40,
    "-1",
    "%20",
]


@pytest.fixture(scope="module", autouse=True)
def without_sniffio() -> Iterator[None]:
    """``httpx2`` looks for this package at each request; all of the path takes 1 ms."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "sniffio", None)  # type: ignore[arg-type]
        yield


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    app = create_app(Settings(data=tmp_path_factory.mktemp("hostile")))
    with TestClient(app, base_url=ADDRESS, raise_server_exceptions=False) as one:
        wait_until_ready(one)
        app.state.services.supervisor.stop()  # some bodies are jobs, which need not run
        yield one


@pytest.fixture(scope="module")
def known(service: TestClient) -> dict[str, str]:
    """Names that exist, by the name of the parameter of a path."""
    job = service.post(
        "/v1/jobs", json={"kind": "evaluate", "protocol": "pick-single", "episodes": 1}
    ).json()
    service.post(f"/v1/jobs/{job['id']}/cancel")
    tracker = service.post("/v1/trackers", json={"cell": "pick-and-place"}).json()
    return {
        "job_id": job["id"],
        "world_id": "main",
        "tracker_id": tracker["id"],
        "reference": "pick",
        "name": "pick-and-place",
    }


def resolved(schema: dict[str, Any]) -> dict[str, Any]:
    while "$ref" in schema:
        schema = API["components"]["schemas"][schema["$ref"].rpartition("/")[2]]
    return schema


def samples(schema: dict[str, Any], depth: int = 0) -> list[Any]:
    """Bodies that a schema allows, one of each variant; names in them need not exist."""
    schema = resolved(schema)
    for key in ("oneOf", "anyOf"):
        if key in schema:
            kinds = [one for one in schema[key] if one.get("type") != "null"]
            return [one for kind in kinds for one in samples(kind, depth)]
    if "const" in schema or "enum" in schema:
        return [schema.get("const", schema.get("enum", [None])[0])]
    kind = schema.get("type")
    if kind == "object":
        names = schema.get("properties", {})
        wanted = names if depth < 3 else schema.get("required", [])
        found = {name: samples(names[name], depth + 1) for name in wanted}
        most = max((len(variants) for variants in found.values()), default=1)
        return [
            {name: variants[k % len(variants)] for name, variants in found.items()}
            for k in range(most)
        ]
    if kind == "array":
        item = samples(schema["items"], depth + 1)[0] if "items" in schema else 0.0
        return [[item] * max(1, schema.get("minItems", 1))]
    low = schema.get("minimum", schema.get("exclusiveMinimum", 0))
    plain: dict[Any, Any] = {"integer": low, "number": low + 0.25, "boolean": True}
    return [plain.get(kind, "pick-and-place")]


def places(value: Any) -> Iterator[tuple[Any, ...]]:
    """Keys to everything inside a body; of a list only to its first item."""
    yield ()
    inner = value.items() if isinstance(value, dict) else ()
    for name, one in list(inner) + (
        [(0, value[0])] if isinstance(value, list) and value else []
    ):
        for keys in places(one):
            yield (name, *keys)


def with_value(body: Any, keys: tuple[Any, ...], value: Any) -> Any:
    if not keys:
        return value
    changed = copy.deepcopy(body)
    inner = changed
    for part in keys[:-1]:
        inner = inner[part]
    inner[keys[-1]] = value
    return changed


def places_of_all(bodies: list[Any]) -> Iterator[tuple[Any, tuple[Any, ...]]]:
    """Places of each body that differ from those before: in keys, value or fields beside."""
    seen = set()
    for body in bodies:
        for keys in places(body):
            inner, beside = body, []
            for key in keys:
                beside.append(tuple(inner) if isinstance(inner, dict) else ())
                inner = inner[key]
            place = (keys, tuple(beside), json.dumps(inner))
            if place not in seen:
                seen.add(place)
                yield body, keys


def address_of(path: str, names: dict[str, str]) -> str:
    for name, value in names.items():
        path = path.replace(f"{{{name}}}", value)
    return path


Asked = tuple[str, str, dict[str, Any]]
"""Method, address and other arguments of a request."""


def answered(service: TestClient, requests: Iterable[Asked]) -> None:
    """Send requests; streams are asked for their head alone.

    They are sent in the thread of the service: between threads each would take four times as
    long.
    """

    async def send() -> None:
        transport = ASGITransport(service.app, raise_app_exceptions=False)
        async with AsyncClient(transport=transport, base_url=ADDRESS) as client:
            for method, url, more in requests:
                method = "head" if method == "get" else method
                check(await client.request(method, url, **more), more)

    assert service.portal is not None
    service.portal.call(send)


def check(answer: Response, sent: dict[str, Any]) -> None:
    assert answer.status_code < 500, (answer.request, sent, answer.text)
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert undescribed(API, answer) is None
    if answer.status_code >= 400 and answer.request.method != "HEAD":
        assert answer.headers["content-type"] == "application/problem+json"
        assert answer.json()["status"] == answer.status_code


def parameters(method: str, path: str, place: str) -> list[str]:
    found = API["paths"][path][method].get("parameters", [])
    return [one["name"] for one in found if one["in"] == place]


def with_hostile_addresses(
    known: dict[str, str], method: str, path: str, body: dict[str, Any]
) -> Iterator[Asked]:
    url = address_of(path, known)
    for text in URL_TEXTS:
        for name in parameters(method, path, "path"):
            yield method, address_of(path, known | {name: text}), body
        if method != "delete":
            for name in [*parameters(method, path, "query"), "unknown"]:
                yield method, f"{url}?{name}={text}&{text}=1", body


def with_hostile_headers(
    known: dict[str, str], method: str, path: str, body: dict[str, Any]
) -> Iterator[Asked]:
    values = [b"\xff\xfe", b"9" * 40, b"-1", b"x" * 300, b"\xed\xa0\x80", b"1e5"]
    names = [*parameters(method, path, "header"), "cookie", "authorization", "accept"]
    for name in names:
        for value in values:
            yield method, address_of(path, known), {"headers": {name.encode(): value}, **body}


@pytest.mark.parametrize(("method", "path"), ROUTES)
def test_hostile_addresses_and_headers_are_refused(
    service: TestClient, known: dict[str, str], method: str, path: str
) -> None:
    body: dict[str, Any] = {} if method in ("get", "delete") else {"json": {}}
    answered(service, with_hostile_addresses(known, method, path, body))
    if method != "delete":
        answered(service, with_hostile_headers(known, method, path, body))


def json_bodies(method: str, path: str) -> list[Any]:
    content = API["paths"][path][method].get("requestBody", {}).get("content", {})
    return (
        samples(content["application/json"]["schema"]) if "application/json" in content else []
    )


@pytest.mark.parametrize(("method", "path"), [route for route in ROUTES if json_bodies(*route)])
def test_hostile_bodies_are_refused(
    service: TestClient, known: dict[str, str], method: str, path: str
) -> None:
    url = address_of(path, known)
    headers = {"Content-Type": "application/json"}
    texts = {
        json.dumps(with_value(body, keys, value)).encode(): None
        for body, keys in places_of_all(json_bodies(method, path))
        for value in (*TEXTS, *NUMBERS, *OTHERS)
    }
    bodies = [*RAW, *texts]
    answered(service, ((method, url, {"content": one, "headers": headers}) for one in bodies))


@pytest.mark.parametrize("raw", RAW)
def test_signing_in_with_anything_is_refused(service: TestClient, raw: bytes) -> None:
    kinds = ("application/json", "application/x-www-form-urlencoded", "text/html")
    typed = [{"content": raw, "headers": {"Content-Type": kind}} for kind in kinds]
    tokens = [{"content": json.dumps({"token": text})} for text in TEXTS]
    answered(service, (("post", "/session", more) for more in [*typed, *tokens]))


@pytest.mark.parametrize("raw", [b"", b"\0" * 200, b"\xff" * 200, b"[" * 100_000])
def test_files_of_anything_are_refused(service: TestClient, raw: bytes) -> None:
    names = ("a.bvh", "a.csv", "a.mot", "%F0%9F%98%80.bvh")
    answered(
        service,
        (("post", f"/v1/recordings?file_name={one}", {"content": raw}) for one in names),
    )
