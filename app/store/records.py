"""What the store hands out and takes in: frozen data, no database rows.

Times are aware ``datetime`` in UTC. JSON values are plain dicts, lists and numbers.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Generic, Literal, TypeVar

Item = TypeVar("Item")

JobState = Literal["queued", "running", "cancelling", "succeeded", "failed", "cancelled"]
"""``cancelling`` is a running job whose cancel was requested."""

FINAL_STATES: tuple[JobState, ...] = ("succeeded", "failed", "cancelled")
"""States that a job never leaves."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Page(Generic[Item]):
    """One page of a list, newest first."""

    items: tuple[Item, ...]
    """The items of this page."""
    next_cursor: str | None
    """Pass it back for the next page; None on the last one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NewJob:
    """What is needed to queue a job; made by ``jobs.spec`` from a checked body."""

    kind: str
    """``"train"`` or ``"evaluate"``."""
    spec: Mapping[str, Any]
    """The body as it was posted, kept unchanged."""
    preset: str | None = None
    """Name of the preset, for jobs that have one."""
    seed: int = 0
    """Seed of every random stream of the job."""
    overrides: Mapping[str, Any] | None = None
    """Changes to the preset's fields."""
    total_steps: int | None = None
    """Steps the job will take, where known beforehand."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JobRecord:
    """One job as the database knows it."""

    id: str
    """UUID as text."""
    number: int
    """Running number, in the order of submission."""
    kind: str
    """``"train"`` or ``"evaluate"``."""
    preset: str | None
    """Name of the preset."""
    seed: int
    """Seed of every random stream of the job."""
    overrides: Mapping[str, Any]
    """Changes to the preset's fields."""
    spec: Mapping[str, Any]
    """The body as it was posted."""
    state: JobState
    """Where the job stands."""
    attempt: int
    """How often it was started; 0 while it was never claimed."""
    failures: int
    """How many of its attempts crashed (deaths of the server do not count)."""
    created_at: datetime
    """When it was submitted."""
    started_at: datetime | None
    """When it was first claimed."""
    finished_at: datetime | None
    """When it reached a final state."""
    heartbeat_at: datetime | None
    """Last sign of life of its worker."""
    error: str | None
    """Why it failed, for people."""
    step: int
    """Steps done."""
    total_steps: int | None
    """Steps to do, where known."""
    cancel_requested: bool
    """Whether somebody asked to cancel it."""
    idempotency_key: str | None
    """Key under which it was submitted."""
    result: Mapping[str, Any] | None
    """What it found, once succeeded: an evaluation's JSON, a training's summary."""
    last_event: int
    """Id of its newest event."""

    @property
    def is_final(self) -> bool:
        """Whether the job will never change again."""
        return self.state in FINAL_STATES


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """The right to write about one job: the fence of every write by a worker.

    A write counts only while the job is running and has this attempt number.
    """

    job_id: str
    """The job."""
    attempt: int
    """The attempt that holds it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricRow:
    """One point of a job's curve."""

    step: int
    """Environment steps done; strictly increasing within a job."""
    values: Mapping[str, float | None]
    """Named numbers of that moment, such as ``success``; None where not defined yet."""
    at: datetime
    """When it was recorded."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JobEvent:
    """One thing that happened to a job, for event streams."""

    id: int
    """Strictly increasing within the job, in the order of commits."""
    kind: Literal["state", "progress", "checkpoint"]
    """What happened.

    ``state``: ``data`` has state, attempt, error, resumed_from_step (drop every point of the
    curve beyond it; None: not a start). ``progress``: step and the curve's values.
    ``checkpoint``: step and sha256.
    """
    data: Mapping[str, Any]
    """The details."""
    at: datetime
    """When."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NewCheckpoint:
    """A checkpoint to be stored; the store never opens it."""

    sha256: str
    """Its identity, computed by whoever made it."""
    manifest: Mapping[str, Any]
    """Its JSON manifest."""
    tensors: bytes
    """Its safetensors bytes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckpointRecord:
    """A stored checkpoint, without its tensors."""

    sha256: str
    """Its identity."""
    number: int
    """Running number, in the order of storing."""
    job_id: str | None
    """The job that made it; None for one that was imported."""
    step: int | None
    """The step of that job."""
    manifest: Mapping[str, Any]
    """Its JSON manifest."""
    size: int
    """Length of the tensors [bytes]."""
    created_at: datetime
    """When it was stored."""
    aliases: tuple[str, ...]
    """Names that point to it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CellRecord:
    """A work cell of the user's own."""

    name: str
    """Its name, unique."""
    definition: Mapping[str, Any]
    """Its content, JSON data."""
    created_at: datetime
    """When it was stored."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NewRecording:
    """An imported recording to be stored; the store never opens it."""

    name: str
    """Its name, unique."""
    sha256: str
    """Of the file that it was imported from."""
    file_name: str
    """Name of that file."""
    n_runs: int
    """Clean runs."""
    n_frames: int
    """Frames of the file."""
    duration: float
    """Of the file [s]."""
    summary: Mapping[str, Any]
    """What a list shows of it: measures and errors."""
    detail: Mapping[str, Any]
    """What is said of each run and each artifact."""
    tensors: bytes
    """The runs, as safetensors bytes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredRecording:
    """A stored recording, without its runs."""

    number: int
    """Running number, in the order of storing; never given twice."""
    name: str
    """Its name, unique."""
    sha256: str
    """Of the file that it was imported from."""
    file_name: str
    """Name of that file."""
    n_runs: int
    """Clean runs."""
    n_frames: int
    """Frames of the file."""
    duration: float
    """Of the file [s]."""
    summary: Mapping[str, Any]
    """What a list shows of it: measures and errors."""
    detail: Mapping[str, Any] | None = None
    """What is said of each run and each artifact; None in lists."""
    size: int
    """Length of the runs [bytes]."""
    created_at: datetime
    """When it was stored."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ResumeState:
    """Everything a new attempt needs to go on from ``step``."""

    step: int
    """Steps done when it was taken."""
    manifest: Mapping[str, Any]
    """Its JSON manifest."""
    tensors: bytes
    """Its safetensors bytes."""
