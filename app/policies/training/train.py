"""The one training path: from a preset and a seed to checkpoints.

Stable-Baselines3's ``learn`` runs the loop; a callback reports progress and checkpoints on a
fixed grid of environment steps and stops the training. A resumed run first refills its replay
buffer with the restored policy; these steps are not counted. Parts of the scenarios are in
``pick.py``, ``reach.py`` and ``sorting.py``.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext

import torch

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.configs.pick import PickPreset
from app.policies.configs.presets import Preset
from app.policies.configs.reach import ReachPreset
from app.policies.configs.sorting import SortingPreset
from app.policies.training import (
    pick as pick_training,
)
from app.policies.training import (
    reach as reach_training,
)
from app.policies.training import (
    sorting as sorting_training,
)
from app.policies.training.progress import Progress, TrainResult
from app.policies.training.reporter import Callbacks, Reporter
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


def _keeps_precision(preset: Preset) -> bool:
    """Return whether products are not rounded: ten layers lose small differences otherwise."""
    return isinstance(preset, ReachPreset) and preset.networks.actor == "ddpg"


def train(
    preset: Preset,
    *,
    seed: int,
    resume: Checkpoint | None,
    on_progress: Callable[[Progress], None],
    on_checkpoint: Callable[[int, Checkpoint, Checkpoint], None],
    should_stop: Callable[[], bool],
    cell: Cell | None = None,
) -> TrainResult:
    """Train a preset, from the start or from where an attempt was interrupted.

    Args:
        preset: All hyper-parameters.
        seed: Seed of everything random.
        resume: The last ``resume`` checkpoint of an interrupted attempt.
        on_progress: Called every ``progress_steps``.
        on_checkpoint: Called every ``checkpoint_steps`` and at the end or stop with the step,
            the policy and what resuming needs.
        should_stop: Asked after every step of the cells, so it must be cheap.
        cell: The work cell that the preset names; by default the shipped one of that name.

    Raises:
        CheckpointMismatch: ``resume`` belongs to another preset, cell or program.
        InvalidInput: The cell cannot be trained in.
        SimulationError: A reward was not finite.
    """
    torch.set_flush_denormal(True)  # Adam's moments of rare inputs fade into slow numbers
    place = cell or load_cell(preset.cell)
    calls = Callbacks(on_progress, on_checkpoint, should_stop)
    reporter: Reporter
    if isinstance(preset, SortingPreset):
        run, model = sorting_training.start(preset, seed, resume, place)
        reporter = sorting_training.SortingReporter(run, calls, model)
    elif isinstance(preset, ReachPreset):
        run, monitor = reach_training.start(preset, seed, resume, place)
        reporter = reach_training.ReachReporter(run, calls, monitor)
    else:
        run, monitor = pick_training.start(preset, seed, resume, place)
        reporter = pick_training.PickReporter(run, calls, monitor)
    with nullcontext() if _keeps_precision(preset) else _bfloat16_products():
        if resume is not None:
            run.refill()
        left = preset.learning.total_steps - run.step
        if left > 0:
            run.model.learn(left, callback=reporter, reset_num_timesteps=resume is None)
    policy, state = run.checkpoints()
    if not reporter.stopped and isinstance(preset, PickPreset):
        pick_training.add_outcomes(run, preset, seed, place, policy)
        policy, _ = run.checkpoints()
        on_checkpoint(run.step, policy, state)
    elif run.step % preset.learning.checkpoint_steps:
        on_checkpoint(run.step, policy, state)
    return TrainResult(checkpoint=policy, step=run.step, stopped=reporter.stopped)
