"""The report whose evaluations a running server measures again, as one of its jobs."""

import sys
import time
from collections.abc import Mapping
from typing import Any

import httpx

from app.api.schemas.jobs import JobPublic
from app.client import Client, Refused
from app.errors import Conflict, NotReady
from app.settings import Settings
from app.store.records import FINAL_STATES

POLL_S = 2.0
"""Time between two questions for the state of the job [s]."""


def measured_report(
    settings: Settings, episodes: int | None, written: float
) -> Mapping[str, Any]:
    """Return the result of a report job that measures, and print its progress.

    The newest such job of the server is followed if it runs, and resumed if it has ended
    without all results. Its result is returned if it has ended since the page was written, as
    after an interruption of this call; otherwise a new job is posted. It continues without
    this call.

    Args:
        settings: Address and token of the server.
        episodes: Episodes of each evaluation, where it admits so many; None for its own number.
        written: Time at which the page was last written [s since 1970]; 0 if there is none.

    Raises:
        NotReady: No server answers.
        Conflict: The server refuses the job, also while it starts; or the job was cancelled or
            has failed.
    """
    address = settings.worker_address
    try:
        with Client(address, token=settings.secret) as client:
            job = _open_job(client, {"measure": True, "episodes": episodes}, written)
            ended = job.state in FINAL_STATES
            rest = "has measured" if ended else "measures, also without this command"
            _say(f"job {job.number} of {address} {rest}")
            return _result(_ended(client, job))
    except httpx.TransportError as error:
        remedy = "start one with `make run`, or write stored results with --quick"
        raise NotReady(f"no server answers at {address} ({error}): {remedy}") from error
    except Refused as refused:
        raise Conflict(f"{address} refused: {refused}") from refused


def _open_job(client: Client, spec: Mapping[str, Any], written: float) -> JobPublic:
    """Return the newest job with a spec, queued again where it lacks results, or a new one."""
    for job in client.list_jobs(kind="report").items:
        if all(job.spec[name] == value for name, value in spec.items()):
            if job.finished_at is None:
                return job
            if job.state != "succeeded" or job.ended_by is not None:
                return client.resume_job(job.id)
            if job.finished_at.timestamp() > written:
                return job
            break
    return client.create_job({"kind": "report", **spec})


def _ended(client: Client, job: JobPublic) -> JobPublic:
    """Return a job once it has ended; print how many of its evaluations have."""
    done = -1
    while job.state not in FINAL_STATES:
        if job.step != done:
            done = job.step
            _say(f"    {done} of {job.total_steps} evaluations")
        time.sleep(POLL_S)
        job = client.get_job(job.id)
    return job


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _result(job: JobPublic) -> Mapping[str, Any]:
    if job.result is None:
        reason = "" if job.error is None else f": {job.error}"
        raise Conflict(f"job {job.number} is {job.state}{reason}; the same command resumes it")
    return job.result
