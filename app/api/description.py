"""The OpenAPI document: answers of every operation, access, and names of operations.

A route declares the problems that only it has: ``responses={409: {"description": ...}}``. Those
that layers and server give to any request are added here, all as ``application/problem+json``.
"""

import http
from typing import Any

from fastapi import FastAPI, Response
from pydantic import BaseModel

from app.api.bodies import FILE_TYPES
from app.api.problems import MEDIA_TYPE, Problem
from app.api.security import COOKIE, cookie_name

PROBLEMS = {
    400: ("BadRequest", "The body is incomplete or not JSON, or the request is not HTTP/1.1"),
    401: ("Unauthorized", "The server requires its token"),
    403: ("Forbidden", "`Origin` is another site than this server"),
    404: ("NotFound", "Nothing has that name or id; `known` lists the names, where few"),
    408: ("RequestTimeout", "Head or body of the request arrived too slowly"),
    409: ("Conflict", "The request contradicts the present state"),
    413: ("BodyTooLarge", "The body is longer than the route allows"),
    415: ("WrongMediaType", "`Content-Type` or `Content-Encoding` is not one of `choices`"),
    421: (
        "WrongHost",
        "`Host` is given twice, or names another machine and no token is set",
    ),
    422: ("InvalidInput", "A value breaks a rule: `field`, `value`, `rule`, `choices`"),
    431: ("HeadTooLarge", "URL and headers are longer than the server allows"),
    500: ("Failure", "Stored data are damaged, or an unexpected error occurred"),
    503: ("NotReady", "The service cannot answer for now; `Retry-After` [s]"),
    507: ("StorageFull", "The database or its disk is full; nothing was stored"),
}
"""Name and description of each problem's status."""
EVERYWHERE = (400, 401, 403, 408, 413, 415, 421, 422, 431, 500, 503)
"""Problems of layers, server and database, which any request may get."""
_HEADERS = {401: "WWW-Authenticate", 503: "Retry-After"}
_ACCESS = (
    "Needed where the server has a token; on loopback without a token only `Host` and `Origin` "
    "are checked"
)
CREATED: dict[str, Any] = {
    "headers": {
        "Location": {"description": "path of the resource", "schema": {"type": "string"}}
    }
}
"""An answer with the path of its resource."""
FILE_BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {
            kind: {"schema": {"type": "string", "format": "binary"}} for kind in FILE_TYPES
        },
    }
}
"""A body that is a file itself."""
MISMATCH: dict[int | str, dict[str, Any]] = {
    409: {"description": "The checkpoint is of another kind, or does not fit the cell"}
}
"""The problem of a request that names a checkpoint or uses the cell's."""


def stored_responses(model: type[BaseModel], same: str) -> dict[int | str, dict[str, Any]]:
    """Return the answers to a request that stores a resource.

    Args:
        same: What is stored already with status 200, as text.
    """
    return {
        200: {"model": model, "description": f"{same} is stored already", **CREATED},
        201: CREATED,
        507: {},
    }


def set_stored(response: Response, location: str, *, new: bool) -> None:
    """Set status and ``Location`` of an answer of :func:`stored_responses`."""
    response.status_code = 201 if new else 200
    response.headers["Location"] = location


def install(app: FastAPI) -> None:
    """Complete the document that FastAPI writes of an application."""
    plain = app.openapi

    def openapi() -> dict[str, Any]:
        document = plain()
        if "responses" not in document["components"]:
            token: str | None = app.state.token
            _complete(document, COOKIE if token is None else cookie_name(token))
        return document

    app.openapi = openapi  # type: ignore[method-assign]


def _complete(document: dict[str, Any], cookie: str) -> None:
    """Add the problems of every operation, their schema and the kinds of access."""
    parts = document["components"]
    schema = Problem.model_json_schema(ref_template="#/components/schemas/{model}")
    parts["schemas"] |= schema.pop("$defs") | {Problem.__name__: schema}
    parts["responses"] = {
        name: _problem(status, text) for status, (name, text) in PROBLEMS.items()
    }
    parts["securitySchemes"] = {
        "token": {"type": "http", "scheme": "bearer", "description": _ACCESS},
        "session": {"type": "apiKey", "in": "cookie", "name": cookie, "description": _ACCESS},
    }
    document["security"] = [{"token": []}, {"session": []}, {}]
    for path, operations in document["paths"].items():
        for operation in operations.values():
            _add_problems(operation["responses"], has_name="{" in path)


def _add_problems(responses: dict[str, Any], *, has_name: bool) -> None:
    for common in [*EVERYWHERE, *([404] if has_name else [])]:
        responses.setdefault(str(common), {})
    for status in sorted(responses):
        answer, number = responses.pop(status), int(status)
        if number >= 400:
            text = answer.get("description", "")
            if text in ("", http.HTTPStatus(number).phrase):  # none of its own
                answer = {"$ref": f"#/components/responses/{PROBLEMS[number][0]}"}
            else:
                answer = _problem(number, text)
        responses[status] = answer


def _problem(status: int, description: str) -> dict[str, Any]:
    """Return the description of a problem."""
    content: dict[str, Any] = {
        MEDIA_TYPE: {"schema": {"$ref": f"#/components/schemas/{Problem.__name__}"}}
    }
    if status == 401:  # to a browser: the page that asks for the token
        content["text/html"] = {"schema": {"type": "string"}}
    found: dict[str, Any] = {"description": description, "content": content}
    if status in _HEADERS:
        found["headers"] = {_HEADERS[status]: {"schema": {"type": "string"}}}
    return found
