"""Removal of checkpoints, and of ended jobs with their files: how many are kept."""

import logging
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

from app.errors import Conflict
from app.policies.checkpoints import pretrained
from app.store import retention
from app.store.checkpoints import get_checkpoint
from app.store.engine import Store
from jobs import resume_files

logger = logging.getLogger(__name__)


@dataclass(slots=True, kw_only=True)
class Retention:
    """Removes checkpoints, and ended jobs with their output and their files to resume from."""

    store: Store
    """The database."""
    logs: Path
    """Folder with the output of each job."""
    keep_jobs: int
    """Number of ended jobs to keep."""
    keep_states: int
    """Number of cancelled or failed jobs whose states to resume from are kept."""
    acting: Callable[[], Mapping[str, str]]
    """Returns the SHA-256 of each checkpoint that acts, with its place."""
    on_removed: Callable[[Collection[str]], None] = lambda _: None
    """Called with the SHA-256 of the checkpoints that were removed."""

    def delete(self, job_id: str) -> None:
        """Delete an ended job, and the checkpoints that only it has.

        Raises:
            NotFound: There is no such job.
            WrongState: It has not ended, or one of its checkpoints is in use.
            StorageFull: No room is left.
        """
        self.on_removed(retention.delete_job(self.store, job_id, self.acting()))
        self._remove_files(job_id)

    def delete_checkpoint(self, reference: str) -> None:
        """Delete a checkpoint that was uploaded or recalibrated.

        Args:
            reference: Its SHA-256 or alias.

        Raises:
            NotFound: There is no such checkpoint.
            Conflict: It is shipped.
            WrongState: It has an alias, a job made it, or it is in use.
            StorageFull: No room is left.
        """
        sha256 = get_checkpoint(self.store, reference).sha256
        if sha256 in pretrained.SHA256.values():
            raise Conflict(f"the checkpoint {reference!r} is shipped with Tandem and stays")
        retention.delete_checkpoint(self.store, sha256, self.acting())
        self.on_removed((sha256,))

    def apply(self) -> None:
        """Remove what is beyond the numbers to keep."""
        for job_id, removed in retention.prune(
            self.store,
            keep_jobs=self.keep_jobs,
            keep_states=self.keep_states,
            acting=self.acting(),
        ):
            self.on_removed(removed)
            logger.info("job %s is deleted: the newest %d are kept", job_id, self.keep_jobs)
            self._remove_files(job_id)

    def _remove_files(self, job_id: str) -> None:
        (self.logs / f"{job_id}.log").unlink(missing_ok=True)
        resume_files.remove(resume_files.folder_of(self.logs.parent, job_id))
