"""Reports: the page that compares Tandem with the thesis, from stored or new results.

The evaluations of a report are jobs of the queue; their state is in the database, so that a
killed server continues, and a resumed report repeats only those without a result.
"""

from collections.abc import Mapping
from typing import Any

from app.policies.evaluation.registry import most_episodes
from app.policies.report.page import RESULTS, evaluations, page
from app.provenance import describe
from app.store import composed_jobs, jobs
from app.store.engine import Store
from app.store.records import EarlyEnd, JobRecord
from jobs.composed.composer import Composer
from jobs.composed.parts import queue_part
from jobs.spec import ReportSpec, parse_spec


class Reports(Composer):
    """Starts the evaluations of the open reports, and writes their pages."""

    kind = "report"

    def _advance(self, store: Store, job: JobRecord) -> None:
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
            part = newest.get(tested)
            key = f"{job.id}-{job.attempt}-{file}"  # a failed part is repeated by a new attempt
            if part is not None and not part.is_final:
                active += 1
            elif part and (part.state == "succeeded" or part.idempotency_key == key):
                ended[file] = part
            elif active < spec.parallel:
                name = f"report {job.number}, {file}"
                queue_part(store, job, number, name, key, _evaluation(spec, *tested))
                active += 1
        composed_jobs.record(store, job.id, len(ended), {})
        if len(ended) == len(wanted):
            try:
                result = _written(ended)
            except (OSError, ValueError, KeyError) as error:
                self._fail(store, job, f"the page could not be written: {error!r}")
            else:
                lacking: EarlyEnd | None = "failed parts" if result["failed"] else None
                composed_jobs.end(store, job.id, "succeeded", result=result, ended_by=lacking)


def _evaluation(spec: ReportSpec, protocol: str, checkpoint: str | None) -> dict[str, Any]:
    episodes = spec.episodes and min(spec.episodes, most_episodes(protocol))
    body = {"kind": "evaluate", "protocol": protocol, "checkpoint": checkpoint}
    return {**body, "episodes": episodes, "seed": spec.seed}


def _written(ended: Mapping[str, JobRecord]) -> dict[str, Any]:
    """Return the result of a report: its page and the missing measures."""
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
