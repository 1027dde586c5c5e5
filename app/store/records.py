"""Data types of the store: frozen dataclasses, no database rows.

Times are aware ``datetime`` in UTC. JSON values are dicts, lists and numbers.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Generic, Literal, TypeVar

Item = TypeVar("Item")

JobState = Literal["queued", "running", "cancelling", "succeeded", "failed", "cancelled"]
"""``cancelling`` is a running job whose cancel was requested."""

JobKind = Literal["train", "evaluate", "sweep", "report"]
"""Kinds of jobs, as :mod:`jobs.spec` defines them."""

FINAL_STATES: tuple[JobState, ...] = ("succeeded", "failed", "cancelled")

SpentBudget = Literal["step budget", "time budget"]
"""A budget that ended a training before its last step."""

EarlyEnd = SpentBudget | Literal["pruned", "failed parts"]
"""Why a job ended incomplete: a budget, the pruner of its sweep, or evaluations of a report."""

COMPOSITE_KINDS = ("sweep", "report")
"""Kinds of jobs that have no worker: the supervisor starts their parts, jobs likewise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Page(Generic[Item]):
    """One page of a list, newest first."""

    items: tuple[Item, ...]
    """The items of this page."""
    next_cursor: str | None
    """Cursor of the next page; None on the last one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NewJob:
    """A job to queue; made by ``jobs.spec`` from a checked body."""

    kind: str
    """``"train"`` or ``"evaluate"``."""
    spec: Mapping[str, Any]
    """The posted body, without name, notes and priority."""
    preset: str | None = None
    """Name of the preset, for jobs that have one."""
    seed: int = 0
    """Seed of every random stream."""
    overrides: Mapping[str, Any] | None = None
    """Changes to the preset's fields."""
    total_steps: int | None = None
    """Steps of the job, where known beforehand."""
    name: str | None = None
    """A name for people."""
    notes: str | None = None
    """Text for people."""
    priority: int = 0
    """Queued jobs of a higher priority start first."""
    parent: str | None = None
    """Id of the job that this one repeats or changes; it may be deleted."""
    step_budget: int | None = None
    """Steps after which the job ends and keeps its state."""
    time_budget_s: float | None = None
    """Run time after which the job ends and keeps its state [s]."""
    part_of: str | None = None
    """Id of the sweep or report that it is part of; None after its deletion, too."""
    trial: int | None = None
    """Number of its trial in the sweep, or of its evaluation in the report, from 1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class References:
    """What a job reads from the database when it runs."""

    checkpoint: str | None = None
    """SHA-256 or alias of the checkpoint to evaluate."""
    cell: str | None = None
    """Name of the cell to train in."""
    recordings: tuple[str, ...] = ()
    """Names of the recordings to evaluate with."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """The right of one attempt to write about its job, while the job runs that attempt."""

    job_id: str
    """The job."""
    attempt: int
    """Number of the attempt."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JobRecord(NewJob):
    """A job: what was submitted, and its state."""

    overrides: Mapping[str, Any]
    """Changes to the preset's fields."""
    id: str
    """UUID as text."""
    number: int
    """Running number, in the order of submission."""
    checkpoint: str | None
    """SHA-256 of the checkpoint to evaluate: the one that its alias named at the submission."""
    state: JobState
    """Its state."""
    attempt: int
    """Number of starts; 0 before the first claim."""
    failures: int
    """Number of crashed attempts (deaths of the server do not count)."""
    created_at: datetime
    """Time of submission."""
    started_at: datetime | None
    """Time of the first claim."""
    finished_at: datetime | None
    """Time of the final state."""
    end_number: int | None
    """Running number, in the order of the last ends of jobs."""
    heartbeat_at: datetime | None
    """Last heartbeat of its worker."""
    error: str | None
    """Cause of the failure, as text."""
    step: int
    """Steps done."""
    cancel_requested: bool
    """Whether a cancel was requested."""
    idempotency_key: str | None
    """Key of its submission."""
    submission_digest: str | None
    """SHA-256 of what was submitted with its key; None without one or before migration 0015."""
    result: Mapping[str, Any] | None
    """Result once succeeded: an evaluation's JSON, a training's summary."""
    last_event: int
    """Id of its newest event."""
    kills: int
    """Number of attempts that were killed with their server."""
    waiting: str | None
    """Reason for which its worker cannot write, such as ``"disk full"``."""
    run_s: float
    """Run time of all its attempts, at the last heartbeat [s]."""
    ended_by: EarlyEnd | None
    """The budget that ended it, or that the pruner of its sweep did; it can be resumed."""

    @property
    def is_final(self) -> bool:
        """Whether the state is final."""
        return self.state in FINAL_STATES

    @property
    def claim(self) -> Claim:
        """The claim of its newest attempt."""
        return Claim(job_id=self.id, attempt=self.attempt)


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricRow:
    """A point of a job's curve."""

    step: int
    """Environment steps done; strictly increasing within a job."""
    values: Mapping[str, float | None]
    """Named numbers, such as ``success``; None where not defined."""
    at: datetime
    """Time of recording."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JobEvent:
    """An event of a job, for event streams."""

    id: int
    """Strictly increasing within the job, in the order of commits."""
    kind: Literal["state", "progress", "checkpoint"]
    """Kind of event.

    ``state``: ``data`` has state, attempt, error, resumed_from_step (drop every point of the
    curve beyond it; None: not a start). ``progress``: step and the curve's values.
    ``checkpoint``: step and sha256.
    """
    data: Mapping[str, Any]
    """The details."""
    at: datetime
    """Time of the event."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NewCheckpoint:
    """A checkpoint to store."""

    sha256: str
    """Digest of manifest and tensors."""
    manifest: Mapping[str, Any]
    """Its JSON manifest."""
    tensors: bytes
    """Its safetensors bytes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckpointRecord:
    """A stored checkpoint, without its tensors."""

    sha256: str
    """Digest of manifest and tensors."""
    number: int
    """Running number, in the order of storing."""
    job_id: str | None
    """The job that made it; None for an imported one."""
    step: int | None
    """The step of that job."""
    manifest: Mapping[str, Any]
    """Its JSON manifest."""
    size: int
    """Length of the tensors [bytes]."""
    created_at: datetime
    """Time of storing."""
    aliases: tuple[str, ...]
    """Its aliases."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CellRecord:
    """A work cell of the user's own."""

    name: str
    """Its name, unique."""
    definition: Mapping[str, Any]
    """Its content, JSON data."""
    created_at: datetime
    """Time of storing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingSummary:
    """What lists show of a recording."""

    name: str
    """Its name, unique."""
    sha256: str
    """Digest of its file."""
    file_name: str
    """Name of its file."""
    n_runs: int
    """Number of clean runs."""
    n_frames: int
    """Number of frames of the file."""
    duration: float
    """Duration of the file [s]."""
    summary: Mapping[str, Any]
    """Measures and errors."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NewRecording(RecordingSummary):
    """A recording to store."""

    detail: Mapping[str, Any]
    """Each run and each artifact."""
    tensors: bytes
    """The runs, as safetensors bytes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredRecording(RecordingSummary):
    """A stored recording, without its runs."""

    number: int
    """Running number, in the order of storing; never used twice."""
    detail: Mapping[str, Any] | None = None
    """Each run and each artifact; None in lists."""
    size: int
    """Length of the runs [bytes]."""
    created_at: datetime
    """Time of storing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ResumeState:
    """State of a training from which a new attempt resumes."""

    step: int
    """Steps done."""
    manifest: Mapping[str, Any]
    """Its JSON manifest."""
    tensors: bytes
    """Its safetensors bytes."""
