"""The supervisor: a thread of the server that starts, monitors and stops workers.

The database has the complete state: after a kill the next server acquires the lock, queues the
orphaned jobs and continues.
"""

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from app.errors import NotFound, StaleAttempt, StorageFull, StorageUnavailable
from app.store import attempts, completion
from app.store.engine import Store
from app.store.lock import ServerLock
from app.store.migrate import migrate
from app.store.records import Claim
from jobs.executor import Executor, Exit, Handle, LocalProcess

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class Timeouts:
    """Timeouts of the supervisor."""

    tick_s: float = 0.25
    """Period of the supervisor [s]."""
    cancel_s: float = 30.0
    """Time from a cancel until the worker is killed [s]."""
    silence_s: float = 300.0
    """Time without a heartbeat until a worker is killed [s]."""
    shutdown_s: float = 8.0
    """Time for the workers' last checkpoints when the server stops [s]."""
    max_failures: int = 3
    """A job fails with this number of crashes."""


@dataclass(slots=True, kw_only=True)
class _Worker:
    """A running attempt. Times are on the monotonic clock, which stops during suspend."""

    handle: Handle
    heartbeat_at: datetime | None = None
    heartbeat_seen: float
    leaving_since: float | None = None
    ended: Exit | None = None


class Supervisor:
    """Runs queued jobs, at most ``max_running`` at a time.

    Args:
        store: The database.
        data_dir: The data folder: holds the server's lock and the logs of the jobs.
        max_running: Largest number of running jobs.
        executor: Runs the attempts; local processes by default.
        timeouts: Timeouts.
    """

    def __init__(
        self,
        store: Store,
        data_dir: Path,
        *,
        max_running: int = 1,
        executor: Executor | None = None,
        timeouts: Timeouts | None = None,
    ) -> None:
        self._store = store
        self._lock = ServerLock(store, data_dir)
        self._max_running = max_running
        self._executor = executor or LocalProcess(store.url, data_dir)
        self._timeouts = timeouts or Timeouts()
        self._workers: dict[Claim, _Worker] = {}
        self._wake = threading.Event()
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        self._trouble: str | None = None

    def start(self) -> None:
        """Acquire the lock, upgrade the database, queue orphaned jobs, start the thread.

        Raises:
            Conflict: Another server uses this folder or database, or a newer version wrote it.
        """
        self._lock.acquire()
        try:
            migrate(self._store)
            orphans = completion.requeue_orphans(self._store)
            self._fill_reserve()
        except BaseException:
            self._lock.release()
            raise
        for job_id in orphans:
            logger.info("job %s was interrupted with the last server: it resumes", job_id)
        self._stopping.clear()
        self._thread = threading.Thread(target=self._run, name="job-supervisor", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop the workers after a last checkpoint, queue their jobs, release the lock."""
        self._stopping.set()
        self._wake.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        self._lock.release()

    def wake(self) -> None:
        """Check the queue now, because a job was queued or cancelled."""
        self._wake.set()

    @property
    def is_alive(self) -> bool:
        """Whether the thread runs."""
        return self._thread is not None and self._thread.is_alive()

    def _run(self) -> None:
        while not self._stopping.is_set():
            self._guarded(self._tick)
            self._wake.wait(self._timeouts.tick_s)
            self._wake.clear()
        self._shut_down()

    def _tick(self) -> None:
        self._reap()
        self._watch()
        while len(self._workers) < self._max_running and self._start_next():
            pass

    def _guarded(self, act: Callable[[], object]) -> None:
        """Log an error of the database once and try again at the next tick."""
        try:
            act()
        except (StorageFull, StorageUnavailable, OSError) as error:
            if self._trouble != str(error):
                logger.error("the supervisor waits for the database: %s", error)
            self._trouble = str(error)
        except Exception:
            logger.exception("unexpected error in the supervisor")
        else:
            self._trouble = None

    def _start_next(self) -> bool:
        found = attempts.claim_next(self._store)
        if found is None:
            return False
        claim, job = found
        logger.info("job %s (%s): attempt %d starts", job.id, job.kind, claim.attempt)
        try:
            handle = self._executor.start(claim)
        except OSError as error:
            reason = f"the worker could not be started: {error}"
            failures = self._timeouts.max_failures
            completion.crash(self._store, claim, reason, max_failures=failures)
            return False
        self._workers[claim] = _Worker(handle=handle, heartbeat_seen=time.monotonic())
        return True

    def _reap(self) -> None:
        for claim, worker in list(self._workers.items()):
            worker.ended = worker.ended or self._executor.poll(worker.handle)
            if worker.ended is not None:
                self._settle(claim, worker.ended)
                del self._workers[claim]

    def _settle(self, claim: Claim, ended: Exit) -> None:
        """Record the end of an attempt, if its worker has not."""
        failures = self._timeouts.max_failures
        try:
            job = completion.crash(self._store, claim, ended.reason, max_failures=failures)
        except StaleAttempt:
            return  # the worker recorded it: the normal case
        logger.warning(
            "job %s: attempt %d crashed, the job is %s now: %s",
            claim.job_id,
            claim.attempt,
            job.state,
            ended.reason,
        )

    def _watch(self) -> None:
        now = time.monotonic()
        rows = {job.claim: job for job in attempts.running_jobs(self._store)}
        for claim, worker in self._workers.items():
            row = rows.get(claim)
            if row is None:  # ended, and about to exit
                worker.leaving_since = worker.leaving_since or now
            elif row.cancel_requested and worker.leaving_since is None:
                worker.leaving_since = now
                self._executor.stop(worker.handle, force=False)
            elif row.heartbeat_at != worker.heartbeat_at:
                worker.heartbeat_at, worker.heartbeat_seen = row.heartbeat_at, now
            if self._timed_out(worker, now):
                logger.warning("job %s: its worker timed out and is killed", claim.job_id)
                self._executor.stop(worker.handle, force=True)
        for claim in rows.keys() - self._workers.keys():  # claimed, but never started
            self._give_back(claim)

    def _timed_out(self, worker: _Worker, now: float) -> bool:
        leaving = worker.leaving_since
        if leaving is not None and now - leaving > self._timeouts.cancel_s:
            return True
        return now - worker.heartbeat_seen > self._timeouts.silence_s

    def _shut_down(self) -> None:
        deadline = time.monotonic() + self._timeouts.shutdown_s
        for worker in self._workers.values():
            self._executor.stop(worker.handle, force=False)
        while self._alive() and time.monotonic() < deadline:
            time.sleep(0.05)
        for worker in self._alive():
            self._executor.stop(worker.handle, force=True)
        while self._alive():
            time.sleep(0.02)
        for claim in self._workers:
            self._guarded(lambda claim=claim: self._give_back(claim))  # type: ignore[misc]
        self._workers.clear()

    def _alive(self) -> list[_Worker]:
        return [w for w in self._workers.values() if self._executor.poll(w.handle) is None]

    def _give_back(self, claim: Claim) -> None:
        try:
            completion.give_back(self._store, claim)
        except (StaleAttempt, NotFound):
            return  # the worker recorded it

    def _fill_reserve(self) -> None:
        try:
            completion.fill_reserve(self._store)
        except StorageFull as error:
            logger.error("%s", error)
