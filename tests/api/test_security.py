import asyncio
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.types import Receive, Scope, Send
from starlette.websockets import WebSocketDisconnect
from uvicorn.middleware.proxy_headers import ProxyHeadersMiddleware

from app.api.security import cookie_name, headers_of, session_value
from app.cli.uvicorn_server import trusted_proxies
from app.errors import InvalidInput
from app.main import create_app
from app.settings import Settings
from tests.api.answers import problem_of
from tests.api.conftest import services_of
from tests.api.live_server import running
from tests.support import patient_http

TOKEN = "a-token-of-some-length"
OPEN_FOR = {
    "/session": ["POST"],
    "/healthz": ["GET", "HEAD"],
    "/readyz": ["GET", "HEAD"],
    "/favicon.ico": ["GET", "HEAD"],
}
"""Paths that docs/setup.md names as open, with their methods."""
OPEN = set(OPEN_FOR)
BESIDE = ("/nothing", "/healthz/", "//healthz", "/HEALTHZ", "/static/../healthz/x", "/session/")
"""Paths that no route has."""
MOUNTED = ("", "/", "/index.html", "/app.js", "/nothing.js")
"""Files of a mounted folder."""
METHODS = "GET HEAD POST PUT PATCH DELETE OPTIONS TRACE CONNECT PROPFIND".split()


@pytest.fixture(scope="module")
def guarded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    settings = Settings(host="0.0.0.0", data=tmp_path_factory.mktemp("guarded"), token=TOKEN)
    with TestClient(create_app(settings), base_url="http://robot.example") as one:
        yield one


@pytest.mark.parametrize(
    "host", ["evil.example", "127.0.0.1.evil.example", "10.0.0.1:8000", ""]
)
def test_foreign_host_is_refused_on_loopback(client: TestClient, host: str) -> None:
    assert problem_of(client.get("/healthz", headers={"Host": host}), 421)["field"] == "Host"


def test_second_host_is_refused(client: TestClient) -> None:
    headers = [("Host", "127.0.0.1"), ("Host", "evil.example")]
    assert problem_of(client.get("/healthz", headers=headers), 421)["field"] == "Host"


@pytest.mark.parametrize("host", ["127.0.0.1:8000", "localhost:9000", "[::1]:8000"])
def test_loopback_names_are_answered(client: TestClient, host: str) -> None:
    assert client.get("/healthz", headers={"Host": host}).status_code == 200


@pytest.mark.parametrize(
    "origin",
    ["http://evil.example", "http://127.0.0.1:9999", "null", "http://127.0.0.1:8000.evil.com"],
)
def test_foreign_origin_is_refused(client: TestClient, origin: str) -> None:
    answer = client.post("/v1/jobs", json={}, headers={"Origin": origin})
    assert answer.status_code == 403
    assert answer.json()["field"] == "Origin"


def test_own_origin_is_answered(client: TestClient) -> None:
    headers = {"Origin": "http://127.0.0.1:8000"}
    assert client.get("/healthz", headers=headers).status_code == 200


@pytest.mark.parametrize(
    "headers", [{"Origin": "http://evil.example"}, {"Host": "evil.example"}]
)
def test_foreign_page_gets_no_viewer_socket(
    client: TestClient, headers: dict[str, str]
) -> None:
    with (
        pytest.raises(WebSocketDisconnect),
        client.websocket_connect(
            "/viewer/main/", subprotocols=["viser-v1.1.1"], headers=headers
        ),
    ):
        pass


def test_first_of_equal_headers_counts() -> None:
    given = [(b"host", b"127.0.0.1"), (b"accept", b"*/*"), (b"host", b"evil.example")]
    assert headers_of({"headers": given}) == {"host": "127.0.0.1", "accept": "*/*"}


def test_every_answer_carries_the_security_headers(client: TestClient) -> None:
    for path in ("/", "/healthz", "/viewer/main/", "/v1/nothing"):
        headers = client.get(path).headers
        assert headers["x-content-type-options"] == "nosniff"
        assert "frame-ancestors 'self'" in headers["content-security-policy"]


def test_other_address_without_token_is_refused() -> None:
    with pytest.raises(InvalidInput, match="TANDEM_HOST"):
        create_app(Settings(host="0.0.0.0"))


def walk(routes: Sequence[Any], prefix: str = "") -> Iterator[tuple[str, bool]]:
    """Yield the path of every route, and whether it is a socket; of mounts, files too."""
    for route in routes:
        if (included := getattr(route, "original_router", None)) is not None:
            yield from walk(included.routes, prefix)
        elif isinstance(route, Mount):
            yield from walk(route.routes or (), prefix + route.path)
            yield from ((prefix + route.path + file, False) for file in MOUNTED)
        else:
            assert isinstance(route, Route | WebSocketRoute), f"{route} is of an unknown kind"
            path = re.sub(r"\{(world_id)\}", "main", prefix + route.path)
            yield re.sub(r"\{\w+\}", "pick", path), isinstance(route, WebSocketRoute)


