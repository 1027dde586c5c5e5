"""Jobs: what is posted, what is shown."""

from datetime import datetime
from typing import Annotated, Any, Literal, Self

from pydantic import Field

from app.api.schemas.numbers import Answer, Body
from app.errors import InvalidInput
from app.policies.configs.presets import PRESETS
from app.policies.evaluation.registry import default_checkpoint
from app.store.records import JobRecord, MetricRow, NewJob
from jobs.spec import MAX_RECORDINGS, new_job

Seed = Annotated[int, Field(strict=True, ge=0, le=2**32 - 1)]


class TrainJobCreate(Body):
    """Train a policy: a preset, a seed, and what differs from the preset."""

    kind: Literal["train"]
    preset: str = Field(max_length=64, description="name of GET /v1/presets")
    seed: Seed = Field(0, description="seed of every random stream")
    overrides: dict[str, Any] = Field(
        default_factory=dict, description="fields that differ from the preset, by group"
    )

    def to_domain(self) -> NewJob:
        """Check what a schema cannot and return the job.

        Raises:
            InvalidInput: An unknown preset, an unknown override, one outside its bounds.
        """
        if self.preset not in PRESETS:
            raise InvalidInput("preset", self.preset, "is no preset", tuple(PRESETS))
        return new_job(self.model_dump(mode="json", exclude_unset=True))


class EvaluateJobCreate(Body):
    """Evaluate a checkpoint by a protocol."""

    kind: Literal["evaluate"]
    protocol: str = Field(max_length=64, description="name of the protocol")
    checkpoint: str | None = Field(
        None, max_length=64, description="SHA-256 or alias; the protocol's own if null"
    )
    episodes: int | None = Field(
        None,
        strict=True,
        ge=1,
        le=1_000_000,
        description="episodes; the protocol's own if null",
    )
    seed: Seed = Field(0, description="seed of the episodes")
    motions: list[Annotated[str, Field(max_length=64)]] = Field(
        default_factory=list,
        max_length=MAX_RECORDINGS,
        description="names of GET /v1/motions, for pick-mocap",
    )

    def to_domain(self) -> NewJob:
        """Check what a schema cannot and return the job.

        Raises:
            InvalidInput: An unknown protocol, or motions that do not go with it.
        """
        given = self.model_dump(mode="json", exclude_unset=True)
        checkpoint = self.checkpoint or default_checkpoint(self.protocol)
        return new_job({**given, "checkpoint": checkpoint})


JobCreate = Annotated[TrainJobCreate | EvaluateJobCreate, Field(discriminator="kind")]


class JobPublic(Answer):
    """One job as it stands."""

    id: str
    number: int = Field(description="running number")
    kind: str
    preset: str | None
    seed: int
    overrides: dict[str, Any]
    spec: dict[str, Any] = Field(description="the body as it was posted")
    state: str = Field(
        description="queued, running, cancelling, succeeded, failed or cancelled"
    )
    attempt: int = Field(description="how often it was started")
    failures: int = Field(description="how many attempts crashed")
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
    latest: dict[str, float | None] | None = Field(description="newest point of its curve")

    @classmethod
    def from_domain(cls, job: JobRecord, latest: MetricRow | None = None) -> Self:
        """Make it from the store's record."""
        names = (name for name in cls.model_fields if name != "latest")
        members = {name: getattr(job, name) for name in names}
        return cls(**members, latest=dict(latest.values) if latest else None)


class JobList(Answer):
    """One page of jobs, newest first."""

    items: list[JobPublic]
    next_cursor: str | None = Field(description="pass it as `cursor` for the next page")


class MetricsPublic(Answer):
    """Points of a job's curve, in order of steps."""

    items: list[dict[str, Any]] = Field(description="step, at and the named numbers")

    @classmethod
    def from_domain(cls, rows: tuple[MetricRow, ...]) -> Self:
        """Make it from the store's rows."""
        return cls(items=[{"step": row.step, **row.values, "at": row.at} for row in rows])
