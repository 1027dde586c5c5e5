"""One method per operation of the OpenAPI document; written by ``make client``.

Bodies are the service's own schemas, or mappings of their JSON. A problem raises ``Refused``.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal
from urllib.parse import quote

from app.api.routes.health import HealthPublic, ReadinessPublic
from app.api.schemas.cells import CellList, CellPublic
from app.api.schemas.checkpoints import (
    Alias,
    AliasList,
    AliasTarget,
    CheckpointList,
    CheckpointPublic,
)
from app.api.schemas.comparison import ComparisonPublic
from app.api.schemas.evaluations import EvaluationList, EvaluationPublic
from app.api.schemas.jobs import JobList, JobPublic, MetricsPublic
from app.api.schemas.motion import MotionAnswer, MotionRequest
from app.api.schemas.plan import PlanAnswer, PlanRequest
from app.api.schemas.presets import PresetList
from app.api.schemas.recordings import RecordingList, RecordingPublic
from app.api.schemas.risk_map import RiskMapAnswer, RiskMapRequest
from app.api.schemas.sorting import SortingAnswer, SortingRequest
from app.api.schemas.task_selection import TaskSelection, TaskSelectionRequest
from app.api.schemas.trackers import (
    EstimatesPublic,
    FrameCreate,
    TrackerCreate,
    TrackerList,
    TrackerPublic,
)
from app.api.schemas.worlds import CommandAccepted, WorldCell, WorldList, WorldSummary
from app.client.transport import StreamEvent, Transport
from app.live.commands import LiveCommand
from jobs.spec import Budget, EvaluateSpec, JobChanges, TrainSpec


class Client(Transport):
    """The operations of a server."""

    def select_task(self, body: TaskSelectionRequest | Mapping[str, Any]) -> TaskSelection:
        """Choose what the robot does next."""
        return self._parsed(TaskSelection, self._send("POST", "/v1/task-selection", body=body))

    def choose_sorting_move(self, body: SortingRequest | Mapping[str, Any]) -> SortingAnswer:
        """Choose the next move of a sorting task."""
        return self._parsed(SortingAnswer, self._send("POST", "/v1/sorting", body=body))

    def plan_move(self, body: PlanRequest | Mapping[str, Any]) -> PlanAnswer:
        """Choose the next move of a sorting task and its motion."""
        return self._parsed(PlanAnswer, self._send("POST", "/v1/plan", body=body))

    def map_risk(self, body: RiskMapRequest | Mapping[str, Any]) -> RiskMapAnswer:
        """Choose beside a person at each position of a grid."""
        return self._parsed(RiskMapAnswer, self._send("POST", "/v1/risk-map", body=body))

    def decide_motion(self, body: MotionRequest | Mapping[str, Any]) -> MotionAnswer:
        """Decide how the robot moves next."""
        return self._parsed(MotionAnswer, self._send("POST", "/v1/motion", body=body))

    def list_trackers(self) -> TrackerList:
        """List the trackers."""
        return self._parsed(TrackerList, self._send("GET", "/v1/trackers"))

    def create_tracker(self, body: TrackerCreate | Mapping[str, Any]) -> TrackerPublic:
        """Open a tracker."""
        return self._parsed(TrackerPublic, self._send("POST", "/v1/trackers", body=body))

    def submit_frame(
        self, tracker_id: str, body: FrameCreate | Mapping[str, Any]
    ) -> EstimatesPublic:
        """Submit a frame."""
        return self._parsed(
            EstimatesPublic,
            self._send("POST", f"/v1/trackers/{quote(tracker_id, safe='')}/frames", body=body),
        )

    def get_tracker(self, tracker_id: str, *, t: float | None = None) -> EstimatesPublic:
        """Estimates of a tracker's people."""
        return self._parsed(
            EstimatesPublic,
            self._send("GET", f"/v1/trackers/{quote(tracker_id, safe='')}", query={"t": t}),
        )

    def delete_tracker(self, tracker_id: str) -> None:
        """Delete a tracker."""
        self._send("DELETE", f"/v1/trackers/{quote(tracker_id, safe='')}")

    def list_worlds(self) -> WorldList:
        """List the live worlds."""
        return self._parsed(WorldList, self._send("GET", "/v1/worlds"))

    def get_world(self, world_id: str) -> dict[str, Any]:
        """One live world, with the state a decision needs."""
        return dict(self._send("GET", f"/v1/worlds/{quote(world_id, safe='')}").json())

    def command_world(
        self, world_id: str, body: LiveCommand | Mapping[str, Any]
    ) -> CommandAccepted:
        """Change a live world."""
        return self._parsed(
            CommandAccepted,
            self._send("POST", f"/v1/worlds/{quote(world_id, safe='')}/commands", body=body),
        )

    def stream_world(self, world_id: str) -> Iterator[StreamEvent]:
        """Stream a live world, ten times a second."""
        return self._events(f"/v1/worlds/{quote(world_id, safe='')}/events")

    def set_world_cell(
        self, world_id: str, body: WorldCell | Mapping[str, Any]
    ) -> WorldSummary:
        """Start a live world again in another cell."""
        return self._parsed(
            WorldSummary,
            self._send("PUT", f"/v1/worlds/{quote(world_id, safe='')}/cell", body=body),
        )

    def create_job(
        self,
        body: TrainSpec | EvaluateSpec | Mapping[str, Any],
        *,
        idempotency_key: str | None = None,
    ) -> JobPublic:
        """Post a job."""
        return self._parsed(
            JobPublic,
            self._send(
                "POST", "/v1/jobs", body=body, headers={"idempotency-key": idempotency_key}
            ),
        )

    def list_jobs(
        self,
        *,
        cursor: str | None = None,
        limit: int | None = None,
        state: Literal["queued", "running", "cancelling", "succeeded", "failed", "cancelled"]
        | None = None,
    ) -> JobList:
        """List the jobs."""
        return self._parsed(
            JobList,
            self._send(
                "GET", "/v1/jobs", query={"cursor": cursor, "limit": limit, "state": state}
            ),
        )

    def get_job(self, job_id: str) -> JobPublic:
        """One job."""
        return self._parsed(JobPublic, self._send("GET", f"/v1/jobs/{quote(job_id, safe='')}"))

    def update_job(self, job_id: str, body: JobChanges | Mapping[str, Any]) -> JobPublic:
        """Change name, notes, priority or budgets of a job."""
        return self._parsed(
            JobPublic, self._send("PATCH", f"/v1/jobs/{quote(job_id, safe='')}", body=body)
        )

    def delete_job(self, job_id: str) -> None:
        """Delete an ended job."""
        self._send("DELETE", f"/v1/jobs/{quote(job_id, safe='')}")

    def get_job_metrics(
        self, job_id: str, *, after_step: int | None = None, limit: int | None = None
    ) -> MetricsPublic:
        """A job's learning curve."""
        return self._parsed(
            MetricsPublic,
            self._send(
                "GET",
                f"/v1/jobs/{quote(job_id, safe='')}/metrics",
                query={"after_step": after_step, "limit": limit},
            ),
        )

    def stream_job(
        self, job_id: str, *, last_event_id: int | None = None
    ) -> Iterator[StreamEvent]:
        """Follow a job as it runs."""
        return self._events(
            f"/v1/jobs/{quote(job_id, safe='')}/events",
            headers={"last-event-id": last_event_id},
        )

    def cancel_job(self, job_id: str) -> JobPublic:
        """Cancel a job."""
        return self._parsed(
            JobPublic, self._send("POST", f"/v1/jobs/{quote(job_id, safe='')}/cancel")
        )

    def resume_job(
        self, job_id: str, body: Budget | Mapping[str, Any] | None = None
    ) -> JobPublic:
        """Resume an ended job."""
        return self._parsed(
            JobPublic,
            self._send("POST", f"/v1/jobs/{quote(job_id, safe='')}/resume", body=body),
        )

    def retry_job(self, job_id: str, *, idempotency_key: str | None = None) -> JobPublic:
        """Run a cancelled or failed job again."""
        return self._parsed(
            JobPublic,
            self._send(
                "POST",
                f"/v1/jobs/{quote(job_id, safe='')}/retry",
                headers={"idempotency-key": idempotency_key},
            ),
        )

    def clone_job(
        self, job_id: str, body: Mapping[str, Any], *, idempotency_key: str | None = None
    ) -> JobPublic:
        """Start a job like another, with changes."""
        return self._parsed(
            JobPublic,
            self._send(
                "POST",
                f"/v1/jobs/{quote(job_id, safe='')}/clone",
                body=body,
                headers={"idempotency-key": idempotency_key},
            ),
        )

    def get_comparison(
        self, *, job: Sequence[str], quantity: str | None = None
    ) -> ComparisonPublic:
        """Compare jobs."""
        return self._parsed(
            ComparisonPublic,
            self._send("GET", "/v1/comparison", query={"job": job, "quantity": quantity}),
        )

    def get_comparison_csv(self, *, job: Sequence[str]) -> str:
        """Download the curves of jobs."""
        return self._send("GET", "/v1/comparison/csv", query={"job": job}).text

    def list_all_evaluations(
        self,
        *,
        protocol: str | None = None,
        checkpoint: str | None = None,
        cursor: str | None = None,
        limit: int | None = None,
    ) -> EvaluationList:
        """List the evaluations."""
        return self._parsed(
            EvaluationList,
            self._send(
                "GET",
                "/v1/evaluations",
                query={
                    "protocol": protocol,
                    "checkpoint": checkpoint,
                    "cursor": cursor,
                    "limit": limit,
                },
            ),
        )

    def get_evaluation(self, job_id: str) -> EvaluationPublic:
        """One evaluation."""
        return self._parsed(
            EvaluationPublic, self._send("GET", f"/v1/evaluations/{quote(job_id, safe='')}")
        )

    def list_checkpoints(
        self, *, job_id: str | None = None, cursor: str | None = None, limit: int | None = None
    ) -> CheckpointList:
        """List the checkpoints."""
        return self._parsed(
            CheckpointList,
            self._send(
                "GET",
                "/v1/checkpoints",
                query={"job_id": job_id, "cursor": cursor, "limit": limit},
            ),
        )

    def upload_checkpoint(
        self, content: bytes, *, sha256: str | None = None
    ) -> CheckpointPublic:
        """Upload a checkpoint."""
        return self._parsed(
            CheckpointPublic,
            self._send("POST", "/v1/checkpoints", content=content, query={"sha256": sha256}),
        )

    def get_checkpoint(self, reference: str) -> CheckpointPublic:
        """One checkpoint, by SHA-256 or alias."""
        return self._parsed(
            CheckpointPublic, self._send("GET", f"/v1/checkpoints/{quote(reference, safe='')}")
        )

    def get_checkpoint_manifest(self, reference: str) -> dict[str, Any]:
        """A checkpoint's manifest."""
        return dict(
            self._send("GET", f"/v1/checkpoints/{quote(reference, safe='')}/manifest").json()
        )

    def get_checkpoint_tensors(self, reference: str) -> bytes:
        """Download a checkpoint's tensors."""
        return self._send("GET", f"/v1/checkpoints/{quote(reference, safe='')}/tensors").content

    def list_aliases(self) -> AliasList:
        """List the aliases."""
        return self._parsed(AliasList, self._send("GET", "/v1/aliases"))

    def get_alias(self, name: str) -> Alias:
        """One alias."""
        return self._parsed(Alias, self._send("GET", f"/v1/aliases/{quote(name, safe='')}"))

    def set_alias(self, name: str, body: AliasTarget | Mapping[str, Any]) -> Alias:
        """Point an alias to a checkpoint."""
        return self._parsed(
            Alias, self._send("PUT", f"/v1/aliases/{quote(name, safe='')}", body=body)
        )

    def remove_alias(self, name: str) -> None:
        """Remove an alias."""
        self._send("DELETE", f"/v1/aliases/{quote(name, safe='')}")

    def list_presets(self) -> PresetList:
        """List the presets."""
        return self._parsed(PresetList, self._send("GET", "/v1/presets"))

    def list_cells(self) -> CellList:
        """List the work cells."""
        return self._parsed(CellList, self._send("GET", "/v1/cells"))

    def create_cell(self, body: Mapping[str, Any]) -> CellPublic:
        """Add a work cell of your own."""
        return self._parsed(CellPublic, self._send("POST", "/v1/cells", body=body))

    def get_cell(self, name: str) -> CellPublic:
        """One work cell."""
        return self._parsed(CellPublic, self._send("GET", f"/v1/cells/{quote(name, safe='')}"))

    def delete_cell(self, name: str) -> None:
        """Remove a work cell of your own."""
        self._send("DELETE", f"/v1/cells/{quote(name, safe='')}")

    def list_recordings(self) -> RecordingList:
        """List the recordings."""
        return self._parsed(RecordingList, self._send("GET", "/v1/recordings"))

    def create_recording(
        self,
        content: bytes,
        *,
        file_name: str,
        name: str | None = None,
        unit: str | None = None,
        root_unit: str | None = None,
        up: str | None = None,
        map: Sequence[str] | None = None,
    ) -> RecordingPublic:
        """Import a recording."""
        return self._parsed(
            RecordingPublic,
            self._send(
                "POST",
                "/v1/recordings",
                content=content,
                query={
                    "file_name": file_name,
                    "name": name,
                    "unit": unit,
                    "root_unit": root_unit,
                    "up": up,
                    "map": map,
                },
            ),
        )

    def get_recording(self, name: str) -> RecordingPublic:
        """One recording."""
        return self._parsed(
            RecordingPublic, self._send("GET", f"/v1/recordings/{quote(name, safe='')}")
        )

    def delete_recording(self, name: str) -> None:
        """Remove a recording."""
        self._send("DELETE", f"/v1/recordings/{quote(name, safe='')}")

    def health(self) -> HealthPublic:
        """200 when the service can decide."""
        return self._parsed(HealthPublic, self._send("GET", "/healthz"))

    def ready(self) -> ReadinessPublic:
        """503 while the kernels are compiled."""
        return self._parsed(ReadinessPublic, self._send("GET", "/readyz"))

    def scrape(self) -> str:
        """Metrics for Prometheus."""
        return self._send("GET", "/metrics").text
