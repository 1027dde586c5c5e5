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

import argparse
import time

import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback

from app.policies import presets, sorting_training
from app.policies.sorting_preset import SortingPreset
from app.sim.cells import load_cell
from tests.benchmarks.measure import Row, Subject, report, rounds_over, row
from tests.benchmarks.sorting_steps import batched, gymnasium_alone
from tests.benchmarks.stock_dqn import FOR_EVER, stock

BENCH = "training"
CELL = "sorting-e0"
PRESET = "sorting-e0-dqn"


class Meter(BaseCallback):
    """Count steps and updates for a while, then stop the training."""

    def __init__(self, warm_s: float, seconds: float, least_updates: int = 50) -> None:
        super().__init__()
        self._warm_s, self._seconds, self._least = warm_s, seconds, least_updates
        self._begin = time.process_time()
        self._first: tuple[float, int, int] | None = None
        self.steps_per_s = self.updates_per_s = 0.0
        """Rates per processor second."""

    def _on_step(self) -> bool:
        now = time.process_time()
        updates = int(vars(self.model)["_n_updates"])
        if self._first is None:
            if now - self._begin >= self._warm_s and updates >= self._least:
                self._first = (now, self.num_timesteps, updates)
            return True
        began, steps, done = self._first
        if now - began < self._seconds:
            return True
        self.steps_per_s = (self.num_timesteps - steps) / (now - began)
        self.updates_per_s = (updates - done) / (now - began)
        return False


def rates(
    name: str, batch: int, model: BaseAlgorithm, steps: int, options: argparse.Namespace
) -> list[Row]:
    """Train for a while of ``steps``; return the rows of steps and of updates."""
    meter = Meter(options.warm, options.seconds)
    model.learn(steps, callback=meter)
    subject = Subject(name=name, batch=batch, run=lambda: None)
    return [
        row(subject, [meter.steps_per_s], "env-steps/cpu-s"),
        row(subject, [meter.updates_per_s], "updates/cpu-s"),
    ]


def ours(seed: int) -> tuple[SortingPreset, BaseAlgorithm]:
    """Return the model that the service trains, and its preset."""
    preset = presets.resolve(PRESET, {})
    assert isinstance(preset, SortingPreset)
    return preset, sorting_training.start(preset, seed, None, load_cell(preset.cell))[1]


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog=f"bench {BENCH}")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--rounds", type=int, default=3, help="of the environments alone")
    parser.add_argument(
        "--warm", type=float, default=20.0, help="processor seconds not counted"
    )
    parser.add_argument("--seconds", type=float, default=40.0, help="processor seconds counted")
    parser.add_argument("--seed", type=int, default=11)
    return parser.parse_args()


def main() -> None:
    """Measure and print."""
    options = arguments()
    torch.set_num_threads(1)
    preset, model = ours(options.seed)
    rows = rates(f"tandem/{PRESET}", preset.n_envs, model, preset.total_steps, options)
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
