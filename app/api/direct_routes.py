"""ASGI middleware that answers decision routes before the framework's routing.

The route is called with its body, validated as JSON bytes, and its answer is written once.
Other requests, and those without success, are left to the body middleware and the framework,
which receive the body again, so that every problem is written in one place. With traces this
middleware is not used: the framework makes the spans of requests.
"""

from collections.abc import Iterable
from typing import get_type_hints

from fastapi.routing import APIRoute
from pydantic import BaseModel, ValidationError
from pydantic_core import to_json
from starlette.types import ASGIApp, Receive, Scope, Send

from app.api.bodies import MAX_BODY_BYTES, exceeds, is_json, read_whole, repeating
from app.api.security import headers_of, path_of
from app.api.texts import fault_in_json
from app.errors import ServiceError

JSON_HEAD = (b"content-type", b"application/json")
_CODINGS = frozenset(("content-encoding", "transfer-encoding"))


class DirectRouteMiddleware:
    """ASGI middleware around the body middleware and the framework.

    Each route is a ``POST`` to an asynchronous function of a body, ``request``, and the
    services.
    """

    def __init__(self, app: ASGIApp, *, routes: Iterable[APIRoute]) -> None:
        self.app = app
        self.routes = {
            one.path: (one, get_type_hints(one.endpoint)["request"]) for one in routes
        }

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or pass it on."""
        is_post = scope["type"] == "http" and scope["method"] == "POST"
        found = self.routes.get(path_of(scope)) if is_post else None
        if found is None or not _is_ordinary(scope):
            await self.app(scope, receive, send)
            return
        body, messages = await read_whole(receive)
        left = messages[-1]["type"] != "http.request"
        route, model = found
        content = None if left else await _answer(route, model, scope, body)
        if content is None:
            await self.app(scope, repeating(messages, receive), send)
            return
        scope["route"] = route
        length = b"content-length", str(len(content)).encode()
        await send(
            {"type": "http.response.start", "status": 200, "headers": [length, JSON_HEAD]}
        )
        await send({"type": "http.response.body", "body": content})


def _is_ordinary(scope: Scope) -> bool:
    """Return whether a request has a JSON body of a known, allowed size, and no query."""
    headers = headers_of(scope)
    length = headers.get("content-length", "")
    return (
        is_json(headers.get("content-type", ""))
        and _CODINGS.isdisjoint(headers)
        and length.isdecimal()
        and not exceeds(length, MAX_BODY_BYTES)
        and not scope["query_string"]
    )


async def _answer(
    route: APIRoute, model: type[BaseModel], scope: Scope, body: bytes
) -> bytes | None:
    """Return the answer to a request; None where the framework is to answer."""
    if len(body) > MAX_BODY_BYTES or fault_in_json(body) is not None:
        return None
    try:
        request = model.model_validate_json(body)
        answer = await route.endpoint(request, scope["app"].state.services)
    except (ValidationError, ServiceError):
        return None
    return to_json(answer, inf_nan_mode="null")
