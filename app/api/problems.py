"""Every error as a problem document (RFC 9457, ``application/problem+json``).

Routes contain no ``try``: what they raise comes here. Members beyond the standard's five are
the error's data; bad input always carries ``field``, ``value``, ``rule`` and ``choices``.
"""

import http
import logging
import math
from collections.abc import Mapping, Sequence
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import BaseModel
from starlette.exceptions import HTTPException

from app.errors import (
    CheckpointMismatch,
    Conflict,
    InvalidInput,
    NotFound,
    NotReady,
    ServiceError,
    SimulationError,
    StorageFull,
)

logger = logging.getLogger(__name__)

MEDIA_TYPE = "application/problem+json"
MAX_LISTED_ERRORS = 20
MAX_VALUE_CHARACTERS = 200
STATUS: tuple[tuple[type[ServiceError], int, str], ...] = (
    (NotFound, 404, "not-found"),
    (InvalidInput, 422, "invalid-input"),
    (CheckpointMismatch, 409, "checkpoint-mismatch"),
    (Conflict, 409, "conflict"),
    (NotReady, 503, "not-ready"),
    (StorageFull, 507, "storage-full"),
    (SimulationError, 500, "simulation-error"),
)


class ProblemResponse(JSONResponse):
    """A JSON answer with the media type of problems."""

    media_type = MEDIA_TYPE


class Problem(BaseModel):
    """A problem document, as the API description shows it (RFC 9457)."""

    type: str
    title: str
    status: int
    detail: str
    instance: str
    field: str | None = None
    value: str | None = None
    rule: str | None = None
    choices: list[str] | None = None


def problem(
    status: int,
    detail: str,
    *,
    kind: str | None = None,
    instance: str = "",
    data: Mapping[str, object] | None = None,
    headers: Mapping[str, str] | None = None,
) -> ProblemResponse:
    """Build one problem document.

    Args:
        status: HTTP status.
        detail: One sentence about this occurrence.
        kind: Last part of the type URI; from the status if None.
        instance: Path of the request.
        data: Extension members.
        headers: Headers of the answer.
    """
    title = http.HTTPStatus(status).phrase
    kind = kind or title.lower().replace(" ", "-")
    members: dict[str, object] = {
        "type": f"urn:tandem:problem:{kind}",
        "title": title,
        "status": status,
        "detail": detail,
        "instance": instance,
    }
    return ProblemResponse(
        {**members, **(data or {})}, status, headers=dict(headers) if headers else None
    )


def service_problem(error: ServiceError, instance: str) -> ProblemResponse:
    """Turn an error of the tree into its problem."""
    status, kind = 500, "service-error"
    for error_type, its_status, its_kind in STATUS:
        if isinstance(error, error_type):
            status, kind = its_status, its_kind
            break
    headers = {"Retry-After": "2"} if status == 503 else None
    return problem(
        status,
        error.message,
        kind=kind,
        instance=instance,
        data=error.problem(),
        headers=headers,
    )


def dotted(location: Sequence[str | int]) -> str:
    """Write a pydantic location as a path: ``("body", "robot", "q", 3)`` -> ``robot.q[3]``."""
    path = ""
    for part in location[1:] if len(location) > 1 else location:
        if isinstance(part, int):
            path += f"[{part}]"
        else:
            path += f".{part}" if path else part
    return path


def shown(value: object) -> str:
    """Write a value so that it fits a problem: long ones shortened, never a secret dump."""
    if isinstance(value, list | tuple | dict) and len(value) > 8:
        return f"<{type(value).__name__} of {len(value)}>"
    if isinstance(value, bytes):
        return f"<{len(value)} bytes>"
    text = repr(value)
    if len(text) > MAX_VALUE_CHARACTERS:
        text = text[: MAX_VALUE_CHARACTERS - 3] + "..."
    return text


