"""The one entry point that runs a job: ``python -m jobs.run --job ID --attempt N``.

Started by an executor, never by hand. Settings come from the environment, what to do from the
job's row. This is the only module of ``jobs`` that imports learning libraries.
"""

import sys
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import torch

from app.policies import checkpoint as formats
from app.policies import presets
from app.policies.checkpoint import Checkpoint
from app.policies.training import Progress
from app.policies.training import train as train_policy
from app.store.records import NewCheckpoint, ResumeState
from jobs.attempt import main
from jobs.worker import Runner, Worker


def train(worker: Worker) -> dict[str, Any]:
    """Train the job's preset, from the start or from the last checkpoint."""
    job = worker.job
    assert job.preset is not None
    state = worker.resume()
    resume = None if state is None else formats.load(dict(state.manifest), state.tensors)

    def on_progress(progress: Progress) -> None:
        values = asdict(progress)
        step, total_steps = values.pop("step"), values.pop("total_steps")
        worker.record_progress(step, values, total_steps=total_steps)

    saved: list[str] = []

    def on_checkpoint(step: int, policy: Checkpoint, state: Checkpoint) -> None:
        resume = ResumeState(step=step, manifest=state.manifest, tensors=state.tensors)
        worker.record_checkpoint(step, _new(policy), resume)
        saved.append(policy.sha256)

    result = train_policy(
        presets.resolve(job.preset, job.overrides),
        seed=job.seed,
        resume=resume,
        on_progress=on_progress,
        on_checkpoint=on_checkpoint,
        should_stop=worker.should_stop,
    )
    if not saved:  # interrupted between the last checkpoint and the end
        worker.record_checkpoint(result.step, _new(result.checkpoint), None)
        saved.append(result.checkpoint.sha256)
    return {"checkpoint": saved[-1], "step": result.step}


def _new(policy: Checkpoint) -> NewCheckpoint:
    return NewCheckpoint(sha256=policy.sha256, manifest=policy.manifest, tensors=policy.tensors)


RUNNERS: Mapping[str, Runner] = {"train": train}
"""How each kind of job is run."""


if __name__ == "__main__":
    torch.set_num_threads(1)
    sys.exit(main(RUNNERS))
