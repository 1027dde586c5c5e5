"""Evaluations as they are shown."""

from datetime import datetime
from typing import Any, Self

from pydantic import Field

from app.api.schemas.numbers import Answer
from app.store.records import JobRecord, Page

_OWN = ("protocol", "checkpoint", "seed", "episodes", "results", "cpu_seconds")


class EvaluationPublic(Answer):
    """The result of an evaluation."""

    id: str = Field(description="id of its job")
    number: int = Field(description="running number of its job")
    name: str | None = Field(description="name of its job")
    protocol: str
    checkpoint: str | None = Field(description="SHA-256; null for a protocol without policy")
    seed: int = Field(description="seed of the episodes")
    episodes: int = Field(description="episodes of the first row")
    results: list[dict[str, Any]] = Field(
        description="rows: name, n, rates with mean and 95 % interval (`low`, `high`), and "
        "quantities with their unit as suffix"
    )
    conditions: dict[str, Any] = Field(description="assumptions, commit and machine")
    cpu_seconds: float = Field(description="CPU time [s]")
    finished_at: datetime | None

    @classmethod
    def from_domain(cls, job: JobRecord) -> Self:
        """Return the schema of a succeeded evaluation."""
        result = dict(job.result or {})
        own = {name: result.pop(name, None) for name in _OWN}
        about = {name: getattr(job, name) for name in ("id", "number", "name", "finished_at")}
        return cls(**about, **own, conditions=result)


class EvaluationList(Answer):
    """One page of evaluations, newest first."""

    items: list[EvaluationPublic]
    next_cursor: str | None = Field(description="`cursor` of the next page")

    @classmethod
    def from_domain(cls, page: Page[JobRecord]) -> Self:
        """Return the schema of a page."""
        items = [EvaluationPublic.from_domain(job) for job in page.items]
        return cls(items=items, next_cursor=page.next_cursor)
