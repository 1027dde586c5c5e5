"""Operations with the tag jobs; written by ``make client``."""

from collections.abc import Iterator, Mapping
from typing import Any, Literal

from app.api.schemas.jobs import JobList, JobPublic, MetricsPublic
from app.api.schemas.presets import PresetList
from app.api.schemas.protocols import ProtocolList
from app.client.transport import StreamEvent, Transport
from jobs.job_changes import Budget, JobChanges
from jobs.spec import EvaluateSpec, ReportSpec, SweepSpec, TrainSpec


class JobsOperations(Transport):
    """Operations with the tag jobs."""

    def create_job(
        self,
        body: TrainSpec | EvaluateSpec | SweepSpec | ReportSpec | Mapping[str, Any],
        *,
        idempotency_key: str | None = None,
    ) -> JobPublic:
        """Post a job."""
        return self._parsed(
            JobPublic, "POST /v1/jobs", body=body, headers={"idempotency-key": idempotency_key}
        )

    def list_jobs(
        self,
        *,
        cursor: str | None = None,
        limit: int | None = None,
        state: Literal["queued", "running", "cancelling", "succeeded", "failed", "cancelled"]
        | None = None,
        part_of: str | None = None,
        kind: Literal["train", "evaluate", "sweep", "report"] | None = None,
        preset: str | None = None,
    ) -> JobList:
        """List the jobs."""
        return self._parsed(
            JobList,
            "GET /v1/jobs",
            query={
                "cursor": cursor,
                "limit": limit,
                "state": state,
                "part_of": part_of,
                "kind": kind,
                "preset": preset,
            },
        )

    def get_job(self, job_id: str) -> JobPublic:
        """One job."""
        return self._parsed(JobPublic, "GET /v1/jobs/{}", job_id)

    def update_job(self, job_id: str, body: JobChanges | Mapping[str, Any]) -> JobPublic:
        """Change name, notes, priority or budgets of a job."""
        return self._parsed(JobPublic, "PATCH /v1/jobs/{}", job_id, body=body)

    def delete_job(self, job_id: str) -> None:
        """Delete an ended job."""
        self._send("DELETE /v1/jobs/{}", job_id)

    def get_job_metrics(
        self, job_id: str, *, after_step: int | None = None, limit: int | None = None
    ) -> MetricsPublic:
        """A job's learning curve."""
        return self._parsed(
            MetricsPublic,
            "GET /v1/jobs/{}/metrics",
            job_id,
            query={"after_step": after_step, "limit": limit},
        )

    def get_job_log(self, job_id: str, *, tail: int | None = None) -> str:
        """A job's output."""
        return self._send("GET /v1/jobs/{}/log", job_id, query={"tail": tail}).text

    def stream_job(
        self, job_id: str, *, last_event_id: int | None = None
    ) -> Iterator[StreamEvent]:
        """Follow a job as it runs."""
        return self._events(
            "/v1/jobs/{}/events", job_id, headers={"last-event-id": last_event_id}
        )

    def cancel_job(self, job_id: str) -> JobPublic:
        """Cancel a job."""
        return self._parsed(JobPublic, "POST /v1/jobs/{}/cancel", job_id)

    def resume_job(
        self, job_id: str, body: Budget | Mapping[str, Any] | None = None
    ) -> JobPublic:
        """Resume an ended job."""
        return self._parsed(JobPublic, "POST /v1/jobs/{}/resume", job_id, body=body)

    def retry_job(self, job_id: str, *, idempotency_key: str | None = None) -> JobPublic:
        """Run a cancelled or failed job again."""
        return self._parsed(
            JobPublic,
            "POST /v1/jobs/{}/retry",
            job_id,
            headers={"idempotency-key": idempotency_key},
        )

    def clone_job(
        self, job_id: str, body: Mapping[str, Any], *, idempotency_key: str | None = None
    ) -> JobPublic:
        """Start a job like another, with changes."""
        return self._parsed(
            JobPublic,
            "POST /v1/jobs/{}/clone",
            job_id,
            body=body,
            headers={"idempotency-key": idempotency_key},
        )

    def list_presets(self) -> PresetList:
        """List the presets."""
        return self._parsed(PresetList, "GET /v1/presets")

    def list_protocols(self) -> ProtocolList:
        """List the protocols."""
        return self._parsed(ProtocolList, "GET /v1/protocols")