def every_path(guarded: TestClient) -> dict[str, bool]:
    """The paths of the application, of which some are sockets, too."""
    found: dict[str, bool] = {}
    for path, is_socket in walk(guarded.app.routes):  # type: ignore[attr-defined]
        found[path] = found.get(path, False) or is_socket
    described = set(guarded.get("/openapi.json", headers=bearer()).json()["paths"])
    assert len(found) > len(described) >= 20
    assert sum(found.values()) >= 3
    return found


def test_walk_reaches_what_is_served(guarded: TestClient) -> None:
    paths = every_path(guarded)
    known = ("/", "/openapi.json", "/docs", "/static/app.js", "/viewer/main/", "/v1/jobs")
    assert set(known) | OPEN <= set(paths)
    assert paths["/viewer/main/"] and paths["/v1/motion/stream"]


@pytest.mark.parametrize("method", METHODS)
def test_every_route_asks_for_the_token(guarded: TestClient, method: str) -> None:
    for path in set(every_path(guarded)) - OPEN | set(BESIDE):
        answer = guarded.request(method, path, follow_redirects=False)
        assert answer.status_code == 401, (method, path)
        assert answer.headers["www-authenticate"] == "Bearer"
        assert answer.headers["content-type"] == "application/problem+json"
        assert not answer.content if method == "HEAD" else "token" in answer.text


@pytest.mark.parametrize("method", METHODS)
def test_open_path_answers_only_what_it_is_open_for(guarded: TestClient, method: str) -> None:
    for path, methods in OPEN_FOR.items():
        answer = guarded.request(method, path, json={}, follow_redirects=False)
        if method in methods:
            assert answer.status_code in (200, 422, 503), (method, path)
        else:
            assert answer.status_code == 405, (method, path)


def test_every_socket_asks_for_the_token(guarded: TestClient) -> None:
    for path in every_path(guarded).keys() - OPEN:
        with (
            pytest.raises(WebSocketDisconnect) as refused,
            guarded.websocket_connect(path, subprotocols=["viser-v1.1.1"]),
        ):
            pass
        assert (refused.value.code, refused.value.reason) == (1008, "token-needed"), path


def test_open_path_is_no_socket(guarded: TestClient) -> None:
    for path in OPEN:
        with pytest.raises(WebSocketDisconnect), guarded.websocket_connect(path):
            pass


@pytest.mark.parametrize("given", ["", "Bearer", "Bearer wrong", f"Basic {TOKEN}", TOKEN])
def test_wrong_token_is_refused(guarded: TestClient, given: str) -> None:
    answer = guarded.get("/v1/jobs", headers={"Authorization": given})
    assert answer.status_code == 401


def test_bearer_token_is_answered(guarded: TestClient) -> None:
    assert guarded.get("/v1/jobs", headers=bearer()).status_code == 200


@pytest.mark.parametrize(
    "cookie",
    [
        b"%s=\xff\xfe",
        b"%s=\xc3\xa4",
        b"%s=" + b"x" * 5000,
        b"\xed\xa0\x80=1; %s=",
        b'%s="\\377"',
    ],
)
def test_cookie_of_any_bytes_is_refused(guarded: TestClient, cookie: bytes) -> None:
    named = cookie % cookie_name(TOKEN).encode()
    answer = guarded.get("/v1/jobs", headers={b"Cookie": named})
    assert answer.status_code == 401
    assert answer.headers["content-type"] == "application/problem+json"


@pytest.mark.parametrize(
    "other", [b"a[b]=1", b'view={"open":1}', b"flag", b"text=a b", b"text=\xe4", b'text="a']
)
def test_cookie_is_read_beside_those_of_other_services(
    guarded: TestClient, other: bytes
) -> None:
    cookie = f"{cookie_name(TOKEN)}={session_value(TOKEN)}".encode()
    for header in (other + b"; " + cookie, cookie + b"; " + other):
        assert guarded.get("/v1/jobs", headers={b"Cookie": header}).status_code == 200


@pytest.mark.parametrize(
    "given", [b"Bearer \xff", "Bearer \u00e4\u00f6".encode(), b"\xff \xff"]
)
def test_authorization_of_any_bytes_is_refused(guarded: TestClient, given: bytes) -> None:
    assert guarded.get("/v1/jobs", headers={b"Authorization": given}).status_code == 401


@pytest.mark.parametrize(
    "body",
    [
        b'{"token": "\\ud800"}',
        b'{"token": "\\u0000"}',
        b'{"token": 12345678901234567890123}',
        b'{"token": ' + b"[" * 100_000,
        b'{"token": ["a-token-of-some-length"]}',
        b"[" * 100_000,
        b"\xff\xff",
        b"",
    ],
)
def test_signing_in_with_anything_else_is_refused(guarded: TestClient, body: bytes) -> None:
    answer = guarded.post("/session", content=body)
    assert answer.status_code == 422
    assert answer.headers["content-type"] == "application/problem+json"
    assert "set-cookie" not in answer.headers


