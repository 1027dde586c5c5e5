"""The supervisor: a thread of the server that starts, monitors and stops workers.

The database has the complete state: after a kill the next server takes the lease, queues the
orphaned jobs and continues. Every write checks the lease. A server that lost it stops its
workers, and takes it again when the other server has ended. While the disk is full or the
database takes no writes, the queue waits: no job starts, none is counted as failed, and it goes
on by itself.
"""

import errno
import logging
import math
import os
import shutil
import signal
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path

from opentelemetry.context import Context
from opentelemetry.trace import NoOpTracer, Span, StatusCode, Tracer

from app.durable_files import UNREADABLE
from app.errors import Conflict, NotFound
from app.storage_errors import LeaseLost, StaleAttempt, StorageFull, StorageUnavailable
from app.store import attempts, completion
from app.store.database import reserve
from app.store.database.lease import Lease
from app.store.database.lock import ServerLock
from app.store.database.migrate import migrate
from app.store.database.schema import check_schema
from app.store.engine import Store
from app.store.records import Claim
from jobs.composed.composer import Composer
from jobs.executor import NO_CPU, Exit, LocalExecutor, LocalHandle
from jobs.resume_files import remove_unneeded
from jobs.retention import Retention
from jobs.timeouts import Timeouts

logger = logging.getLogger(__name__)


MIN_FREE_BYTES = 64 * 1024 * 1024
"""Free space of the disk below which no job starts [bytes]."""
DISK_FULL = "disk full"
DISK_ERROR = "disk error"
NO_RESOURCES = "no free resources"
"""No further process or file can be had on this machine."""
_FOR_NOW = {
    errno.ENOSPC: DISK_FULL,
    errno.EDQUOT: DISK_FULL,
    errno.EAGAIN: NO_RESOURCES,
    errno.ENOMEM: NO_RESOURCES,
    errno.EMFILE: NO_RESOURCES,
    errno.ENFILE: NO_RESOURCES,
    **dict.fromkeys(UNREADABLE, DISK_ERROR),
}
"""Errors that pass by themselves."""
OTHER_SERVER = "another server runs the jobs"


@dataclass(slots=True, kw_only=True)
class _Worker:
    """A running attempt. Times are on the monotonic clock, which stops during suspend."""

    handle: LocalHandle
    span: Span
    heartbeat_at: datetime | None = None
    heartbeat_seen: float
    writable_since: float | None = None
    leaving_since: float | None = None


