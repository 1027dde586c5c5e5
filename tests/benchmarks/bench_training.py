"""Rates of training on the sorting task: ours beside stock DQN on a plain environment.

    python -m app bench training [--json] [--warm 20] [--seconds 40]

tandem/sorting-e0-dqn  the trainer of the service with its preset: env-steps and updates
sb3-plain/sorting-e0   stock Stable-Baselines3 DQN on one plain environment (``stock_dqn.py``)
tandem/sorting-e0-env  the batched environment alone, random valid moves
tandem/sorting-e1-env  the same with 20 objects
gymnasium/sorting-e0   the plain environment alone, random moves

All in processor seconds of one thread. Trainers run ``--warm`` seconds first, at least until
updates have begun, and are counted for ``--seconds``, while moves are still mostly random; the
episodes that only draw the learning curve are left out. Rows of trainers come twice, as
env-steps and as updates.
"""

import torch
from stable_baselines3.common.base_class import BaseAlgorithm

from app.policies.configs import presets
from app.policies.configs.sorting import SortingPreset
from app.policies.training import sorting as sorting_training
from app.sim.cells.cell import load_cell
from tests.benchmarks.measure import report, rounds_over, row
from tests.benchmarks.peers.stock_dqn import FOR_EVER, stock
from tests.benchmarks.sorting_steps import batched, gymnasium_alone
from tests.benchmarks.training_rates import rates, trainer_arguments

BENCH = "training"
CELL = "sorting-e0"
PRESET = "sorting-e0-dqn"


def ours(seed: int) -> tuple[SortingPreset, BaseAlgorithm]:
    """Return the model that the service trains, and its preset."""
    preset = presets.resolve(PRESET, {})
    assert isinstance(preset, SortingPreset)
    return preset, sorting_training.start(preset, seed, load_cell(preset.cell))[1]


def main() -> None:
    """Measure and print."""
    options = trainer_arguments(BENCH)
    torch.set_num_threads(1)
    preset, model = ours(options.seed)
    rows = rates(
        f"tandem/{PRESET}", preset.learning.n_envs, model, preset.learning.total_steps, options
    )
    rows += rates(f"sb3-plain/{CELL}", 1, stock(CELL, options.seed), FOR_EVER, options)
    alone = [
        batched("tandem/sorting-e0-env", "sorting-e0", options.seed),
        batched("tandem/sorting-e1-env", "sorting-e1", options.seed),
        gymnasium_alone("gymnasium/sorting-e0", "sorting-e0", options.seed),
    ]
    for subject, found in zip(alone, rounds_over(alone, options.rounds, 1.0), strict=True):
        values = [subject.batch / spent for spent in found]
        rows.append(row(subject, values, "env-steps/cpu-s"))
    report(BENCH, rows, options, warm_s=options.warm)


if __name__ == "__main__":
    main()