def test_health_tells_strangers_nothing_but_up_and_ready(guarded: TestClient) -> None:
    services = services_of(guarded)
    services.readiness.ready, services.readiness.reason = False, "compiling: a secret"
    for headers in ({}, {"Authorization": "Bearer wrong"}):
        answer = guarded.get("/readyz", headers=headers)
        assert answer.status_code == 503
        assert answer.json()["detail"] == "the service is up and not ready"
        assert "secret" not in answer.text
        assert guarded.get("/healthz", headers=headers).json() == {"status": "ok"}
    assert "secret" in guarded.get("/readyz", headers=bearer()).text
    services.readiness.ready = True
    assert guarded.get("/healthz").json() == {"status": "ok"}
    assert guarded.get("/readyz").json() == {"status": "ready"}
    assert "worlds" in guarded.get("/healthz", headers=bearer()).json()


def test_browser_gets_a_page_to_sign_in_and_then_a_cookie(guarded: TestClient) -> None:
    page = guarded.get("/", headers={"Accept": "text/html"})
    assert page.status_code == 401
    assert 'action="/session"' in page.text
    wrong = guarded.post("/session", data={"token": "wrong"}, follow_redirects=False)
    assert wrong.status_code == 422
    assert wrong.headers["content-type"] == "text/html; charset=utf-8"
    assert 'role="alert"' in wrong.text and 'action="/session"' in wrong.text
    assert "set-cookie" not in wrong.headers
    signed = guarded.post("/session", data={"token": TOKEN}, follow_redirects=False)
    assert signed.headers["location"] == "/"
    assert "HttpOnly" in signed.headers["set-cookie"]
    assert TOKEN not in signed.headers["set-cookie"]
    assert guarded.get("/v1/jobs").status_code == 200
    guarded.cookies.clear()
    assert guarded.get("/v1/jobs").status_code == 401


def test_cookie_behind_a_proxy_with_tls_is_secure_on_sockets_of_ipv6(tmp_path: Path) -> None:
    settings = Settings(host="::", data=tmp_path, token=TOKEN)
    with running(create_app(settings), host="::") as (_, address):
        assert address.startswith("http://127.0.0.1:")
        for scheme in ("https", "http"):
            headers = {"X-Forwarded-Proto": scheme}
            url = f"{address}/session"
            answer = patient_http.post(url, json={"token": TOKEN}, headers=headers)
            assert ("secure" in answer.headers["set-cookie"].lower()) == (scheme == "https")


@pytest.mark.parametrize(
    ("given", "peer", "counts"),
    [
        (None, "::ffff:127.0.0.1", True),
        (None, "::1", True),
        (None, "::ffff:10.0.0.2", False),
        ("10.0.0.2, 10.1.0.0/16", "::ffff:10.1.2.3", True),
        ("10.0.0.2, 10.1.0.0/16", "127.0.0.1", False),
        ("*", "192.0.2.7", True),
    ],
)
def test_headers_of_listed_proxies_count(given: str | None, peer: str, counts: bool) -> None:
    async def app(scope: Scope, _receive: Receive, _send: Send) -> None:
        schemes.append(scope["scheme"])

    schemes: list[str] = []
    layer = ProxyHeadersMiddleware(app, trusted_proxies(given))
    headers = [(b"x-forwarded-proto", b"https")]
    scope = {"type": "http", "scheme": "http", "client": (peer, 1), "headers": headers}
    asyncio.run(layer(scope, None, None))
    assert schemes == ["https" if counts else "http"]


def test_cookies_of_two_servers_of_a_host_name_do_not_replace_each_other(
    guarded: TestClient, tmp_path: Path
) -> None:
    token, set_cookies = "another-token-of-some-length", dict[str, str]()
    settings = Settings(host="0.0.0.0", data=tmp_path, token=token)
    other = TestClient(create_app(settings), base_url="http://robot.example:8001")
    for one, its_token in ((guarded, TOKEN), (other, token)):
        one.post("/session", json={"token": its_token}).raise_for_status()
        set_cookies |= dict(one.cookies)
        one.cookies.clear()
    header = "; ".join(f"{name}={value}" for name, value in set_cookies.items())
    for one in (guarded, other):
        assert one.get("/v1/nothing", headers={"Cookie": header}).status_code == 404
        assert one.get("/v1/nothing").status_code == 401


def test_foreign_origin_is_refused_in_spite_of_the_token(guarded: TestClient) -> None:
    headers = {**bearer(), "Origin": "http://evil.example"}
    assert guarded.get("/v1/jobs", headers=headers).status_code == 403


def bearer() -> dict[str, str]:
    return {"Authorization": f"Bearer {TOKEN}"}


def test_browsers_find_the_icon_where_they_look_for_it(guarded: TestClient) -> None:
    answer = guarded.get("/favicon.ico")
    assert answer.status_code == 200
    assert answer.headers["content-type"] == "image/x-icon"
    assert answer.content[:4] == b"\x00\x00\x01\x00"
