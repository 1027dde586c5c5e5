"""Removal of checkpoints, and of ended jobs with their files: how many are kept."""

import logging
import threading
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from app.errors import Conflict
from app.policies.checkpoints import pretrained
from app.store import retention
from app.store.checkpoints import get_checkpoint
from app.store.database.size import shrink
from app.store.engine import Store
from app.store.jobs import job_ids
from jobs import resume_files

logger = logging.getLogger(__name__)

UNKNOWN = ".unknown-job"
"""Ending of an empty file beside the log of an unknown job, with the time of the first look."""
MAX_JOBS_AT_ONCE = 20
"""Jobs that are deleted at once; the supervisor renews its lease in between."""

Loaded = TypeVar("Loaded")
Used = TypeVar("Used")


@dataclass(slots=True, kw_only=True)
class Retention:
    """Removes checkpoints, and ended jobs with their output and their files to resume from."""

    store: Store
    """The database, for requests."""
    logs: Path
    """Folder with the output of each job."""
    keep_jobs: int
    """Number of ended jobs to keep."""
    keep_states: int
    """Number of ended jobs whose states to resume from are kept; pruned trials come last."""
    acting: Callable[[], Mapping[str, str]]
    """Returns the SHA-256 of each checkpoint that acts, with its place."""
    on_removed: Callable[[Collection[str]], object] = lambda _: None
    """Called with the SHA-256 of the checkpoints that were removed."""
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _removals: int = 0

    def deploy(
        self,
        load: Callable[[], Loaded],
        use: Callable[[Loaded], Used],
        discard: Callable[[Loaded], object] = lambda _: None,
    ) -> Used:
        """Load policies and let them act, with no removal of a checkpoint in between.

        Args:
            load: Loads them; called again where a checkpoint was removed meanwhile.
            use: Makes them known to ``acting``; short, since removals wait.
            discard: Called with what was loaded before a removal.
        """
        while True:
            removals, loaded = self._removals, load()
            with self._lock:
                if removals == self._removals:
                    return use(loaded)
            discard(loaded)

    def delete(self, job_id: str) -> None:
        """Delete an ended job, and the checkpoints that only it has.

        Raises:
            NotFound: There is no such job.
            WrongState: It has not ended, or one of its checkpoints is in use.
            StorageFull: No room is left.
        """
        with self._lock:
            self._note(retention.delete_job(self.store, job_id, self.acting()))
        self._remove_files(job_id)

    def delete_checkpoint(self, reference: str) -> None:
        """Delete a checkpoint, by SHA-256 or alias, that was uploaded or recalibrated.

        Raises:
            NotFound: There is no such checkpoint.
            Conflict: It is shipped.
            WrongState: It has an alias, a job made it, or it is in use.
            StorageFull: No room is left.
        """
        sha256 = get_checkpoint(self.store, reference).sha256
        if sha256 in pretrained.SHA256.values():
            raise Conflict(f"the checkpoint {reference!r} is shipped with Tandem and stays")
        with self._lock:
            retention.delete_checkpoint(self.store, sha256, self.acting())
            self._note((sha256,))

    def apply(self, store: Store) -> bool:
        """Remove what is beyond the numbers to keep, of at most ``MAX_JOBS_AT_ONCE`` jobs.

        Then some of the free space of a SQLite file is given back to the disk.

        Args:
            store: The database, on the condition of the supervisor: that it holds the lease.

        Returns:
            Whether there may be more.

        Raises:
            LeaseLost: Another server runs the jobs.
            StorageFull: No room is left.
        """
        with self._lock:
            deleted = retention.prune(
                store,
                keep_jobs=self.keep_jobs,
                keep_states=self.keep_states,
                acting=self.acting(),
            )
            for n_jobs, (job_id, removed) in enumerate(deleted, 1):
                self._note(removed)
                text = "job %s is deleted: the newest %d are kept"
                logger.info(text, job_id, self.keep_jobs, extra={"job_id": job_id})
                self._remove_files(job_id)
                if n_jobs == MAX_JOBS_AT_ONCE:
                    return True
        remove_unknown_logs(store, self.logs)
        return shrink(store)

    def log_of(self, job_id: str) -> Path:
        """Return the file with the output of a job."""
        return self.logs / f"{job_id}.log"

    def _note(self, removed: Collection[str]) -> None:
        self._removals += 1
        self.on_removed(removed)

    def _remove_files(self, job_id: str) -> None:
        resume_files.remove(resume_files.folder_of(self.logs.parent, job_id))
        try:
            self.log_of(job_id).unlink(missing_ok=True)
        except OSError as error:  # the job is deleted all the same
            text, about = "the log of job %s stays: %s", {"job_id": job_id}
            logger.warning(text, job_id, error, extra=about)


def remove_unknown_logs(store: Store, folder: Path) -> None:
    """Delete logs of jobs that the database does not know.

    A server that was killed while it deleted a job has left them. They may belong to another
    database: they are deleted as long after the first look at them as files to resume from.
    """
    logs = {log.stem: log for log in folder.glob("*.log")}
    marks = {mark.stem: mark for mark in folder.glob(f"*{UNKNOWN}")}
    unknown = logs.keys() - job_ids(store) if logs else set()
    for job_id in marks.keys() - unknown:
        with suppress(OSError):
            marks[job_id].unlink()
    for job_id in unknown:
        log, mark = logs[job_id], logs[job_id].with_suffix(UNKNOWN)
        with suppress(OSError):  # one that cannot be changed keeps no other from its turn
            if resume_files.is_long_unknown(mark):
                log.unlink()
                mark.unlink()
