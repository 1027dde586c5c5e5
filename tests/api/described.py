"""Comparison of an answer with the OpenAPI document."""

import re
from functools import cache
from pathlib import Path
from typing import Any, Protocol

from app.main import create_app
from app.settings import Settings


class Answered(Protocol):
    """An answer of ``httpx`` or of ``httpx2``."""

    @property
    def status_code(self) -> int: ...
    @property
    def headers(self) -> Any: ...
    @property
    def request(self) -> Any: ...


@cache
def api_document() -> dict[str, Any]:
    """Return the document, which is the same for every service; making it takes long."""
    return create_app(Settings(data=Path("nowhere"))).openapi()


def operation_of(document: dict[str, Any], method: str, path: str) -> dict[str, Any] | None:
    """Return the operation that answers a request; None where none is described."""
    method = "get" if method == "HEAD" else method.lower()
    fitting = [
        (template.count("{"), operations[method])
        for template, operations in document["paths"].items()
        if method in operations and _pattern(template).fullmatch(path)
    ]
    return min(fitting, key=lambda one: one[0])[1] if fitting else None


@cache
def _pattern(template: str) -> re.Pattern[str]:
    return re.compile(re.sub(r"\\\{\w+\\\}", "[^/]+", re.escape(template)))


def undescribed(document: dict[str, Any], answer: Answered) -> str | None:
    """Return what the document does not say of an answer; None where it says all."""
    method, path = answer.request.method, answer.request.url.path
    operation = operation_of(document, method, path)
    if operation is None:
        return None
    said = operation["responses"].get(str(answer.status_code))
    if said is None:
        return f"{method} {path} answers {answer.status_code}, which is not described"
    if "$ref" in said:
        said = document["components"]["responses"][said["$ref"].rpartition("/")[2]]
    kind = answer.headers.get("content-type", "").partition(";")[0]
    kinds = list(said.get("content", {}))
    if (kind or kinds) and kind not in kinds:
        return f"{method} {path} answers {answer.status_code} as {kind!r}, not as {kinds}"
    return None
