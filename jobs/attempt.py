"""One attempt of a job in its own process: arguments, logging, exit status.

``jobs.run`` and ``jobs.remote.run`` are the entry points.
"""

import argparse
import faulthandler
import logging
import os
import signal
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from app import logs
from app.errors import InvalidInput, ServiceError
from app.storage_errors import StorageFull, StorageUnavailable
from app.store.records import Claim
from jobs.access import JobAccess
from jobs.worker import JobWorker, Runner

logger = logging.getLogger(__name__)

Connect = Callable[[Claim], tuple[JobAccess, Mapping[str, Runner]]]
"""Returns the access to the job of an attempt, and the runner of each kind of job."""
NICENESS = 10
"""Niceness of a worker, below the priority of the server and its live cell."""


def run_attempt(
    connect: Connect,
    style: logs.Style = "text",
    arguments: Sequence[str] | None = None,
) -> int:
    """Run the attempt of the command line.

    Args:
        connect: Opens the access to the job.
        style: Form of the log's lines.
        arguments: Command line; that of the process by default.

    Returns:
        The exit status: 0 when the job's row contains the result, ``EX_TEMPFAIL`` where the
        database takes no writes.
    """
    parser = argparse.ArgumentParser(description="Run one attempt of a job.")
    parser.add_argument("--job", required=True, help="id of the job")
    parser.add_argument("--attempt", required=True, type=int, help="claimed attempt")
    options = parser.parse_args(arguments)
    os.nice(NICENESS)
    faulthandler.enable()
    logs.set_up(style, job_id=options.job, attempt=options.attempt)
    try:
        access, runners = connect(Claim(job_id=options.job, attempt=options.attempt))
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
