"""ASGI middleware that checks address and body of a request before its route.

A body is JSON or, on some routes, a file; uncompressed and of limited size. Wrong encoding,
type or size and unstorable text or integers (``texts.py``) are answered by problems.
"""

from collections.abc import Mapping
from functools import lru_cache

from starlette.routing import compile_path
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.api.problems import (
    BodyTooLarge,
    ProblemResponse,
    body_too_large,
    member_problem,
)
from app.api.security import headers_of, path_of
from app.api.texts import fault_in_address, fault_in_json
from app.api.validation import member

MAX_BODY_BYTES = 1 << 20
JSON_ONLY_PREFIX = "/v1/"
FILE_TYPES = ("application/octet-stream", "text/plain", "text/csv")
"""Content types of an uploaded file; none is allowed, too."""
FORM = "application/x-www-form-urlencoded"
_MANY_PATHS, _MANY_TYPES = 256, 64
"""Sizes of the caches of paths and content types."""


class BodyMiddleware:
    """ASGI middleware that refuses unacceptable requests.

    Status 413 for large bodies, 415 for compressed ones or a wrong type, 422 for unstorable
    text and integers.

    Args:
        files: Routes that take files by POST or PUT, each with its largest file [bytes].
    """

    def __init__(self, app: ASGIApp, *, files: Mapping[str, int]) -> None:
        self.app = app
        self.files = [(compile_path(path)[0], largest) for path, largest in files.items()]
        self._largest_file = lru_cache(_MANY_PATHS)(self._find_largest_file)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on with a counted body, or answer it here."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        path, headers = path_of(scope), headers_of(scope)
        largest = self._largest_file(scope["method"], path)
        takes_file = largest is not None
        max_bytes = MAX_BODY_BYTES if largest is None else largest
        is_form = _media_type(headers.get("content-type", "")) == FORM
        refused = _refused_head(scope, headers, takes_file, max_bytes)
        if refused is None and _has_body(headers) and not takes_file and not is_form:
            body, messages = await read_whole(receive)
            receive = repeating(messages, receive)
            refused = _refused_json(body, scope["path"])
        else:
            receive = _counted(receive, max_bytes)
        if refused is not None:
            await refused(scope, receive, send)
            return
        await self.app(scope, receive, send)

    def _find_largest_file(self, method: str, path: str) -> int | None:
        """Return the size of the largest file that a request may have; None: it takes none."""
        if method not in ("POST", "PUT"):
            return None
        return next((size for pattern, size in self.files if pattern.match(path)), None)


def _refused_head(
    scope: Scope, headers: Mapping[str, str], takes_file: bool, max_bytes: int
) -> ProblemResponse | None:
    """Return the problem of address, size, encoding or type; None where there is none."""
    path, instance = path_of(scope), scope["path"]
    fault = fault_in_address(path, scope["query_string"])
    if fault is not None:
        return member_problem(422, "invalid-input", fault, instance)
    length = headers.get("content-length", "")
    if length.isdecimal() and exceeds(length, max_bytes):
        return body_too_large(f"{length} bytes", max_bytes, instance)
    if not _has_body(headers):
        return None
    encoding, given = headers.get("content-encoding", ""), headers.get("content-type", "")
    if encoding.strip().lower() not in ("", "identity"):
        rule = "must be identity: bodies are sent uncompressed"
        fault = member("Content-Encoding", repr(encoding), rule, ["identity"])
        return member_problem(
            415, "wrong-encoding", fault, instance, {"Accept-Encoding": "identity"}
        )
    if takes_file and given and _media_type(given) not in FILE_TYPES:
        return _wrong_type(given, "must be a file's", FILE_TYPES, instance)
    if not takes_file and path.startswith(JSON_ONLY_PREFIX) and not is_json(given):
        return _wrong_type(given, "must be JSON", ("application/json",), instance)
    return None


def _has_body(headers: Mapping[str, str]) -> bool:
    return headers.get("content-length", "") not in ("", "0") or "transfer-encoding" in headers


def exceeds(length: str, most: int) -> bool:
    """Return whether a decimal of any length is greater than a number."""
    digits = length.lstrip("0")
    return len(digits) > len(str(most)) or int(digits or "0") > most


async def read_whole(receive: Receive) -> tuple[bytes, list[Message]]:
    """Read a JSON body until it ends or exceeds the limit; return it and its messages.

    The last message is no ``http.request`` where the client has left.
    """
    body, messages, more = b"", list[Message](), True
    while more:
        message = await receive()
        messages.append(message)
        body += message.get("body", b"")
        more = message.get("more_body", False) and len(body) <= MAX_BODY_BYTES
    return body, messages


def repeating(messages: list[Message], receive: Receive) -> Receive:
    """Return a ``receive`` that repeats messages first."""
    left = messages[::-1]

    async def receive_again() -> Message:
        return left.pop() if left else await receive()

    return receive_again


def _refused_json(body: bytes, instance: str) -> ProblemResponse | None:
    """Return the problem of a body; None where there is none."""
    if len(body) > MAX_BODY_BYTES:
        value = f"more than {MAX_BODY_BYTES} bytes"
        return body_too_large(value, MAX_BODY_BYTES, instance)
    fault = fault_in_json(body)
    return None if fault is None else member_problem(422, "invalid-input", fault, instance)


def _counted(receive: Receive, max_bytes: int) -> Receive:
    total = 0

    async def receive_counted() -> Message:
        nonlocal total
        message = await receive()
        total += len(message.get("body", b""))
        if total > max_bytes:
            raise BodyTooLarge(max_bytes)
        return message

    return receive_counted


@lru_cache(_MANY_TYPES)
def _media_type(content_type: str) -> str:
    return content_type.partition(";")[0].strip().lower()


def is_json(content_type: str) -> bool:
    """Return whether a content type is that of a JSON body."""
    kind = _media_type(content_type)
    return kind == "application/json" or (
        kind.startswith("application/") and kind.endswith("+json")
    )


def _wrong_type(
    given: str, rule: str, choices: tuple[str, ...], instance: str
) -> ProblemResponse:
    fault = member("Content-Type", repr(given), rule, choices)
    return member_problem(415, "wrong-media-type", fault, instance)