def validation_member(error: Mapping[str, Any], body: type[BaseModel] | None) -> dict[str, object]:
    """Say field, value, rule and choices of one validation error."""
    location = tuple(error["loc"])
    value = error.get("input")
    rule = str(error["msg"])
    choices: list[str] = []
    expected = error.get("ctx", {}).get("expected")
    if error["type"] in ("literal_error", "enum", "union_tag_invalid"):
        text = expected or error["ctx"].get("expected_tags", "")
        choices = [part.strip(" '") for part in text.replace(" or ", ", ").split(",")]
    if error["type"] == "extra_forbidden":
        rule, choices = "is not a known field", known_fields(body, location[1:-1])
    if isinstance(value, float) and not math.isfinite(value):
        rule = "must be a finite number"
    if error["type"] == "json_invalid":
        return {
            "field": "body",
            "value": f"character {location[-1]}",
            "rule": f"must be JSON: {error['ctx']['error']}",
            "choices": [],
        }
    return {"field": dotted(location), "value": shown(value), "rule": rule, "choices": choices}


def known_fields(model: type[BaseModel] | None, path: Sequence[str | int]) -> list[str]:
    """List the fields of the model at ``path`` inside ``model``; empty where unknown."""
    for part in path:
        if model is None or isinstance(part, int):
            continue
        field = model.model_fields.get(part)
        model = _inner_model(field.annotation) if field else None
    return list(model.model_fields) if model else []


def _inner_model(annotation: Any) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for argument in getattr(annotation, "__args__", ()):
        found = _inner_model(argument)
        if found:
            return found
    return None


def _body_model(request: Request) -> type[BaseModel] | None:
    field = getattr(request.scope.get("route"), "body_field", None)
    return _inner_model(field.field_info.annotation) if field else None


async def on_service_error(request: Request, error: Exception) -> ProblemResponse:
    """Answer an error that Tandem raised on purpose."""
    assert isinstance(error, ServiceError)
    answer = service_problem(error, request.url.path)
    if answer.status_code >= 500 and not isinstance(error, NotReady):
        logger.error("%s %s: %s", request.method, request.url.path, error, exc_info=error)
    return answer


async def on_validation_error(request: Request, error: Exception) -> ProblemResponse:
    """Answer input that does not fit its schema."""
    assert isinstance(error, RequestValidationError)
    body = _body_model(request)
    found = [validation_member(one, body) for one in error.errors()[:MAX_LISTED_ERRORS]]
    first = found[0]
    detail = f"{first['field'] or 'body'} = {first['value']}: {first['rule']}"
    status, kind = (400, "malformed-json") if first["field"] == "body" else (422, None)
    return problem(
        status,
        detail,
        kind=kind or "invalid-input",
        instance=request.url.path,
        data={**first, "errors": found},
    )


async def on_http_error(request: Request, error: Exception) -> ProblemResponse:
    """Answer what the framework refuses: unknown path, wrong method, too large a body."""
    assert isinstance(error, HTTPException)
    detail = {
        404: f"nothing is at {request.url.path}; /docs lists what is",
        405: f"{request.method} is not answered at {request.url.path}",
    }.get(error.status_code, str(error.detail))
    data: dict[str, object] = {}
    if error.status_code == 405:
        allowed = (error.headers or {}).get("Allow", "")
        data = {
            "field": "method",
            "value": request.method,
            "rule": "must be one of the choices",
            "choices": [one.strip() for one in allowed.split(",") if one.strip()],
        }
    return problem(
        error.status_code,
        detail,
        instance=request.url.path,
        data=data,
        headers=error.headers,
    )


async def on_bug(request: Request, error: Exception) -> ProblemResponse:
    """Answer what nobody foresaw; the trace goes to the log, never to the caller."""
    return problem(
        500, "an unforeseen error; the server's log has the trace", instance=request.url.path
    )


def install(app: FastAPI) -> None:
    """Make ``app`` answer every error with a problem."""
    app.add_exception_handler(ServiceError, on_service_error)
    app.add_exception_handler(RequestValidationError, on_validation_error)
    app.add_exception_handler(HTTPException, on_http_error)
    app.add_exception_handler(Exception, on_bug)
