"""Entry point of a job's process: ``python -m jobs.run --job ID --attempt N``.

Executors start it. Settings come from the environment, the spec from the job's row.
``jobs.remote.run`` is the entry point on another machine. Both import the learning libraries.
"""

import logging
import sys
from collections.abc import Callable, Mapping
from dataclasses import asdict
from functools import partial
from typing import Any

import torch

from app.errors import CheckpointMismatch, Damaged, InvalidInput
from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.configs import presets
from app.policies.evaluation.registry import WITHOUT_CHECKPOINT
from app.policies.evaluation.registry import evaluate as run_protocol
from app.policies.evaluation.rows import Row
from app.policies.training import state as states
from app.policies.training.memory_files import MemoryFiles
from app.policies.training.progress import Progress
from app.policies.training.state import TrainingState
from app.policies.training.train import train as train_policy
from app.settings import Settings, load_settings
from app.store.records import Claim, ResumeState
from jobs.access import open_access
from jobs.attempt import Connected, run_attempt
from jobs.checkpoints import to_store
from jobs.inputs import JobInputs, StoreInputs
from jobs.spec import EvaluateSpec, parse_spec
from jobs.worker import JobWorker, Runner

logger = logging.getLogger(__name__)


def train(inputs: JobInputs, worker: JobWorker) -> dict[str, Any]:
    """Train the job's preset, from the start or from the last checkpoint."""
    job = worker.job
    assert job.preset is not None
    memory = MemoryFiles(inputs.memory, worker.wait_to)
    state = worker.resume(partial(usable, memory))
    resume = None if state is None else states.load(dict(state.manifest), state.tensors)

    def on_progress(progress: Progress) -> None:
        values = asdict(progress)
        step, total_steps = values.pop("step"), values.pop("total_steps")
        worker.record_progress(step, values, total_steps=total_steps)

    saved: list[str] = []

    def on_checkpoint(step: int, policy: Checkpoint, state: TrainingState | None) -> None:
        assert state is not None
        resume = ResumeState(step=step, manifest=state.manifest, tensors=state.tensors)
        worker.record_checkpoint(step, to_store(policy), resume)
        saved.append(policy.sha256)

    preset = presets.resolve(job.preset, job.overrides)
    result = train_policy(
        preset,
        seed=job.seed,
        memory=memory,
        resume=resume,
        on_progress=on_progress,
        on_checkpoint=on_checkpoint,
        should_stop=worker.should_stop,
        cell=inputs.cell(preset),
    )
    if not saved:  # interrupted between the last checkpoint and the end
        worker.record_checkpoint(result.step, to_store(result.checkpoint), None)
        saved.append(result.checkpoint.sha256)
    return {"checkpoint": saved[-1], "step": result.step}


def usable(memory: MemoryFiles, stored: ResumeState) -> bool:
    """Return whether a state is of this program's format and its files are undamaged."""
    try:
        state = states.load(dict(stored.manifest), stored.tensors)
        memory.check(state.manifest["memory"])
    except (CheckpointMismatch, Damaged, InvalidInput) as error:
        logger.warning("the state at step %d cannot be used: %s", stored.step, error)
        return False
    return True


def evaluate(inputs: JobInputs, worker: JobWorker) -> dict[str, Any]:
    """Evaluate the job's checkpoint by its protocol; a step is a row of the result."""
    worker.end_at_sigterm()
    spec = parse_spec(worker.job.spec)
    assert isinstance(spec, EvaluateSpec)
    tested = None
    if spec.protocol not in WITHOUT_CHECKPOINT:
        reference = worker.job.checkpoint or spec.checkpoint  # queued before migration 0013
        assert reference is not None
        tested = inputs.checkpoint(reference)

    def on_row(done: int, total: int, row: Row) -> None:
        worker.record_progress(done, _rates(row), total_steps=total)

    return run_protocol(
        spec.protocol,
        tested,
        episodes=spec.episodes,
        seed=spec.seed,
        motions=inputs.motions(spec.recordings),
        on_row=on_row,
    )


def _rates(row: Row) -> dict[str, float | None]:
    """Return the rates of a row by name, without their intervals and without other fields."""
    given = {name: one for name, one in row.items() if isinstance(one, Mapping)}
    return {name: one["mean"] for name, one in given.items() if "mean" in one}


def runners(inputs: JobInputs) -> Mapping[str, Runner]:
    """Return the runner of each kind of job."""
    return {"train": partial(train, inputs), "evaluate": partial(evaluate, inputs)}


def connect(settings: Settings, claim: Claim) -> Connected:
    """Open the database for an attempt."""
    access = open_access(settings.database, settings.data, claim)
    return access, runners(StoreInputs(access.store, settings.data, claim.job_id))


def main(connect: Callable[[Settings, Claim], Connected] = connect) -> int:
    """Run the attempt of the command line with the settings of the environment."""
    torch.set_num_threads(1)
    settings = load_settings()
    return run_attempt(partial(connect, settings), settings.log)


if __name__ == "__main__":
    sys.exit(main())
