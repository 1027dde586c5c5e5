"""Steps and updates of trainers per processor second."""

import argparse
import time

from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback

from tests.benchmarks.measure import Row, Subject, row


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
    name: str,
    batch: int,
    model: BaseAlgorithm,
    steps: int,
    options: argparse.Namespace,
    least_updates: int = 50,
) -> list[Row]:
    """Train for a while of ``steps``; return the rows of steps and of updates.

    Args:
        name: What is trained.
        batch: Environments stepped together.
        model: The learner.
        steps: Steps of the whole training, which its schedules go by.
        options: From :func:`trainer_arguments`.
        least_updates: Updates that are not counted.
    """
    meter = Meter(options.warm, options.seconds, least_updates)
    model.learn(steps, callback=meter)
    subject = Subject(name=name, batch=batch, run=lambda: None)
    return [
        row(subject, [meter.steps_per_s], "env-steps/cpu-s"),
        row(subject, [meter.updates_per_s], "updates/cpu-s"),
    ]


def trainer_arguments(bench: str) -> argparse.Namespace:
    """Read the command line of a benchmark of trainers and environments."""
    parser = argparse.ArgumentParser(prog=f"bench {bench}")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--rounds", type=int, default=3, help="of the environments alone")
    parser.add_argument(
        "--warm", type=float, default=20.0, help="processor seconds not counted"
    )
    parser.add_argument("--seconds", type=float, default=40.0, help="processor seconds counted")
    parser.add_argument("--seed", type=int, default=11)
    return parser.parse_args()
