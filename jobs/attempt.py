"""One attempt of a job in its own process: arguments, logging, exit status.

``jobs.run`` and ``jobs.remote.run`` are the entry points.
"""

import argparse
import faulthandler
import logging
import os
import signal
from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any

from app import logs
from app.errors import InvalidInput, ServiceError
from app.storage_errors import StorageFull, StorageUnavailable
from app.store.records import Claim
from jobs.access import JobAccess
from jobs.worker import JobWorker, Runner

logger = logging.getLogger(__name__)

Connected = tuple[JobAccess, Mapping[str, Runner]]
"""The access to the job of an attempt, and the runner of each kind of job."""
NICENESS = 10
"""Niceness of a worker, below the priority of the server and its live cell."""


def claim_of_arguments(description: str) -> Claim:
    """Return the claim that the command line of this process names."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--job", required=True, help="id of the job")
    parser.add_argument("--attempt", required=True, type=int, help="claimed attempt")
    options = parser.parse_args()
    return Claim(job_id=options.job, attempt=options.attempt)


def run_attempt(connect: Callable[[Claim], Connected], style: logs.Style = "text") -> int:
    """Run the attempt of the command line; ``connect`` opens the access to its job.

    Returns:
        The exit status: 0 when the job's row contains the result, ``EX_TEMPFAIL`` where the
        database takes no writes.
    """
    claim = claim_of_arguments("Run one attempt of a job.")
    os.nice(NICENESS)
    faulthandler.enable()
    logs.set_up(style, **asdict(claim))
    try:
        access, runners = connect(claim)
        worker = JobWorker(access)
    except (StorageFull, StorageUnavailable) as error:
        logger.error("%s", error.message)
        return os.EX_TEMPFAIL
    except ServiceError as error:
        logger.error("%s", error.message)
        return os.EX_CONFIG
    signal.signal(signal.SIGTERM, worker.interrupt)
    logger.info("%s starts", worker.job.kind)
    return worker.execute(_runner(worker.job.kind, runners))


def _runner(kind: str, runners: Mapping[str, Runner]) -> Runner:
    def refuse(_worker: JobWorker) -> Mapping[str, Any]:
        raise InvalidInput("kind", kind, "must be a kind of job", sorted(runners))

    return runners.get(kind, refuse)
