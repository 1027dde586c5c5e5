"""Requests, problems and event streams over HTTP, for the operations of the client."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime
from typing import Any, Literal, Self, TypedDict, TypeVar, Unpack, get_args, get_origin
from urllib.parse import quote

import httpx
from pydantic import BaseModel

from app.api.problems import Problem

TIMEOUT_S = 30.0
"""Default time limit of an answer [s]."""
FILE_S = 240.0
"""Least time limit of an answer to a file, which the server imports or checks first [s]."""
SILENCE_S = 60.0
"""Least silence after which a stream fails [s]; the server sends a byte at least every 15 s."""
M = TypeVar("M", bound=BaseModel)
Json = Mapping[str, Any]


class Refused(Exception):
    """The server answered with a problem document.

    Args:
        problem: The problem, with status, detail and, for bad input, field and rule.
        retry_after: Time after which to ask again [s]; None where not stated.
    """

    def __init__(self, problem: Problem, retry_after: float | None) -> None:
        super().__init__(f"{problem.status} {problem.title}: {problem.detail}")
        self.problem, self.retry_after = problem, retry_after


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamEvent:
    """One event of a stream."""

    event: str
    """its kind"""
    id: str
    """id after which the stream can be resumed; empty where it cannot"""
    data: dict[str, Any]
    """its content"""


class RequestParts(TypedDict, total=False):
    """Parts of a request beside its path."""

    query: Json
    """parameters; null ones are left out"""
    headers: Json
    """headers; null ones are left out"""
    body: BaseModel | Json | None
    """JSON body"""
    content: bytes
    """raw body, sent unchanged"""


class Transport:
    """A connection to one server; close it, or use it in ``with``.

    Args:
        address: Address of the server, with the path of a reverse proxy.
        token: The server's token; None on loopback.
        timeout_s: Time limit of an answer [s]; at least ``FILE_S`` where a file is sent.
    """

    def __init__(
        self,
        address: str = "http://127.0.0.1:8000",
        *,
        token: str | None = None,
        timeout_s: float = TIMEOUT_S,
    ) -> None:
        headers = {} if token is None else {"Authorization": f"Bearer {token}"}
        self._timeout_s = timeout_s
        self._http = httpx.Client(base_url=address, headers=headers, timeout=timeout_s)

    def close(self) -> None:
        """Close the connection."""
        self._http.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _send(self, route: str, *names: str, **parts: Unpack[RequestParts]) -> httpx.Response:
        """Return an answer.

        Args:
            route: Method and path, with ``{}`` for each name.
            names: Ids and names in the path, not encoded.

        Raises:
            Refused: The server answered with a problem document.
        """
        method, _, path = route.partition(" ")
        headers, content = _texts(parts.get("headers")), parts.get("content")
        body = parts.get("body")
        if body is not None:
            given = _json_of(body) if isinstance(body, BaseModel) else body
            content = json.dumps(given).encode()  # NaN too: a missing key-point
            headers["Content-Type"] = "application/json"
        is_file = parts.get("content") is not None
        answer = self._http.request(
            method,
            _filled(path, names),
            params=_given(parts.get("query")),
            headers=headers,
            content=content,
            timeout=max(self._timeout_s, FILE_S) if is_file else self._timeout_s,
        )
        _raise_problem(answer)
        return answer

    def _parsed(
        self, model: type[M], route: str, *names: str, **parts: Unpack[RequestParts]
    ) -> M:
        """Return an answer as its schema; arguments as of :meth:`_send`."""
        return model.model_validate_json(self._send(route, *names, **parts).content)

    def _events(
        self, path: str, *names: str, headers: Json | None = None
    ) -> Iterator[StreamEvent]:
        """Yield the events of a stream until it ends; names as of :meth:`_send`.

        Raises:
            Refused: The server answered with a problem document.
        """
        pauses = httpx.Timeout(self._timeout_s, read=max(self._timeout_s, SILENCE_S))
        with self._http.stream(
            "GET", _filled(path, names), headers=_texts(headers), timeout=pauses
        ) as answer:
            if not answer.is_success:
                answer.read()
                _raise_problem(answer)
            fields: dict[str, str] = {}
            for line in answer.iter_lines():
                name, _, value = line.partition(": ")
                if name:
                    fields[name] = fields[name] + "\n" + value if name in fields else value
                    continue
                if "data" in fields:
                    yield StreamEvent(
                        event=fields.get("event", "message"),
                        id=fields.get("id", ""),
                        data=json.loads(fields["data"]),
                    )
                fields = {}


def _filled(path: str, names: Sequence[str]) -> str:
    """Return a path with names; an encoded dot is part of a name, ``..`` another path."""
    return path.format(*(quote(name, safe="").replace(".", "%2E") for name in names))


def _raise_problem(answer: httpx.Response) -> None:
    if answer.is_success:
        return
    try:
        problem = Problem.model_validate_json(answer.content)
    except ValueError:  # a redirection, or of a proxy in between
        answer.raise_for_status()
        raise
    raise Refused(problem, retry_after_s(answer.headers.get("retry-after")))


def retry_after_s(header: str | None) -> float | None:
    """Return the time that ``Retry-After`` states as seconds or as a date [s]."""
    if header is None:
        return None
    if header.strip().isdecimal():
        return float(header)
    try:
        wait = parsedate_to_datetime(header) - datetime.now(UTC)
    except (TypeError, ValueError):  # neither, or a date without a zone
        return None
    return max(0.0, wait.total_seconds())


def _given(values: Json | None) -> dict[str, Any]:
    """Return the parameters that are not left to their default."""
    return {name: value for name, value in (values or {}).items() if value is not None}


def _texts(values: Json | None) -> dict[str, str]:
    return {name: str(value) for name, value in _given(values).items()}


def _json_of(body: BaseModel) -> dict[str, Any]:
    """Return the fields that were set, and the tag of one of several kinds."""
    tags = {
        name: field.default
        for name, field in type(body).model_fields.items()
        if get_origin(field.annotation) is Literal and len(get_args(field.annotation)) == 1
    }
    return {**tags, **body.model_dump(mode="json", exclude_unset=True)}
