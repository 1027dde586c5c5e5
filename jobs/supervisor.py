"""The supervisor: a thread in the server that starts, watches and settles the workers.

Rows in the database are the truth. The supervisor keeps nothing that a new one could not find
again: a server that was killed starts, takes the lock, queues the orphans and goes on.
"""

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from app.errors import NotFound, StaleAttempt, StorageFull, StorageUnavailable
from app.store import attempts, endings
from app.store.engine import Store
from app.store.lock import ServerLock
from app.store.migrate import migrate
from app.store.records import Claim
from jobs.executor import Executor, Exit, Handle, LocalProcess

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class Patience:
    """How long the supervisor waits."""

    tick_s: float = 0.25
    """Time between two looks at the workers [s]."""
    cancel_s: float = 30.0
    """Time a worker has to stop by itself after a cancel, before it is killed [s]."""
    silence_s: float = 300.0
    """Time without a heartbeat after which a worker counts as stuck and is killed [s]."""
    shutdown_s: float = 8.0
    """Time the workers have to write a last checkpoint when the server stops [s]."""
    max_failures: int = 3
    """A job fails with its crash number ``max_failures``."""


@dataclass(slots=True, kw_only=True)
class _Worker:
    """One running attempt. The clock is monotonic: it stands still while a laptop sleeps."""

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
        max_running: How many jobs may run at once.
        executor: Where they run; local processes by default.
        patience: How long to wait for what.
    """

    def __init__(
        self,
        store: Store,
        data_dir: Path,
        *,
        max_running: int = 1,
        executor: Executor | None = None,
        patience: Patience | None = None,
    ) -> None:
        self._store = store
        self._lock = ServerLock(store, data_dir)
        self._max_running = max_running
        self._executor = executor or LocalProcess(store.url, data_dir)
        self._patience = patience or Patience()
        self._workers: dict[Claim, _Worker] = {}
        self._wake = threading.Event()
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        self._trouble: str | None = None

    def start(self) -> None:
        """Take the lock, bring the database up to date, queue orphans, start working.

        Raises:
            Conflict: Another server uses this folder or database, or a newer version wrote it.
        """
        self._lock.acquire()
        try:
            migrate(self._store)
            orphans = endings.requeue_orphans(self._store)
            self._fill_reserve()
        except BaseException:
            self._lock.release()
            raise
        for job_id in orphans:
            logger.info("job %s was interrupted with the last server: it goes on", job_id)
        self._stopping.clear()
        self._thread = threading.Thread(target=self._run, name="job-supervisor", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Let the workers write a last checkpoint, queue their jobs again, free the lock."""
        self._stopping.set()
        self._wake.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        self._lock.release()

    def wake(self) -> None:
        """Look at the queue now, because a job was queued or cancelled."""
        self._wake.set()

    @property
    def is_alive(self) -> bool:
        """Whether the supervisor works."""
        return self._thread is not None and self._thread.is_alive()

    def _run(self) -> None:
        while not self._stopping.is_set():
            self._guarded(self._tick)
            self._wake.wait(self._patience.tick_s)
            self._wake.clear()
        self._shut_down()

    def _tick(self) -> None:
        self._reap()
        self._watch()
        while len(self._workers) < self._max_running and self._start_next():
            pass

    def _guarded(self, act: Callable[[], object]) -> None:
        """Survive trouble with the database: say it once, try again at the next tick."""
        try:
            act()
        except (StorageFull, StorageUnavailable, OSError) as error:
            if self._trouble != str(error):
                logger.error("the supervisor cannot go on for now: %s", error)
            self._trouble = str(error)
        except Exception:
            logger.exception("the supervisor met a bug and goes on")
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
            failures = self._patience.max_failures
            endings.crash(self._store, claim, reason, max_failures=failures)
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
        """Make the row say how the attempt ended, if its worker has not."""
        failures = self._patience.max_failures
        try:
            job = endings.crash(self._store, claim, ended.reason, max_failures=failures)
        except StaleAttempt:
            return  # the worker settled it: the normal case
        logger.warning(
            "job %s: attempt %d crashed, the job is %s now: %s",
            claim.job_id,
            claim.attempt,
            job.state,
            ended.reason,
        )

    def _watch(self) -> None:
        now = time.monotonic()
        rows = {watch.claim: watch for watch in attempts.watch_running(self._store)}
        for claim, worker in self._workers.items():
            row = rows.get(claim)
            if row is None:  # settled, and about to exit; if it hangs there, end it
                worker.leaving_since = worker.leaving_since or now
            elif row.cancel_requested and worker.leaving_since is None:
                worker.leaving_since = now
                self._executor.stop(worker.handle, force=False)
            elif row.heartbeat_at != worker.heartbeat_at:
                worker.heartbeat_at, worker.heartbeat_seen = row.heartbeat_at, now
            if self._lost_patience(worker, now):
                logger.warning("job %s: its worker does not react, killing it", claim.job_id)
                self._executor.stop(worker.handle, force=True)
        for claim in rows.keys() - self._workers.keys():  # claimed, but never started
            self._give_back(claim)

    def _lost_patience(self, worker: _Worker, now: float) -> bool:
        leaving = worker.leaving_since
        if leaving is not None and now - leaving > self._patience.cancel_s:
            return True
        return now - worker.heartbeat_seen > self._patience.silence_s

    def _shut_down(self) -> None:
        deadline = time.monotonic() + self._patience.shutdown_s
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
            endings.give_back(self._store, claim)
        except (StaleAttempt, NotFound):
            return  # the worker did so itself

    def _fill_reserve(self) -> None:
        try:
            endings.fill_reserve(self._store)
        except StorageFull as error:
            logger.error("%s", error)
