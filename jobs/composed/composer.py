"""Base class: advances the open jobs of one kind, at most once in a period."""

import logging
import time
from abc import ABC, abstractmethod
from contextlib import suppress
from typing import ClassVar

from app.errors import NotFound, ServiceError
from app.storage_errors import LeaseLost, StorageFull, StorageUnavailable
from app.store import composed_jobs
from app.store.engine import Store
from app.store.records import JobRecord

logger = logging.getLogger(__name__)

PERIOD_S = 1.0
"""Least time between two checks of the open jobs [s]."""


class Composer(ABC):
    """Advances the open jobs of one kind."""

    kind: ClassVar[str]
    """Kind of the jobs."""

    def __init__(self) -> None:
        self._next = 0.0

    def advance(self, store: Store, *, goes_on: bool = True) -> None:
        """Advance the open jobs; at most once in a period.

        A job that cannot continue fails, so that it does not block others.

        Args:
            goes_on: Whether the queue goes on; otherwise only cancelled jobs advance, which may
                free what it waits for.

        Raises:
            StorageFull: No room is left.
            StorageUnavailable: The database does not answer.
            LeaseLost: Another server runs the jobs.
        """
        if time.monotonic() < self._next:
            return
        for job in composed_jobs.open_jobs(store, self.kind):
            if not goes_on and not job.cancel_requested:
                continue
            try:
                self._advance(store, job)
            except (StorageFull, StorageUnavailable, LeaseLost):
                raise
            except ServiceError as error:
                self._fail(store, job, error.message)
            except Exception as error:
                logger.exception("the %s cannot go on", job.kind, extra={"job_id": job.id})
                name = type(error).__name__
                self._fail(store, job, f"it cannot go on ({name}); the log has the trace")
        self._next = time.monotonic() + PERIOD_S

    @abstractmethod
    def _advance(self, store: Store, job: JobRecord) -> None:
        """Start, cancel and collect the parts of one job."""

    def _fail(self, store: Store, job: JobRecord, reason: str) -> None:
        logger.warning("%s", reason, extra={"job_id": job.id})
        with suppress(NotFound):  # it was deleted since
            composed_jobs.end(store, job.id, "failed", error=reason)
