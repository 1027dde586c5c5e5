"""A worker whose jobs count: deterministic, resumable, quick; the machinery around it is real.

Overrides of a counting job: ``steps`` (to do), ``hold_at`` (list: attempt n waits at the n-th
of these steps until it is stopped or killed), ``deaf`` (it never asks whether to stop),
``at_once`` (it ends at SIGTERM, as evaluations do), ``raise_at`` (raises an exception at that
step), ``refuse_at`` (the same with an InvalidInput), ``padding`` (extra bytes per checkpoint),
``max_pages`` (a file with the size limit of the database in this process [pages], read at each
transaction).
"""

import os
import random
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import sqlalchemy as sa
from sqlalchemy import event

from app.digests import digest
from app.errors import InvalidInput
from app.store.records import Claim, NewCheckpoint, ResumeState
from jobs.access import JobAccess, StoreAccess, open_access
from jobs.attempt import run_attempt
from jobs.worker import JobWorker, Runner

GRID = 5
CHECKPOINT_EVERY = 20
FACTOR, MODULUS = 48271, 2**31 - 1


def count(worker: JobWorker) -> dict[str, int]:
    """Step a random-number generator ``steps`` times; progress every GRID steps."""
    wish = worker.job.overrides
    limit_database(worker, wish.get("max_pages"))
    if wish.get("at_once"):
        worker.end_at_sigterm()
    resume = worker.resume()
    step, value = (0, 1 + worker.job.seed) if resume is None else load(resume)
    while step < wish["steps"] and not asked_to_stop(worker):
        step, value = step + 1, value * FACTOR % MODULUS
        misbehave(wish, step)
        if step % GRID == 0:
            worker.record_progress(step, {"value": value}, total_steps=wish["steps"])
        if step % CHECKPOINT_EVERY == 0:
            save(worker, step, value)
        hold(worker, step)
    if step % CHECKPOINT_EVERY:
        save(worker, step, value)
    return {"value": value}


def load(resume: ResumeState) -> tuple[int, int]:
    return resume.step, int.from_bytes(resume.tensors[:8], "big")


def save(worker: JobWorker, step: int, value: int) -> None:
    padding = random.Random(step).randbytes(worker.job.overrides.get("padding", 0))
    tensors = value.to_bytes(8, "big") + padding  # which no database can compress
    manifest = {"job": worker.job.id, "step": step}
    sha256 = digest(manifest, tensors)
    policy = NewCheckpoint(sha256=sha256, manifest=manifest, tensors=tensors)
    worker.record_checkpoint(step, policy, ResumeState(step=step, manifest={}, tensors=tensors))


def asked_to_stop(worker: JobWorker) -> bool:
    return not worker.job.overrides.get("deaf") and worker.should_stop()


def hold(worker: JobWorker, step: int) -> None:
    steps = worker.job.overrides.get("hold_at", [])
    attempt = worker.job.attempt
    while steps[attempt - 1 : attempt] == [step] and not asked_to_stop(worker):
        time.sleep(0.01)


def misbehave(wish: Mapping[str, Any], step: int) -> None:
    if step == wish.get("raise_at"):
        raise RuntimeError(f"deliberate crash at step {step}")
    if step == wish.get("refuse_at"):
        raise InvalidInput("refuse_at", step, "must not be reached")


def limit_database(worker: JobWorker, max_pages: str | None) -> None:
    if max_pages is None:
        return

    assert isinstance(worker.access, StoreAccess)

    def limit(connection: sa.Connection) -> None:
        pages = int(Path(max_pages).read_text())
        connection.exec_driver_sql(f"PRAGMA max_page_count = {pages}")

    event.listen(worker.access.store.engine, "begin", limit, insert=True)


def connect(claim: Claim) -> tuple[JobAccess, Mapping[str, Runner]]:
    data_dir = Path(os.environ["TANDEM_DATA"])
    access = open_access(os.environ["TANDEM_DATABASE_URL"], data_dir, claim)
    return access, {"count": count}


def main() -> int:
    return run_attempt(connect)
