"""Reports: the page that compares Tandem with the thesis, from stored or new results.

The evaluations of a report are jobs of the queue; their state is in the database, so that a
killed server continues, and a resumed report repeats only those without a result.
"""

import logging
import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from app.errors import InvalidInput, NotFound
from app.policies.evaluation.registry import most_episodes
from app.policies.report.page import RESULTS, evaluations, page
from app.provenance import describe
from app.store import composed_jobs, jobs
from app.store.engine import Store
from app.store.records import JobRecord
from jobs.spec import AnySpec, ReportSpec, parse_spec

logger = logging.getLogger(__name__)

PERIOD_S = 1.0
"""Least time between two looks at the reports [s]."""


class Reports:
    """Starts the evaluations of the open reports, and writes their pages."""

    def __init__(self) -> None:
        self._next = 0.0

    def advance(self, store: Store) -> None:
        """Do what is due; at most once in a period.

        Raises:
            StorageFull: No room is left.
            StorageUnavailable: The database does not answer.
        """
        if time.monotonic() < self._next:
            return
        for job in composed_jobs.open_jobs(store, "report"):
            try:
                _advance(store, job)
            except (InvalidInput, NotFound, OSError, ValueError, KeyError) as error:
                text = getattr(error, "message", f"the page could not be written: {error!r}")
                logger.warning("%s", text, extra={"job_id": job.id})
                composed_jobs.end(store, job.id, "failed", error=text)
        self._next = time.monotonic() + PERIOD_S


def _advance(store: Store, job: JobRecord) -> None:
    spec = parse_spec(job.spec)
    assert isinstance(spec, ReportSpec)
    parts = composed_jobs.parts_of(store, job.id)
    if job.state == "cancelling":
        composed_jobs.cancel(store, job, parts)
        return
    if job.state == "queued":
        composed_jobs.start(store, job.id)
        job = jobs.get_job(store, job.id)
    newest = {(one.spec["protocol"], one.spec["checkpoint"]): one for one in parts}
    wanted = evaluations() if spec.measure else {}
    ended: dict[str, JobRecord] = {}
    active = 0
    for number, (file, tested) in enumerate(wanted.items(), 1):
        part, key = newest.get(tested), f"{job.id}-{job.attempt}-{file}"  # a key per attempt
        if part is not None and not part.is_final:
            active += 1
        elif part is not None and (part.state == "succeeded" or part.idempotency_key == key):
            ended[file] = part
        elif active < spec.parallel:
            new = replace(
                _evaluation(spec, *tested).new_job(),
                name=f"report {job.number}, {file}",
                priority=job.priority,
                part_of=job.id,
                trial=number,
            )
            jobs.create_job(store, new, idempotency_key=key)
            active += 1
    composed_jobs.record(store, job.id, len(ended), {})
    if len(ended) == len(wanted):
        composed_jobs.end(store, job.id, "succeeded", result=_written(ended))


def _evaluation(spec: ReportSpec, protocol: str, checkpoint: str) -> AnySpec:
    episodes = spec.episodes and min(spec.episodes, most_episodes(protocol))
    body = {"kind": "evaluate", "protocol": protocol, "checkpoint": checkpoint}
    return parse_spec({**body, "episodes": episodes, "seed": spec.seed})


def _written(ended: Mapping[str, JobRecord]) -> dict[str, Any]:
    """Return the result of a report: its page, and what the page lacks."""
    measured = {
        file: {**part.result, "job": f"job {part.number}", "machine": describe()}
        for file, part in ended.items()
        if part.state == "succeeded" and part.result is not None
    }
    markdown, missing = page(RESULTS, {file: measured.get(file, {}) for file in ended})
    failed = [file for file in ended if file not in measured]
    return {
        "markdown": markdown,
        "missing": missing,
        "failed": failed,
        "measured": len(measured),
    }
