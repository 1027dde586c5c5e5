"""The one training path: from a preset and a seed to checkpoints.

Progress and checkpoints are reported on a fixed grid of environment steps, between two
complete steps. A training that is resumed from its last state ends with the same bits as one
that was not interrupted (``state.py``). Parts of the scenarios are in ``pick.py``, ``reach.py``
and ``sorting.py``.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext

import torch

from app.policies.configs.pick import PickPreset
from app.policies.configs.presets import Preset
from app.policies.configs.reach import ReachPreset
from app.policies.configs.sorting import SortingPreset
from app.policies.training import pick, reach, sorting
from app.policies.training.memory_files import MemoryFiles
from app.policies.training.progress import Progress, TrainResult
from app.policies.training.reporter import Callbacks, Reporter
from app.policies.training.run import OnCheckpoint, TrainingRun
from app.policies.training.state import TrainingState
from app.sim.cells.cell import Cell, load_cell


@contextmanager
def _bfloat16_products() -> Iterator[None]:
    """Round the factors of matrix products to bfloat16 where the processor has it: faster."""
    before = torch.get_float32_matmul_precision()
    torch.set_float32_matmul_precision("medium")
    try:
        yield
    finally:
        torch.set_float32_matmul_precision(before)


@contextmanager
def without_denormals() -> Iterator[None]:
    """Round denormal numbers, into which Adam's moments of rare inputs fade, to 0: faster."""
    torch.set_flush_denormal(True)
    try:
        yield
    finally:
        torch.set_flush_denormal(False)


def _keeps_precision(preset: Preset) -> bool:
    """Return whether products are not rounded.

    Ten layers lose small differences otherwise, and raw states have no common unit.
    """
    if isinstance(preset, ReachPreset):
        return preset.networks.actor == "ddpg"
    return isinstance(preset, PickPreset) and preset.networks.actor == "plain"


def train(
    preset: Preset,
    *,
    seed: int,
    on_progress: Callable[[Progress], None],
    on_checkpoint: OnCheckpoint,
    should_stop: Callable[[], bool],
    cell: Cell | None = None,
    memory: MemoryFiles | None = None,
    resume: TrainingState | None = None,
) -> TrainResult:
    """Train a preset, from the start or from where an attempt was interrupted.

    Args:
        seed: Seed of everything random.
        on_progress: Called every ``progress_steps``.
        on_checkpoint: Called every ``checkpoint_steps`` and at the end or stop with the step,
            the policy and the state to resume from.
        should_stop: Called after every step of the environments, also of those that follow the
            training of a pick policy and fit its outcome probabilities, so it must be cheap.
        cell: The work cell that the preset names; by default the shipped one of that name.
        memory: Files of the replay memory; None if no states are wanted.
        resume: The last state of an interrupted attempt; needs ``memory``.

    Raises:
        CheckpointMismatch: ``resume`` belongs to another configuration, seed, cell or program.
        Damaged: A file of ``memory`` is missing or changed.
        InvalidInput: The cell cannot be trained in, or the networks fit into no checkpoint.
        SimulationError: A reward was not finite.
    """
    place = cell or load_cell(preset.cell)
    calls = Callbacks(on_progress, on_checkpoint, should_stop)
    with without_denormals():
        run, reporter = start(preset, seed, place, calls)
        run.policy()  # refuses networks that no checkpoint can hold before the first step
        if memory is not None:
            run.keep_states(memory)
        if resume is not None:
            run.restore(resume)
        with nullcontext() if _keeps_precision(preset) else _bfloat16_products():
            stopped = run.learn(reporter, reporter.report)
        completed = False
        if not stopped and isinstance(preset, PickPreset) and preset.predicts_outcomes:
            completed = pick.add_outcomes(run, preset, should_stop)
            stopped = not completed
        if completed or run.step % preset.learning.checkpoint_steps:
            run.save(on_checkpoint)
        return TrainResult(checkpoint=run.policy(), step=run.step, stopped=stopped)


def start(
    preset: Preset, seed: int, cell: Cell, calls: Callbacks
) -> tuple[TrainingRun, Reporter]:
    """Return a training that has not started yet, with all parts of its state, and its reports.

    Args:
        seed: Seed of everything random.
        cell: Work cell trained in.
        calls: Receivers of the reports.
    """
    reporter: Reporter
    if isinstance(preset, SortingPreset):
        run, model = sorting.start(preset, seed, cell)
        reporter = sorting.SortingReporter(run, calls, model)
    elif isinstance(preset, ReachPreset):
        run, monitor = reach.start(preset, seed, cell)
        reporter = reach.ReachReporter(run, calls, monitor)
    else:
        run, monitor = pick.start(preset, seed, cell)
        reporter = pick.PickReporter(run, calls, monitor)
    run.state_parts["reporter"] = reporter
    return run, reporter
