"""Errors as problem documents (RFC 9457, ``application/problem+json``).

Routes contain no ``try``; exception handlers here answer their errors. Members beyond the
standard's five are the error's data; bad input has ``field``, ``value``, ``rule``, ``choices``.
"""

import http
import json
import logging
from collections.abc import Mapping, Sequence
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError, WebSocketRequestValidationError
from fastapi.responses import JSONResponse
from pydantic import BaseModel, ConfigDict, Field
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.routing import Match
from starlette.websockets import WebSocket

from app.api.sockets import POLICY, refuse
from app.api.validation import (
    BodyFault,
    Member,
    body_models,
    fault_text,
    member,
    merged,
    validation_member,
    without_tag,
)
from app.errors import (
    CheckpointMismatch,
    Conflict,
    Damaged,
    InvalidInput,
    MissingPackage,
    NotFound,
    NotReady,
    ServiceError,
    SimulationError,
)
from app.logs import REQUEST_ID
from app.storage_errors import StaleAttempt, StorageDamaged, StorageFull, StorageUnavailable

logger = logging.getLogger(__name__)

MEDIA_TYPE = "application/problem+json"
MAX_LISTED_ERRORS = 20
STATUS: tuple[tuple[type[ServiceError], int, str], ...] = (
    (NotFound, 404, "not-found"),
    (InvalidInput, 422, "invalid-input"),
    (Damaged, 500, "damaged"),
    (CheckpointMismatch, 409, "checkpoint-mismatch"),
    (StaleAttempt, 409, "stale-attempt"),
    (Conflict, 409, "conflict"),
    (NotReady, 503, "not-ready"),
    (MissingPackage, 501, "missing-package"),
    (StorageFull, 507, "storage-full"),
    (StorageDamaged, 500, "storage-damaged"),
    (StorageUnavailable, 503, "storage-unavailable"),
    (SimulationError, 500, "simulation-error"),
)


_JSON = json.JSONEncoder(ensure_ascii=False, allow_nan=False, separators=(",", ":"))


class ProblemResponse(JSONResponse):
    """A JSON answer with the media type of problems."""

    media_type = MEDIA_TYPE

    def render(self, content: object) -> bytes:
        """Return JSON; a lone surrogate of the request is escaped again."""
        return _JSON.encode(content).encode("utf-8", "backslashreplace")


class FaultPublic(BaseModel):
    """A value that breaks a rule."""

    field: str = Field(description="its path in the request, such as `robot.q[3]`")
    value: str = Field(description="the value as text; empty or `nothing` where there is none")
    rule: str = Field(description="the rule, as a sentence part")
    choices: list[str] = Field([], description="allowed values, where there are few")
    hint: str | None = Field(None, description="probable intention or remedy")


class Problem(BaseModel):
    """A problem document (RFC 9457); further members depend on its type."""

    model_config = ConfigDict(extra="allow")

    type: str = Field(description="its kind: `urn:tandem:problem:...`")
    title: str = Field(description="phrase of the status")
    status: int
    detail: str = Field(description="a sentence on this occurrence")
    instance: str = Field(description="path of the request, with the root path")
    request_id: str | None = Field(None, description="id of the request, as in `X-Request-ID`")
    field: str | None = Field(None, description="path of the faulty value; see `errors`")
    value: str | None = None
    rule: str | None = None
    choices: list[str] | None = None
    errors: list[FaultPublic] | None = Field(
        None, description="faults of a body or file, at most 20; all faults of a cell"
    )


