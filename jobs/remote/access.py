"""Access of a worker to its job by the service."""

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict
from hashlib import sha256
from typing import Any

from pydantic import TypeAdapter

from app.store.records import JobRecord, NewCheckpoint, ResumeState
from jobs.access import EndOfAttempt
from jobs.remote.connection import ServiceConnection
from jobs.remote.uploads import pack_upload, read_state

_JOB = TypeAdapter(JobRecord)


class ServiceAccess:
    """Access by the routes of the service; see :class:`jobs.access.JobAccess`."""

    def __init__(self, service: ServiceConnection) -> None:
        self._service = service

    def job(self) -> JobRecord:
        """Return the job."""
        return _record(self._service.send("GET", self._service.attempt).content)

    def heartbeat(self, waiting: str | None, run_s: float) -> JobRecord:
        """Record a heartbeat and return the job."""
        return _record(self._send("heartbeat", {"waiting": waiting, "run_s": run_s}))

    def load_resume(self, usable: Callable[[ResumeState], bool]) -> ResumeState | None:
        """Return the newest undamaged and usable state."""
        query: dict[str, int] = {}
        path = f"{self._service.attempt}/state"
        while (content := self._service.find(path, query)) is not None:
            state = read_state(content)
            if usable(state):
                return state
            query = {"below": state.step}
        return None

    def resume_earlier(self, step: int | None) -> None:
        """Start from an earlier state."""
        self._send("start", {"step": step})

    def record_progress(
        self, step: int, values: Mapping[str, float | None], total_steps: int | None
    ) -> None:
        """Add a point to the job's curve."""
        body = {"step": step, "values": dict(values), "total_steps": total_steps}
        self._send("progress", body)

    def record_checkpoint(
        self, step: int, policy: NewCheckpoint, resume: ResumeState | None
    ) -> None:
        """Store a policy and the state to resume from."""
        content, policy_bytes = pack_upload(policy, resume)
        query = {
            "step": step,
            "policy_bytes": policy_bytes,
            "sha256": sha256(content).hexdigest(),
        }
        path = f"{self._service.attempt}/checkpoints"
        self._service.send("POST", path, query=query, content=content)

    def end(self, end: EndOfAttempt) -> None:
        """End the attempt."""
        self._send("end", asdict(end))

    def _send(self, action: str, body: Mapping[str, Any]) -> bytes:
        path = f"{self._service.attempt}/{action}"
        return self._service.send("POST", path, body=body).content


def _record(answer: bytes) -> JobRecord:
    found = json.loads(answer)
    names = JobRecord.__dataclass_fields__
    members = {name: found.get(name) for name in names}
    return _JOB.validate_python(members)
