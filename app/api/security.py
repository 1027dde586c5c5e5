"""Access control: one ASGI middleware around every route, mount and socket.

On loopback no token is required, but ``Host`` must be a loopback name (against DNS rebinding)
and an ``Origin`` must be this site. With a token every request must carry it: as
``Authorization: Bearer`` or as the cookie of ``POST /session``, for browsers, whose sockets and
event streams cannot set that header.
"""

import hashlib
import hmac
import ipaddress
from collections.abc import Iterable, Mapping
from functools import lru_cache
from importlib import resources
from urllib.parse import urlsplit

from starlette.requests import cookie_parser
from starlette.responses import HTMLResponse, Response
from starlette.types import ASGIApp, Receive, Scope, Send

from app.api.problems import problem
from app.api.validation import member

COOKIE = "tandem_session"
"""Start of the name of the session cookie."""
SESSION_PATH = "/session"
_HEADERS_KEY = "tandem.headers"
"""Key of the decoded headers in the scope of a request."""


@lru_cache(maxsize=2)
def sign_in_page(root_path: str, fault: str = "") -> str:
    """Return the page that asks for the token.

    Args:
        root_path: Path under which a reverse proxy shows the service.
        fault: What was wrong with the token that was given, as HTML.
    """
    page = (resources.files("app.api") / "signin.html").read_text("utf-8")
    for name in ("action", "href"):
        page = page.replace(f'{name}="/', f'{name}="{root_path}/')
    return page.replace("<!-- fault -->", fault and f'<p role="alert">{fault}</p>')


def path_of(scope: Scope) -> str:
    """Return the path of a request below the service's root path."""
    path: str = scope["path"]
    return path.removeprefix(scope.get("root_path", ""))


def headers_of(scope: Scope) -> dict[str, str]:
    """Return the headers of a request by lower-case name; of equal names the first."""
    found: dict[str, str] | None = scope.get(_HEADERS_KEY)
    if found is None:
        given = reversed(scope["headers"])
        found = {name.decode("latin-1"): value.decode("latin-1") for name, value in given}
        scope[_HEADERS_KEY] = found
    return found


def session_value(token: str) -> str:
    """Return the content of the session cookie: a proof of the token, not the token."""
    return hmac.new(token.encode(), b"tandem session", hashlib.sha256).hexdigest()


def cookie_name(token: str) -> str:
    """Return the name of the session cookie, another one for each token.

    Browsers send the cookies of a host name to all its ports, and so to several servers.
    """
    mark = hmac.new(token.encode(), b"tandem cookie", hashlib.sha256).hexdigest()
    return f"{COOKIE}_{mark[:8]}"


@lru_cache(maxsize=64)
def is_loopback(host: str) -> bool:
    """Whether the header ``Host`` always means this machine."""
    try:
        name = urlsplit(f"//{host}").hostname or ""
        return name == "localhost" or ipaddress.ip_address(name).is_loopback
    except ValueError:
        return False


class AccessMiddleware:
    """ASGI middleware that checks Host, Origin and token.

    Args:
        token: The token, or None on loopback.
        open_paths: Paths answered without the token (health checks, sign-in); they read
            ``request.state.trusted``.
    """

    def __init__(self, app: ASGIApp, *, token: str | None, open_paths: Iterable[str]) -> None:
        self.app = app
        self.token = token
        self.open_paths = frozenset(open_paths)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or answer it here."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        refusal = self.refusal(scope, headers_of(scope))
        if refusal is None:
            await self.app(scope, receive, send)
            return
        status, kind, detail, data = refusal
        if scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008, "reason": kind})
            return
        headers = {"WWW-Authenticate": "Bearer"} if status == 401 else None
        answer: Response = problem(
            status, detail, kind=kind, instance=scope["path"], data=data, headers=headers
        )
        if status == 401 and "text/html" in headers_of(scope).get("accept", ""):
            answer = HTMLResponse(sign_in_page(scope.get("root_path", "")), 401, headers)
        await answer(scope, receive, send)

    def refusal(
        self, scope: Scope, headers: Mapping[str, str]
    ) -> tuple[int, str, str, dict[str, object]] | None:
        """Return status, kind, detail and data of a refusal, or None."""
        host = headers.get("host", "")
        if sum(name == b"host" for name, _ in scope["headers"]) > 1:
            return _refusal(421, "wrong-host", "Host", host, "must be given once")
        if self.token is None and not is_loopback(host):
            rule = "must be a loopback name: this server is open to this machine only"
            return _refusal(421, "wrong-host", "Host", host, rule)
        origin = headers.get("origin")
        if origin is not None and not _same_site(origin, host):
            rule = "must be the address of this server"
            return _refusal(403, "wrong-origin", "Origin", origin, rule)
        trusted = self.token is None or self._proves_token(headers)
        scope.setdefault("state", {})["trusted"] = trusted
        if not trusted and path_of(scope) not in self.open_paths:
            detail = "this server needs its token, as 'Authorization: Bearer ...'"
            return 401, "token-needed", detail, {}
        return None

    def _proves_token(self, headers: Mapping[str, str]) -> bool:
        assert self.token is not None
        scheme, _, given = headers.get("authorization", "").partition(" ")
        if scheme.lower() == "bearer":
            return hmac.compare_digest(given.strip().encode(), self.token.encode())
        # Other services of this host set cookies, too, of any form.
        proof = cookie_parser(headers.get("cookie", "")).get(cookie_name(self.token), "")
        return hmac.compare_digest(proof.encode(), session_value(self.token).encode())


def _refusal(
    status: int, kind: str, field: str, value: str, rule: str
) -> tuple[int, str, str, dict[str, object]]:
    given = repr(value[:200])
    return status, kind, f"{field} {given} {rule}", member(field, given, rule)


def _same_site(origin: str, host: str) -> bool:
    try:
        parts = urlsplit(origin)
    except ValueError:
        return False
    return parts.scheme in ("http", "https") and parts.netloc.lower() == host.lower()