def problem(
    status: int,
    detail: str,
    *,
    kind: str | None = None,
    instance: str = "",
    data: Mapping[str, object] | None = None,
    headers: Mapping[str, str] | None = None,
) -> ProblemResponse:
    """Return a problem document; with status 503, it asks for a repetition after 2 s.

    Args:
        detail: One sentence about this occurrence.
        kind: Last part of the type URI; from the status if None.
        instance: Path of the request.
        data: Extension members.
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
    if (request_id := REQUEST_ID.get()) is not None:
        members["request_id"] = request_id
    wait = {"Retry-After": "2"} if status == 503 else {}
    return ProblemResponse({**members, **(data or {})}, status, {**wait, **(headers or {})})


def member_problem(
    status: int,
    kind: str,
    fault: Member,
    instance: str,
    headers: Mapping[str, str] | None = None,
) -> ProblemResponse:
    """Return the problem of one faulty member; arguments as of :func:`problem`."""
    detail = fault_text(fault)
    return problem(status, detail, kind=kind, instance=instance, data=fault, headers=headers)


class BodyTooLarge(HTTPException):
    """A body of unstated length exceeds the limit while it is read.

    Args:
        max_bytes: The limit [bytes].
    """

    def __init__(self, max_bytes: int) -> None:
        super().__init__(413)
        self.max_bytes = max_bytes


def body_too_large(value: str, max_bytes: int, instance: str) -> ProblemResponse:
    """Return the problem of a body whose size, as text, exceeds the limit."""
    fault = member("body", value, f"must be at most {max_bytes} bytes")
    return member_problem(413, "body-too-large", fault, instance, {"Connection": "close"})


def service_problem(error: ServiceError, instance: str) -> ProblemResponse:
    """Return the problem of an error."""
    known = ((status, kind) for one, status, kind in STATUS if isinstance(error, one))
    status, kind = next(known, (500, "service-error"))
    return problem(status, error.message, kind=kind, instance=instance, data=error.problem())


async def on_service_error(request: Request, error: Exception) -> ProblemResponse:
    """Answer an error of Tandem."""
    assert isinstance(error, ServiceError)
    answer = service_problem(error, request.url.path)
    if answer.status_code >= 500 and not isinstance(error, NotReady):
        logger.error("%s %s: %s", request.method, request.url.path, error, exc_info=error)
    return answer


async def on_validation_error(request: Request, error: Exception) -> ProblemResponse:
    """Answer a request that does not match its schema."""
    assert isinstance(error, RequestValidationError)
    models = [error.model] if isinstance(error, BodyFault) else body_models(request)
    return validation_problem(error.errors(), models, request.url.path)


def validation_problem(
    errors: Sequence[dict[str, Any]], models: Sequence[type[BaseModel]], instance: str
) -> ProblemResponse:
    """Return the problem of schema errors.

    Args:
        errors: Pydantic's errors, with locations that begin with ``body``; at least one.
        models: The possible models of the body.
    """
    cut = [without_tag(one, models) for one in errors[:MAX_LISTED_ERRORS]]
    found = merged([validation_member(one, model) for one, model in cut])
    malformed = errors[0]["type"] == "json_invalid"
    status, kind = (400, "malformed-json") if malformed else (422, "invalid-input")
    data = {**found[0], "errors": found}
    return problem(status, fault_text(found[0]), kind=kind, instance=instance, data=data)


async def on_http_error(request: Request, error: Exception) -> ProblemResponse:
    """Answer an error of the framework: unknown path, wrong method, large body."""
    assert isinstance(error, HTTPException)
    if isinstance(error, BodyTooLarge):
        most = error.max_bytes
        return body_too_large(f"more than {most} bytes", most, request.url.path)
    detail = {
        404: f"there is no route {request.url.path}; /docs lists all",
        405: f"{request.url.path} has no method {request.method}",
    }.get(error.status_code, str(error.detail))
    data: dict[str, object] = {}
    headers = dict(error.headers or {})
    if error.status_code == 405:
        choices = _methods_at(request)
        headers["Allow"] = ", ".join(choices)
        data = member("method", request.method, "must be one of the choices", choices)
    return problem(
        error.status_code, detail, instance=request.url.path, data=data, headers=headers
    )


def _methods_at(request: Request) -> list[str]:
    """Return the methods of a path over all routes."""
    if "app_root_path" in request.scope:  # below a mount, whose files are only read
        return ["GET", "HEAD"]
    routes = request.app.routes
    return [
        method
        for method in ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE")
        if any(
            route.matches({**request.scope, "method": method.replace("HEAD", "GET")})[0]
            is Match.FULL
            for route in routes
        )
    ]


async def on_disconnect(request: Request, _error: Exception) -> ProblemResponse:
    """Answer a request that ended before its body was complete."""
    return problem(400, "the body of the request is incomplete", instance=request.url.path)


async def on_socket_error(client: WebSocket, error: Exception) -> None:
    """Refuse a socket whose parameters do not match their schema."""
    assert isinstance(error, WebSocketRequestValidationError)
    fault = validation_member(error.errors()[0], None)
    await refuse(client, fault_text(fault), POLICY)


def install(app: FastAPI) -> None:
    """Register the handlers; unexpected errors are answered by ``responses.py``."""
    app.add_exception_handler(WebSocketRequestValidationError, on_socket_error)
    app.add_exception_handler(ServiceError, on_service_error)
    app.add_exception_handler(RequestValidationError, on_validation_error)
    app.add_exception_handler(HTTPException, on_http_error)
    app.add_exception_handler(ClientDisconnect, on_disconnect)
