"""Every error as a problem document (RFC 9457, ``application/problem+json``).

Routes contain no ``try``: what they raise comes here. Members beyond the standard's five are
the error's data; bad input always carries ``field``, ``value``, ``rule`` and ``choices``.
"""

import http
import logging
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, get_args

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import BaseModel
from starlette.exceptions import HTTPException
from starlette.routing import Match

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
NOTHING = "nothing"
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
    for part in location[1:] or location:
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


def validation_member(
    error: Mapping[str, Any], body: type[BaseModel] | None
) -> dict[str, object]:
    """Say field, value, rule and choices of one validation error."""
    kind, context = str(error["type"]), error.get("ctx", {})
    location, value = tuple(error["loc"]), error.get("input")
    rule = str(error["msg"]).replace("Input should be ", "must be ")
    choices: list[str] = []
    if kind == "json_invalid":
        rule = f"must be JSON: {context['error']}"
        return _member("body", f"character {location[-1]}", rule)
    if kind.startswith("union_tag_"):
        return _tag_member(location, value, context)
    if kind == "missing":
        return _member(dotted(location), NOTHING, "is required")
    if kind in ("model_attributes_type", "model_type", "dict_type"):
        return _member(dotted(location), shown(value), "must be a JSON object")
    if kind in ("literal_error", "enum"):
        choices = _listed(context["expected"])
        rule = "must be one of the choices"
    elif kind == "extra_forbidden":
        rule, choices = "is not a known field", known_fields(body, location[1:-1])
    elif kind in ("too_short", "too_long"):
        side, bound = ("at least", "min") if kind == "too_short" else ("at most", "max")
        rule = f"must have {side} {context[bound + '_length']} items"
        rule += f", not {context['actual_length']}" if context.get("actual_length") else ""
    elif isinstance(value, float) and not math.isfinite(value):
        rule = "must be a finite number"
    return _member(dotted(location), shown(value), rule, choices)


def _member(
    field: str, value: str, rule: str, choices: Sequence[str] = ()
) -> dict[str, object]:
    return {"field": field, "value": value, "rule": rule, "choices": list(choices)}


def _tag_member(
    location: tuple[str | int, ...], value: object, context: Mapping[str, Any]
) -> dict[str, object]:
    """Say that the member which tells the kinds of a body apart is missing or unknown."""
    field = dotted((*location, context["discriminator"].strip("'")))
    if "tag" not in context:
        return _member(field, NOTHING, "is required")
    rule = "must be one of the choices"
    return _member(field, shown(context["tag"]), rule, _listed(context["expected_tags"]))


def _listed(expected: str) -> list[str]:
    return [part.strip(" '") for part in expected.replace(" or ", ", ").split(",")]


def known_fields(model: type[BaseModel] | None, path: Sequence[str | int]) -> list[str]:
    """List the fields of the model at ``path`` inside ``model``; empty where unknown."""
    for part in path:
        if model is None or isinstance(part, int):
            continue
        field = model.model_fields.get(part)
        models = list(_models(field.annotation)) if field else []
        model = models[0] if models else None
    return list(model.model_fields) if model else []


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    """Yield the models named anywhere in an annotation."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in get_args(annotation):
        yield from _models(argument)


def _without_tag(
    error: dict[str, Any], variants: Sequence[type[BaseModel]]
) -> tuple[dict[str, Any], type[BaseModel] | None]:
    """Take the tag out of a location inside a tagged union; return the variant it names."""
    location = error["loc"]
    if len(variants) < 2 or len(location) < 2:
        return error, variants[0] if variants else None
    for variant in variants:
        for field in variant.model_fields.values():
            if location[1] in get_args(field.annotation):
                return {**error, "loc": (location[0], *location[2:])}, variant
    return error, None


def _body_models(request: Request) -> list[type[BaseModel]]:
    field = getattr(request.scope.get("route"), "body_field", None)
    return list(_models(field.field_info.annotation)) if field else []


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
    models = _body_models(request)
    cut = [_without_tag(one, models) for one in error.errors()[:MAX_LISTED_ERRORS]]
    found = [validation_member(one, model) for one, model in cut]
    malformed = error.errors()[0]["type"] == "json_invalid"
    first = found[0]
    given = "" if first["value"] == NOTHING else f" = {first['value']}"
    return problem(
        400 if malformed else 422,
        f"{first['field']}{given} {first['rule']}",
        kind="malformed-json" if malformed else "invalid-input",
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
    headers = dict(error.headers or {})
    if error.status_code == 405:
        choices = _methods_at(request)
        headers["Allow"] = ", ".join(choices)
        data = _member("method", request.method, "must be one of the choices", choices)
    return problem(
        error.status_code,
        detail,
        instance=request.url.path,
        data=data,
        headers=headers,
    )


def _methods_at(request: Request) -> list[str]:
    """List the methods that the path of a request answers, over all routes."""
    routes = request.app.routes
    return [
        method
        for method in ("GET", "POST", "PUT", "PATCH", "DELETE")
        if any(
            route.matches({**request.scope, "method": method})[0] is Match.FULL
            for route in routes
        )
    ]


async def on_bug(request: Request, _error: Exception) -> ProblemResponse:
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
