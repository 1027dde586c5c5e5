"""A training of seconds as a job, and its result where nothing disturbs it."""

import os
import signal
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.policies.configs.presets import nested
from app.store import checkpoints, jobs
from app.store.engine import Store
from app.store.records import JobRecord
from jobs.access import StoreAccess
from jobs.inputs import StoreInputs
from jobs.run import runners
from jobs.spec import parse_spec
from jobs.worker import JobWorker
from tests.jobs.machinery import wait_for, wait_until_final, worker_pids
from tests.support.databases import claimed

TINY = {
    "learning.total_steps": 2048,
    "learning.n_envs": 8,
    "learning.progress_steps": 128,
    "learning.checkpoint_steps": 512,
    "learning.learning_starts": 512,
    "learning.buffer_size": 2000,
    "learning.batch_size": 16,
    "networks.width": 16,
}
"""Nothing is learned by so little; everything is run through."""


@dataclass(frozen=True)
class Made:
    """What a training made."""

    result: dict[str, Any] | None
    checkpoints: list[tuple[int | None, str]]
    """Steps and digests, the newest first."""


def train(store: Store, step_budget: int | None = None, **overrides: float | str) -> str:
    """Post a training; returns the job's id."""
    fields = nested(TINY | overrides)
    body = {"kind": "train", "preset": "pick-td3", "seed": 4, "overrides": fields}
    body["step_budget"] = step_budget
    return jobs.create_job(store, parse_spec(body).new_job()).id


def run_here(store: Store, folder: Path) -> JobRecord:
    """Run the next job in this process, as ``jobs.run`` does in one of its own."""
    claim, job = claimed(store)
    run = runners(StoreInputs(store, folder, job.id))[job.kind]
    assert JobWorker(StoreAccess(store, folder, claim)).execute(run) == 0
    for beat in (one for one in threading.enumerate() if one.name == "beat"):
        beat.join()  # a process would end it
    return jobs.get_job(store, job.id)


def killed_midway(store: Store, folder: Path) -> JobRecord:
    """Post a training, kill its process when it has states; return the job at its end."""
    job_id = train(store)
    wait_for(store, job_id, lambda job: job.step >= 640)
    (pid,) = worker_pids(os.getpid())
    os.kill(pid, signal.SIGKILL)
    assert any((folder / "resume" / job_id).iterdir())
    return wait_until_final(store, job_id)


def made_by(store: Store, job_id: str) -> Made:
    """Return what a job made."""
    items = checkpoints.list_checkpoints(store, job_id=job_id).items
    return Made(jobs.get_job(store, job_id).result, [(one.step, one.sha256) for one in items])


def made_undisturbed(store: Store, folder: Path) -> Made:
    """Run the training in this process to its end."""
    train(store)
    job = run_here(store, folder)
    made = made_by(store, job.id)
    assert job.state == "succeeded" and len(made.checkpoints) == 4
    return made
