"""Answers and bodies of the job routes."""

from datetime import datetime
from typing import Annotated, Any, Literal, Self

from pydantic import Field

from app.api.schemas.numbers import Answer, Body, Finite
from app.store.completion import MAX_KILLS
from app.store.cursors import MAX_INTEGER
from app.store.records import JobRecord, MetricRow, SpentBudget


class JobPublic(Answer):
    """A job."""

    id: str = Field(description="name in addresses")
    number: int = Field(description="running number")
    kind: str = Field(description="train, evaluate, sweep or report")
    preset: str | None = Field(
        description="preset of a training or sweep; null for other kinds"
    )
    seed: int = Field(description="seed of training, episodes or ranges")
    overrides: dict[str, Any] = Field(
        description="fields that differ from the preset, by group"
    )
    spec: dict[str, Any] = Field(description="the posted body, without labels")
    name: str | None = Field(description="a name for people")
    notes: str | None = Field(description="text for people")
    priority: int = Field(description="queued jobs of a higher priority start first")
    checkpoint: str | None = Field(
        description="SHA-256 of the checkpoint that it evaluates: the one that its alias named "
        "when it was posted; null for other kinds"
    )
    parent: str | None = Field(
        description="id of the job that this one repeats or changes; it may be deleted"
    )
    state: str = Field(
        description="queued, running, cancelling, succeeded, failed or cancelled"
    )
    attempt: int = Field(description="number of starts")
    failures: int = Field(description="number of crashed attempts")
    created_at: datetime
    started_at: datetime | None = Field(description="first start; null before it")
    finished_at: datetime | None = Field(description="null until it has ended")
    error: str | None = Field(description="why it failed, else null")
    step: int = Field(description="environment steps done")
    total_steps: int | None = Field(
        description="steps at its end; of a sweep or report, its trials or evaluations"
    )
    step_budget: int | None = Field(description="steps after which it ends and can be resumed")
    time_budget_s: float | None = Field(
        description="run time after which it ends and can be resumed [s]"
    )
    run_s: float = Field(description="run time of all its attempts [s]")
    ended_by: str | None = Field(
        description="why it is not complete: `step budget`, `time budget`, `pruned` or "
        "`failed parts`; else null"
    )
    part_of: str | None = Field(description="id of the sweep or report that it is part of")
    trial: int | None = Field(
        description="number of its trial in the sweep, or of its evaluation in the report"
    )
    progress: float | None = Field(
        description="done share of its steps, or of the budget that is nearer to its end"
    )
    time_left_s: float | None = Field(
        description="estimated run time until its end or the first spent budget [s]; null if "
        "it does not run or nothing is known"
    )
    cancel_requested: bool = Field(description="whether it has been cancelled, or is to be")
    idempotency_key: str | None = Field(description="`Idempotency-Key` of its request")
    result: dict[str, Any] | None = Field(description="its result once it has succeeded")
    last_event: int = Field(description="id of its newest event")
    kills: int = Field(
        description=f"number of attempts killed with the server; the job fails at {MAX_KILLS}"
    )
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
        return cls.from_object(
            job,
            latest=dict(latest.values) if latest else None,
            resume_step=resume_step,
            progress=_progress(job),
            time_left_s=_time_left(job, latest),
        )


def _last_step(job: JobRecord) -> int | None:
    """Return the step at which a job ends: its last one, or that of its budget."""
    known = [one for one in (job.total_steps, job.step_budget) if one is not None]
    return min(known, default=None)


def _progress(job: JobRecord) -> float | None:
    """Return the done share of a job, None where its steps are unknown and it has no budget."""
    last, shares = _last_step(job), []
    if last:
        shares.append(job.step / last)
    if job.time_budget_s is not None:
        shares.append(job.run_s / job.time_budget_s)
    return min(1.0, max(shares)) if shares else None


def _time_left(job: JobRecord, latest: MetricRow | None) -> float | None:
    """Return the time to the end of a running job, or to its first spent budget [s]."""
    if job.state != "running":
        return None
    found, last = [], _last_step(job)
    left = latest.values.get("time_left_s") if latest else None
    if left is not None and last is not None and job.total_steps is not None:
        share = (last - job.step) / max(1, job.total_steps - job.step)
        found.append(left * max(0.0, share))
    if job.time_budget_s is not None:
        found.append(max(0.0, job.time_budget_s - job.run_s))
    return min(found, default=None)


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


Step = Annotated[int, Field(ge=0, le=MAX_INTEGER, description="environment steps done")]


RunTime = Annotated[Finite, Field(ge=0, description="run time of all attempts [s]")]


class AttemptHeartbeat(Body):
    """A heartbeat of a worker."""

    waiting: Annotated[str, Field(pattern=r"^[^\x00-\x1f]+$", max_length=64)] | None = Field(
        description="reason for which the worker cannot write; null if it runs"
    )
    run_s: RunTime


class AttemptProgress(Body):
    """A point of a learning curve."""

    step: Step
    values: dict[str, int | Finite | None] = Field(
        description="named numbers; null where not defined", max_length=200
    )
    total_steps: Step | None = Field(description="steps to do; null where not known")


class AttemptStart(Body):
    """The state from which an attempt starts."""

    step: Step | None = Field(description="step of the state; null: it starts without one")


class AttemptEnd(Body):
    """The end of an attempt."""

    state: Literal["succeeded", "cancelled", "failed", "interrupted"] = Field(
        description="an interrupted attempt leaves its job to the next one"
    )
    result: dict[str, Any] | None = Field(None, description="result of the job")
    error: str | None = Field(None, description="cause of a failure", max_length=100_000)
    ended_by: SpentBudget | None = Field(None, description="the budget that ended it")
    run_s: RunTime | None = None
