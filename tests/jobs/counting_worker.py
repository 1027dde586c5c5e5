"""A worker whose jobs count: deterministic, resumable, quick; the machinery around it is real.

Overrides of a counting job: ``steps`` (to do), ``pace_s`` (pause per step), ``die_at`` (SIGKILL
itself on reaching that step from below, once per attempt that starts below it), ``raise_at``
(the same with an exception), ``deaf`` (never asks whether to stop), ``max_pages`` (size limit
of the database in this process).
"""

import hashlib
import os
import signal
import sys
import time

from sqlalchemy import event

from app.errors import InvalidInput
from app.store.records import NewCheckpoint, ResumeState
from jobs.run import main
from jobs.worker import Worker

GRID = 5
CHECKPOINT_EVERY = 20
FACTOR, MODULUS = 48271, 2**31 - 1


def count(worker: Worker) -> dict[str, int]:
    """Step a random-number generator ``steps`` times; progress every GRID steps."""
    wish = worker.job.overrides
    limit_database(worker, wish.get("max_pages"))
    resume = worker.resume()
    step, value = (0, 1 + worker.job.seed) if resume is None else load(resume)
    while step < wish["steps"] and (wish.get("deaf") or not worker.should_stop()):
        step, value = step + 1, value * FACTOR % MODULUS
        misbehave(worker, step)
        time.sleep(wish.get("pace_s", 0.0))
        if step % GRID == 0:
            worker.record_progress(step, {"value": value}, total_steps=wish["steps"])
        if step % CHECKPOINT_EVERY == 0:
            save(worker, step, value)
    if step % CHECKPOINT_EVERY:
        save(worker, step, value)
    return {"value": value}


def load(resume: ResumeState) -> tuple[int, int]:
    return resume.step, int.from_bytes(resume.tensors[:8], "big")


def save(worker: Worker, step: int, value: int) -> None:
    tensors = value.to_bytes(8, "big") + bytes(worker.job.overrides.get("padding", 0))
    manifest = {"job": worker.job.id, "step": step}
    sha256 = hashlib.sha256(f"{manifest}".encode() + tensors).hexdigest()
    policy = NewCheckpoint(sha256=sha256, manifest=manifest, tensors=tensors)
    worker.record_checkpoint(step, policy, ResumeState(step=step, manifest={}, tensors=tensors))


def misbehave(worker: Worker, step: int) -> None:
    wish = worker.job.overrides
    if step == wish.get("die_at"):
        os.kill(os.getpid(), signal.SIGKILL)
    if step == wish.get("raise_at"):
        raise RuntimeError(f"deliberate crash at step {step}")
    if step == wish.get("refuse_at"):
        raise InvalidInput("refuse_at", step, "must not be reached")


def limit_database(worker: Worker, max_pages: int | None) -> None:
    if max_pages is None:
        return
    engine = worker.store.engine
    engine.dispose()
    event.listen(
        engine, "connect", lambda c, _: c.execute(f"PRAGMA max_page_count = {max_pages}")
    )


if __name__ == "__main__":
    sys.exit(main(runners={"count": count}))
