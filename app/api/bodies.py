"""What a request body may be: JSON, and not more than a limit.

Wrong type and size are refused before a route sees them, as problems.
"""

from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.api.problems import problem

MAX_BODY_BYTES = 1 << 20
JSON_ONLY_PREFIX = "/v1/"


class BodyRules:
    """ASGI layer that refuses bodies that are too large (413) or no JSON (415).

    Args:
        app: What it protects.
        max_bytes: Largest body that is read.
    """

    def __init__(self, app: ASGIApp, *, max_bytes: int = MAX_BODY_BYTES) -> None:
        self.app = app
        self.max_bytes = max_bytes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let a request through with a counted body, or answer it here."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        length = headers.get("content-length", "")
        if length.isdecimal() and int(length) > self.max_bytes:
            await self._refuse_size(f"{length} bytes", scope, receive, send)
            return
        has_body = length not in ("", "0") or "transfer-encoding" in headers
        given = headers.get("content-type", "")
        if has_body and scope["path"].startswith(JSON_ONLY_PREFIX) and not _is_json(given):
            await _refuse_type(given, scope, receive, send)
            return
        await self.app(scope, self._counted(receive), send)

    def _counted(self, receive: Receive) -> Receive:
        total = 0

        async def receive_counted() -> Message:
            nonlocal total
            message = await receive()
            total += len(message.get("body", b""))
            if total > self.max_bytes:
                raise HTTPException(413, f"the body must be at most {self.max_bytes} bytes")
            return message

        return receive_counted

    async def _refuse_size(
        self, value: str, scope: Scope, receive: Receive, send: Send
    ) -> None:
        rule = f"must be at most {self.max_bytes} bytes"
        answer = problem(
            413,
            f"the body has {value}; it {rule}",
            kind="body-too-large",
            instance=scope["path"],
            data={"field": "body", "value": value, "rule": rule, "choices": []},
            headers={"Connection": "close"},
        )
        await answer(scope, receive, send)


def _is_json(content_type: str) -> bool:
    kind = content_type.partition(";")[0].strip().lower()
    return kind == "application/json" or (
        kind.startswith("application/") and kind.endswith("+json")
    )


async def _refuse_type(given: str, scope: Scope, receive: Receive, send: Send) -> None:
    rule = "must be JSON"
    answer = problem(
        415,
        f"the body is {given or 'of no stated type'}; it {rule}",
        kind="wrong-media-type",
        instance=scope["path"],
        data={
            "field": "Content-Type",
            "value": repr(given),
            "rule": rule,
            "choices": ["application/json"],
        },
    )
    await answer(scope, receive, send)
