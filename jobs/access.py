"""Access of a worker to its job: read it, report, end it. Writes are fenced by the attempt.

``StoreAccess`` uses the database; ``jobs.remote.access`` uses the routes of the service.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Protocol

from app.store import attempts, completion, fencing
from app.store.database.schema import check_schema
from app.store.engine import Store
from app.store.records import Claim, JobRecord, NewCheckpoint, ResumeState, SpentBudget
from jobs import resume_files


@dataclass(frozen=True, slots=True)
class EndOfAttempt:
    """How an attempt ends."""

    state: Literal["succeeded", "cancelled", "failed", "interrupted"]
    """Its end; an interrupted attempt leaves its job to the next one."""
    result: Mapping[str, Any] | None = None
    """Result of the job."""
    error: str | None = None
    """Cause of a failure."""
    ended_by: SpentBudget | None = None
    """The budget that ended it."""
    run_s: float | None = None
    """Run time of all attempts; None leaves it [s]."""


class JobAccess(Protocol):
    """Reads and writes of one attempt about its job.

    Methods raise StaleAttempt where the attempt no longer holds the job, StorageFull where no
    room is left, and StorageUnavailable where the database or the server does not answer.
    """

    def job(self) -> JobRecord:
        """Return the job."""

    def heartbeat(self, waiting: str | None, run_s: float) -> JobRecord:
        """Record a heartbeat and return the job.

        Args:
            waiting: Reason for which the worker cannot write.
            run_s: Run time of all attempts [s].
        """

    def load_resume(self, usable: Callable[[ResumeState], bool]) -> ResumeState | None:
        """Return the newest undamaged and usable state to resume from; None: there is none."""

    def resume_earlier(self, step: int | None) -> None:
        """Start from an earlier state than the job's row states; None: from the beginning."""

    def record_progress(
        self, step: int, values: Mapping[str, float | None], total_steps: int | None
    ) -> None:
        """Add a point to the job's curve; the last one again has no effect."""

    def record_checkpoint(
        self, step: int, policy: NewCheckpoint, resume: ResumeState | None
    ) -> None:
        """Store a policy and the state to resume from, both or neither."""

    def end(self, end: EndOfAttempt) -> None:
        """End the attempt."""


class StoreAccess:
    """Access by the database.

    Args:
        data_dir: The data folder, with the files of the job's replay memory.
    """

    def __init__(self, store: Store, data_dir: Path, claim: Claim) -> None:
        self.store, self._claim = store, claim
        self._files = resume_files.folder_of(data_dir, claim.job_id)

    def job(self) -> JobRecord:
        """Return the job."""
        return fencing.peek(self.store, self._claim)

    def heartbeat(self, waiting: str | None, run_s: float) -> JobRecord:
        """Record a heartbeat and return the job."""
        return attempts.heartbeat(self.store, self._claim, waiting, run_s=run_s)

    def load_resume(self, usable: Callable[[ResumeState], bool]) -> ResumeState | None:
        """Return the newest undamaged and usable state."""
        return attempts.load_resume(self.store, self._claim.job_id, usable)

    def resume_earlier(self, step: int | None) -> None:
        """Start from an earlier state."""
        attempts.resume_earlier(self.store, self._claim, step)

    def record_progress(
        self, step: int, values: Mapping[str, float | None], total_steps: int | None
    ) -> None:
        """Add a point to the job's curve."""
        attempts.record_progress(self.store, self._claim, step, values, total_steps=total_steps)

    def record_checkpoint(
        self, step: int, policy: NewCheckpoint, resume: ResumeState | None
    ) -> None:
        """Store a policy and the state to resume from."""
        attempts.record_checkpoint(self.store, self._claim, step, policy, resume)

    def end(self, end: EndOfAttempt) -> None:
        """End the attempt; the files of a job that has succeeded are deleted."""
        if end.state == "failed":
            completion.fail(self.store, self._claim, end.error or "")
        elif end.state == "interrupted":
            completion.give_back(self.store, self._claim)
        else:
            completion.finish(
                self.store,
                self._claim,
                state=end.state,
                result=end.result,
                ended_by=end.ended_by,
                run_s=end.run_s,
            )
        if end.state == "succeeded" and end.ended_by is None:
            resume_files.remove(self._files)


def open_access(database_url: str, data_dir: Path, claim: Claim) -> StoreAccess:
    """Open the database for an attempt.

    Raises:
        InvalidInput: The URL names no database that works here.
        Conflict: The database is of another version.
    """
    store = Store(database_url)
    check_schema(store)
    return StoreAccess(store, data_dir, claim)
