"""The worker of a job: one attempt in one process.

A thread reads the job's row twice a second: it stops the runner after a cancel and writes
heartbeats. While the database takes no writes (a full disk, a lock), the runner waits in the
write: no step is lost, and the job goes on by itself.
"""

import logging
import os
import signal
import threading
import time
from collections.abc import Callable, Mapping
from types import FrameType
from typing import Any

from app.errors import ServiceError
from app.storage_errors import StaleAttempt, StorageDamaged, StorageFull, StorageUnavailable
from app.store.records import JobRecord, NewCheckpoint, ResumeState, SpentBudget
from jobs.access import EndOfAttempt, JobAccess

logger = logging.getLogger(__name__)

CANCEL_CHECK_S = 0.5
"""Period of the check for a cancel [s]."""
HEARTBEAT_S = 5.0
"""Period of the heartbeats [s]."""
RETRY_S = 1.0
"""Time from a failed write to its repetition [s]."""
POLL_S = 0.1
"""Period of the check for a stop while a write waits [s]."""

Runner = Callable[["JobWorker"], Mapping[str, Any] | None]
"""Runs one kind of job and returns its result."""


class JobWorker:
    """Interface of a runner to its job. Writes are fenced by the attempt.

    Raises:
        StaleAttempt: The attempt does not hold the job.
    """

    def __init__(self, access: JobAccess) -> None:
        self.job: JobRecord = access.job()
        self.access = access
        self._cancelled = threading.Event()
        self._interrupted = False  # no event: a signal handler must not wait for its lock
        self._over = threading.Event()
        self._stop_seen = False
        self._waiting: str | None = None
        self._early_end: SpentBudget | None = None
        self._last_read = self.job
        self._run_before, self._started = self.job.run_s, time.monotonic()

    @property
    def run_s(self) -> float:
        """Run time of all attempts so far [s]."""
        return self._run_before + time.monotonic() - self._started

    def resume(
        self, usable: Callable[[ResumeState], bool] = lambda _: True
    ) -> ResumeState | None:
        """Return the state to resume from; None for a new start.

        Args:
            usable: Whether what a state refers to is there, such as its files.
        """
        found = self.access.load_resume(usable)
        step = None if found is None else found.step
        if self.job.step != (step or 0):
            self.access.resume_earlier(step)
        return found

    def record_progress(
        self, step: int, values: Mapping[str, float | None], *, total_steps: int | None = None
    ) -> None:
        """Add a point to the job's curve; waits until the database takes it.

        At a point beyond the job's step budget the runner must stop.

        Raises:
            StaleAttempt: The attempt no longer holds the job.
            StorageFull: No room is left, and the runner must stop.
        """
        self.wait_to(lambda: self.access.record_progress(step, values, total_steps))
        budget = self._last_read.step_budget
        if budget is not None and budget <= step != total_steps:
            self._early_end = "step budget"

    def record_checkpoint(
        self, step: int, policy: NewCheckpoint, resume: ResumeState | None
    ) -> None:
        """Store a policy and the state to resume from; waits until the database takes them.

        Raises:
            StaleAttempt: The attempt no longer holds the job.
            StorageFull: No room is left, and the runner must stop.
        """
        self.wait_to(lambda: self.access.record_checkpoint(step, policy, resume))

    def should_stop(self) -> bool:
        """Whether the runner must write a last checkpoint and return; for every step."""
        budget = self._last_read.time_budget_s
        if self._early_end is None and budget is not None and self.run_s >= budget:
            self._early_end = "time budget"
        return self._interrupted_now() or self._early_end is not None

    def _interrupted_now(self) -> bool:
        stop = self._cancelled.is_set() or self._interrupted or self._over.is_set()
        self._stop_seen = self._stop_seen or stop
        return stop

    def interrupt(self, _signal: int = 0, _frame: FrameType | None = None) -> None:
        """Stop the runner; the job resumes with the next attempt."""
        self._interrupted = True

    def end_at_sigterm(self) -> None:
        """End this process at SIGTERM, for runners without ``should_stop``."""
        signal.signal(signal.SIGTERM, signal.SIG_DFL)

    def execute(self, runner: Runner) -> int:
        """Run the job and record its end.

        Returns:
            The process's exit status: 0 when the job's row contains the end, ``EX_TEMPFAIL``
            where the database takes no writes, so that the job is queued again.
        """
        threading.Thread(target=self._beat, name="beat", daemon=True).start()
        try:
            self._run(runner)
        except StaleAttempt as error:
            logger.warning("%s", error)
        except (StorageFull, StorageUnavailable) as error:
            logger.error("stopped: %s", error.message)
            return os.EX_TEMPFAIL
        finally:
            self._over.set()
        return 0

    def _run(self, runner: Runner) -> None:
        try:
            result = runner(self)
            self.wait_to(lambda: self._record_end(result))
        except (StaleAttempt, StorageFull, StorageUnavailable):
            raise
        except ServiceError as error:
            logger.error("the job fails: %s", error.message)
            self.access.end(EndOfAttempt("failed", error=error.message))

    def _record_end(self, result: Mapping[str, Any] | None) -> None:
        cancelled = self.access.job().cancel_requested
        if self._stop_seen and cancelled:
            self.access.end(EndOfAttempt("cancelled", result, run_s=self.run_s))
            logger.info("cancelled")
        elif self._stop_seen:
            self.access.end(EndOfAttempt("interrupted"))
            logger.info("interrupted: the job resumes with the next attempt")
        else:
            early_end = self._early_end
            end = EndOfAttempt("succeeded", result, ended_by=early_end, run_s=self.run_s)
            self.access.end(end)
            logger.info("succeeded" if early_end is None else f"ended by its {early_end}")

    def wait_to(self, access: Callable[[], None]) -> None:
        """Write or read; while database or disk fail, repeat it until the runner must stop.

        Raises:
            StorageFull: No room is left, and the runner must stop.
            StorageUnavailable: The same for a database that does not answer.
        """
        while True:
            try:
                access()
            except StorageDamaged:
                raise
            except (StorageFull, StorageUnavailable) as error:
                if self._interrupted_now():
                    raise
                if self._waiting != error.short:
                    logger.warning("waits: %s", error.message)
                self._waiting = error.short
            else:
                self._waiting = None
                return
            again = time.monotonic() + RETRY_S
            while time.monotonic() < again and not self._interrupted_now():
                time.sleep(POLL_S)

    def _beat(self) -> None:
        next_heartbeat = time.monotonic() + HEARTBEAT_S
        recorded: str | None = None
        silent = False
        while not self._over.wait(CANCEL_CHECK_S):
            waiting = self._waiting
            due = time.monotonic() >= next_heartbeat or waiting != recorded
            try:
                job = self.access.heartbeat(waiting, self.run_s) if due else self.access.job()
            except StaleAttempt:
                self._over.set()
                return
            except (StorageUnavailable, StorageFull) as error:
                if not silent:
                    logger.warning("no heartbeat for now: %s", error)
                silent = True
                continue
            except Exception:  # a later one may pass; without any the supervisor ends this one
                if not silent:
                    logger.exception("no heartbeat for now")
                silent = True
                continue
            self._last_read, silent = job, False
            if due:
                next_heartbeat, recorded = time.monotonic() + HEARTBEAT_S, waiting
            if job.cancel_requested:
                self._cancelled.set()
