"""What a request body may be: JSON, or a file where one is taken, and not more than a limit.

Wrong type and size are refused before a route sees them, as problems.
"""

from collections.abc import Mapping, Sequence

from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.api.problems import problem
from app.api.security import path_of

MAX_BODY_BYTES = 1 << 20
JSON_ONLY_PREFIX = "/v1/"
FILE_TYPES = ("application/octet-stream", "text/plain", "text/csv")
"""Content types of a file that is posted as it is; none is one, too."""


class BodyRules:
    """ASGI layer that refuses bodies that are too large (413) or of a wrong type (415).

    Args:
        app: What it protects.
        max_bytes: Largest JSON body that is read.
        files: Paths to which files are posted, each with its largest one [bytes].
    """

    def __init__(
        self,
        app: ASGIApp,
        *,
        max_bytes: int = MAX_BODY_BYTES,
        files: Mapping[str, int] | None = None,
    ) -> None:
        self.app = app
        self.max_bytes = max_bytes
        self.files = dict(files or {})

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let a request through with a counted body, or answer it here."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        path = path_of(scope)
        takes_file = scope["method"] == "POST" and path in self.files
        max_bytes = self.files[path] if takes_file else self.max_bytes
        headers = Headers(scope=scope)
        length = headers.get("content-length", "")
        if length.isdecimal() and int(length) > max_bytes:
            await _refuse_size(f"{length} bytes", max_bytes, scope, receive, send)
            return
        has_body = length not in ("", "0") or "transfer-encoding" in headers
        given = headers.get("content-type", "")
        if takes_file:
            if given and _media_type(given) not in FILE_TYPES:
                await _refuse_type(given, "must be a file's", FILE_TYPES, scope, receive, send)
                return
        elif has_body and path.startswith(JSON_ONLY_PREFIX) and not _is_json(given):
            choices = ("application/json",)
            await _refuse_type(given, "must be JSON", choices, scope, receive, send)
            return
        await self.app(scope, _counted(receive, max_bytes), send)


def _counted(receive: Receive, max_bytes: int) -> Receive:
    total = 0

    async def receive_counted() -> Message:
        nonlocal total
        message = await receive()
        total += len(message.get("body", b""))
        if total > max_bytes:
            raise HTTPException(413, f"the body must be at most {max_bytes} bytes")
        return message

    return receive_counted


async def _refuse_size(
    value: str, max_bytes: int, scope: Scope, receive: Receive, send: Send
) -> None:
    rule = f"must be at most {max_bytes} bytes"
    answer = problem(
        413,
        f"the body has {value}; it {rule}",
        kind="body-too-large",
        instance=scope["path"],
        data={"field": "body", "value": value, "rule": rule, "choices": []},
        headers={"Connection": "close"},
    )
    await answer(scope, receive, send)


def _media_type(content_type: str) -> str:
    return content_type.partition(";")[0].strip().lower()


def _is_json(content_type: str) -> bool:
    kind = _media_type(content_type)
    return kind == "application/json" or (
        kind.startswith("application/") and kind.endswith("+json")
    )


async def _refuse_type(
    given: str, rule: str, choices: Sequence[str], scope: Scope, receive: Receive, send: Send
) -> None:
    answer = problem(
        415,
        f"the body is {given or 'of no stated type'}; it {rule}",
        kind="wrong-media-type",
        instance=scope["path"],
        data={
            "field": "Content-Type",
            "value": repr(given),
            "rule": rule,
            "choices": list(choices),
        },
    )
    await answer(scope, receive, send)