class Supervisor:
    """Runs queued jobs, at most ``max_running`` at a time.

    Args:
        data_dir: The data folder: holds the server's lock and the logs of the jobs.
        max_running: Largest number of running jobs.
        executor: Starts the processes of attempts; workers of this machine by default.
        min_free_bytes: Free space of the disk below which no job starts [bytes].
        retention: Removes old jobs after one has ended.
        tracer: Makes a span of each attempt.
    """

    def __init__(
        self,
        store: Store,
        data_dir: Path,
        *,
        max_running: int = 1,
        executor: LocalExecutor | None = None,
        timeouts: Timeouts | None = None,
        min_free_bytes: int = MIN_FREE_BYTES,
        retention: Retention | None = None,
        tracer: Tracer | None = None,
    ) -> None:
        self._lock = ServerLock(store, data_dir)
        self._timeouts = timeouts or Timeouts()
        self._lease = Lease(store, self._lock, self._timeouts.lease_s)
        self._database = store
        self._store = store.fenced(self._lease.require)
        self._max_running = max_running
        self._executor = executor or LocalExecutor(store.url, data_dir)
        self._data_dir = data_dir
        self._tracer = tracer or NoOpTracer()
        self._min_free_bytes = min_free_bytes
        self._retention = retention
        self.composed: tuple[Composer, ...] = ()
        """What advances jobs made of jobs; set before the start."""
        self.on_lease: Callable[[], object] = lambda: None
        """Called when the lease was taken: another server may have changed the database."""
        self.on_tick: Callable[[], object] = lambda: None
        """Called at every tick: others change the database, too."""
        self._workers: dict[Claim, _Worker] = {}
        self._orphans_queued = False
        self._not_before = self._retain_at = -math.inf
        self.waiting: str | None = None
        """Reason for which no job runs, such as ``"disk full"``; None where the queue runs."""
        self._wake = threading.Event()
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        self._holds_lease = False

    def start(self) -> None:
        """Take the lease, upgrade the database, queue orphaned jobs, start the thread.

        Raises:
            Conflict: Another server uses this folder or database, or a newer version wrote it.
            StorageFull: No room is left for the tables, or for their upgrade.
        """
        self._lock.acquire()
        try:
            self._take_lease_or_wait()
        except BaseException:
            self._guarded(self._lease.release)
            self._lock.release()
            raise
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
            self._guarded(self._lease.release)
        self._lock.release()

    def wake(self) -> None:
        """Check the queue now, because a job was queued or cancelled."""
        self._wake.set()

    @property
    def is_alive(self) -> bool:
        """Whether the thread runs."""
        return self._thread is not None and self._thread.is_alive()

    def _take_lease_or_wait(self) -> None:
        """Take the lease; on a full disk let the thread take it once there is room."""
        try:
            self._take_lease()
        except StorageFull as error:
            try:
                check_schema(self._database)
            except StorageFull:
                pass  # SQLite cannot read either
            except Conflict:
                raise error from None
            self._wait_for(error.short, error.message)

    def _take_lease(self) -> None:
        migrate(self._database, self._lease)
        self._holds_lease, self._orphans_queued = True, False
        self._guarded(self.on_lease)
        self._guarded(self._queue_orphans)  # where it fails, the thread repeats it

    def _run(self) -> None:
        while not self._stopping.is_set():
            if self._holds_lease:
                self._guarded(self._lease.renew)
            self._guarded(self._tick if self._holds_lease else self._stand_by)
            self._guarded(self.on_tick)
            self._wake.wait(self._timeouts.tick_s)
            self._wake.clear()
        self._shut_down()

    def _stand_by(self) -> None:
        """Forget the killed workers; take the lease once the other server has ended."""
        for claim, worker in list(self._workers.items()):
            if self._executor.poll(worker.handle) is not None:
                del self._workers[claim]
        if not self._workers:
            self._lease.check()
            self._take_lease()

    def _abandon(self) -> None:
        """Kill the workers, whose jobs another server has started again."""
        self._holds_lease = False
        self.waiting = OTHER_SERVER
        for worker in self._workers.values():
            self._executor.stop(worker.handle, force=True)

    def _tick(self) -> None:
        if not self._orphans_queued:
            self._queue_orphans()
        self._reap()
        self._retain()
        waiting = self._watch() or self._lack_of_room()
        goes_on = waiting is None and time.monotonic() >= self._not_before
        if waiting is not None:
            self._wait_for(waiting, waiting)
        elif goes_on and self.waiting is not None:
            self._store.check_writable()
            self._fill_reserve()
            logger.info("the queue goes on after: %s", self.waiting)
            self.waiting = None
        for one in self.composed:
            one.advance(self._store, goes_on=goes_on)
        while goes_on and len(self._workers) < self._max_running and self._start_next():
            pass

    def _guarded(self, act: Callable[[], object]) -> None:
        """Log an error of the database once and try again at the next tick."""
        try:
            act()
        except LeaseLost as error:
            logger.error("%s; the workers of this server are stopped", error)
            self._abandon()
        except Conflict as error:
            self._wait_for(OTHER_SERVER, error.message)
        except (StorageFull, StorageUnavailable) as error:
            self._wait_for(error.short, error.message)
        except OSError as error:
            self._wait_for(_FOR_NOW.get(error.errno or 0, DISK_ERROR), str(error))
        except Exception:
            logger.exception("unexpected error in the supervisor")

    def _wait_for(self, short: str, message: str) -> None:
        if self.waiting != short:
            level = logging.WARNING if short == NO_CPU else logging.ERROR
            logger.log(level, "the queue waits: %s", message)
        self.waiting = short

    def _lack_of_room(self) -> str | None:
        free = shutil.disk_usage(self._data_dir).free
        return DISK_FULL if free < self._min_free_bytes else None

    def _queue_orphans(self) -> None:
        for job_id in completion.requeue_orphans(self._store):
            text = "the job was interrupted with the last server: it resumes"
            logger.info(text, extra={"job_id": job_id})
        self._orphans_queued = True
        self._fill_reserve()

    def _start_next(self) -> bool:
        found = attempts.claim_next(self._store)
        if found is None:
            return False
        claim, job = found
        logger.info("%s starts", job.kind, extra=asdict(claim))
        try:
            handle = self._executor.start(claim)
        except OSError as error:
            if error.errno in _FOR_NOW:
                self._not_before = time.monotonic() + self._timeouts.retry_s
                self._give_back(claim)
                raise
            reason = f"the worker could not be started: {error}"
            failures = self._timeouts.max_failures
            completion.crash(self._store, claim, reason, max_failures=failures)
            return False
        about = {**asdict(claim), "kind": job.kind, "preset": job.preset or ""}
        span = self._tracer.start_span("job attempt", Context(), attributes=about)
        now = time.monotonic()
        self._workers[claim] = _Worker(handle=handle, span=span, heartbeat_seen=now)
        return True

    def _reap(self) -> None:
        for claim, worker in list(self._workers.items()):
            if (ended := self._executor.poll(worker.handle)) is not None:
                self._settle(claim, worker, ended)
                _end(worker.span, ended)
                del self._workers[claim]
                self._retain_at = -math.inf

    def _retain(self) -> None:
        """Remove old jobs and files after the end of a worker, and once in a while."""
        if time.monotonic() >= self._retain_at:
            self._retain_at = time.monotonic() + self._timeouts.retain_s
            if self._retention is not None and self._retention.apply(self._store):
                self._retain_at = -math.inf  # the files in the last turn
                return
            remove_unneeded(self._store, self._data_dir)

    def _settle(self, claim: Claim, worker: _Worker, ended: Exit) -> None:
        """Record the end of an attempt, if its worker has not."""
        had_to_leave = worker.leaving_since is not None
        # The database takes no writes, or a service manager stops the workers, too.
        gave_up = ended.code in (os.EX_TEMPFAIL, -signal.SIGTERM)
        if gave_up and not had_to_leave:
            self._not_before = time.monotonic() + self._timeouts.retry_s
        if had_to_leave or gave_up:
            self._give_back(claim)
            return
        failures = self._timeouts.max_failures
        try:
            job = completion.crash(self._store, claim, ended.reason, max_failures=failures)
        except StaleAttempt:
            return  # the worker recorded it: the normal case
        reason = "the attempt crashed, the job is %s now: %s"
        logger.warning(reason, job.state, ended.reason, extra=asdict(claim))

    def _watch(self) -> str | None:
        """Stop cancelled and silent workers; return the reason of one that cannot write."""
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
                logger.warning("the worker timed out and is killed", extra=asdict(claim))
                self._executor.stop(worker.handle, force=True)
        for claim in rows.keys() - self._workers.keys():  # claimed, but never started
            self._give_back(claim)
        return next((row.waiting for row in rows.values() if row.waiting), None)

    def _timed_out(self, worker: _Worker, now: float) -> bool:
        leaving = worker.leaving_since
        if leaving is not None and now - leaving > self._timeouts.cancel_s:
            return True
        silence = now - worker.heartbeat_seen
        if silence <= min(self._timeouts.late_s, self._timeouts.silence_s):
            worker.writable_since = None
            return False
        if worker.writable_since is None:  # no heartbeat reaches a database without writes
            self._store.check_writable()
            worker.writable_since = time.monotonic()
        is_dead = now - worker.writable_since > self._timeouts.lock_s
        return is_dead and silence > self._timeouts.silence_s

    def _shut_down(self) -> None:
        deadline = time.monotonic() + self._timeouts.shutdown_s
        for worker in self._workers.values():
            self._executor.stop(worker.handle, force=False)
        while self._alive() and time.monotonic() < deadline:
            if self._holds_lease:  # for the last states of the workers
                self._guarded(self._lease.renew)
            time.sleep(0.05)
        for worker in self._alive():
            self._executor.stop(worker.handle, force=True)
        while self._alive():
            time.sleep(0.02)
        for claim, worker in self._workers.items():
            _end(worker.span, self._executor.poll(worker.handle))
            self._guarded(lambda claim=claim: self._give_back(claim))  # type: ignore[misc]
        self._workers.clear()

    def _alive(self) -> list[_Worker]:
        return [w for w in self._workers.values() if self._executor.poll(w.handle) is None]

    def _give_back(self, claim: Claim) -> None:
        with suppress(StaleAttempt, NotFound):  # the worker recorded it
            completion.give_back(self._store, claim)

    def _fill_reserve(self) -> None:
        try:
            reserve.fill_reserve(self._store)
        except StorageFull as error:
            logger.error("%s", error)


def _end(span: Span, ended: Exit | None) -> None:
    """End the span of an attempt."""
    if ended is not None:
        span.set_attribute("exit", ended.code)
        if ended.code != 0:
            span.set_status(StatusCode.ERROR, ended.reason.partition("\n")[0])
    span.end()
