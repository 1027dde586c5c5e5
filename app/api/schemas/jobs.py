"""Jobs as they are shown."""

from datetime import datetime
from typing import Any, Self

from pydantic import Field

from app.api.schemas.numbers import Answer
from app.store.records import JobRecord, MetricRow


class JobPublic(Answer):
    """A job."""

    id: str
    number: int = Field(description="running number")
    kind: str
    preset: str | None
    seed: int
    overrides: dict[str, Any]
    spec: dict[str, Any] = Field(description="the posted body, without labels")
    name: str | None = Field(description="a name for people")
    notes: str | None = Field(description="text for people")
    priority: int = Field(description="queued jobs of a higher priority start first")
    parent: str | None = Field(
        description="id of the job that this one repeats or changes; it may be deleted"
    )
    state: str = Field(
        description="queued, running, cancelling, succeeded, failed or cancelled"
    )
    attempt: int = Field(description="number of starts")
    failures: int = Field(description="number of crashed attempts")
    created_at: datetime
    started_at: datetime | None
    finished_at: datetime | None
    error: str | None
    step: int = Field(description="environment steps done")
    total_steps: int | None
    cancel_requested: bool
    idempotency_key: str | None
    result: dict[str, Any] | None
    last_event: int = Field(description="id of its newest event")
    kills: int = Field(description="number of attempts killed with the server; it fails at 30")
    waiting: str | None = Field(
        description="reason for which its worker waits, such as `disk full`; null if it runs"
    )
    resume_step: int | None = Field(
        description="step of its newest state to resume from; null: none is kept"
    )
    latest: dict[str, float | None] | None = Field(description="newest point of its curve")

    @classmethod
    def from_domain(
        cls, job: JobRecord, latest: MetricRow | None = None, resume_step: int | None = None
    ) -> Self:
        """Return the schema of a record."""
        names = cls.model_fields.keys() - {"latest", "resume_step"}
        members = {name: getattr(job, name) for name in names}
        values = dict(latest.values) if latest else None
        return cls(**members, latest=values, resume_step=resume_step)


class JobList(Answer):
    """One page of jobs, newest first."""

    items: list[JobPublic]
    next_cursor: str | None = Field(description="`cursor` of the next page")
    waiting: str | None = Field(
        description="reason for which no job runs, such as `disk full`; null if the queue runs"
    )


class MetricsPublic(Answer):
    """Points of a job's learning curve, by step."""

    items: list[dict[str, Any]] = Field(description="step, at and the named numbers")

    @classmethod
    def from_domain(cls, rows: tuple[MetricRow, ...]) -> Self:
        """Return the schema of the store's rows."""
        return cls(items=[{"step": row.step, **row.values, "at": row.at} for row in rows])
