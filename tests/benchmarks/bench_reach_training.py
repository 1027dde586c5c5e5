"""Rates of training on the reach scenario: ours beside stock TD3 and DDPG on one environment.

    python -m app bench reach-training [--json] [--warm 20] [--seconds 40]

tandem/reach-td3       the trainer of the service with its preset: env-steps and updates
sb3-plain-td3/reach    stock Stable-Baselines3 TD3 on one ``tandem/Reach-v0``
sb3-plain-ddpg/reach   its DDPG on the same
tandem/reach-env       the batched environment alone, random actions
gymnasium/reach        one environment alone, random actions

All in processor seconds of one thread, as in ``bench_training.py``. The stock learners have
their default hyper-parameters: networks of 400 and 300 units, minibatches of 256, an update
after every step. A step of ours is that of one of 128 environments, and an update learns from
512 transitions; it is counted from where the actor learns, too.
"""

import itertools

import gymnasium
import numpy as np
import torch
from stable_baselines3 import DDPG, TD3
from stable_baselines3.common.base_class import BaseAlgorithm

import app.sim.envs  # noqa: F401 - registers the environments
from app.policies.configs import presets
from app.policies.configs.reach import ReachPreset
from app.policies.training import reach as reach_training
from app.sim.cells.cell import load_cell
from app.sim.reach.batch import N_ACT, ReachBatch
from tests.benchmarks.measure import Subject, report, rounds_over, row
from tests.benchmarks.peers.stock_dqn import FOR_EVER
from tests.benchmarks.training_rates import rates, trainer_arguments

BENCH = "reach-training"
PRESET = "reach-td3"
ENV = "tandem/Reach-v0"
RECORDED = 512
"""Random actions that are drawn beforehand and come again."""


def ours(seed: int) -> tuple[ReachPreset, BaseAlgorithm]:
    """Return the model that the service trains, and its preset."""
    preset = presets.resolve(PRESET, {})
    assert isinstance(preset, ReachPreset)
    run, _ = reach_training.start(preset, seed, load_cell(preset.cell))
    return preset, run.model


def batched(preset: ReachPreset, seed: int) -> Subject:
    """Return the compiled batch; it acts at random."""
    cell, settings = load_cell(preset.cell), reach_training.settings_of(preset)
    batch = ReachBatch(cell, preset.learning.n_envs, seed, settings)
    drawn = np.random.default_rng(seed).uniform(
        -1.0, 1.0, (RECORDED, preset.learning.n_envs, N_ACT)
    )
    acts = itertools.cycle(drawn.astype(np.float32))
    batch.reset()
    return Subject(
        name="tandem/reach-env",
        batch=preset.learning.n_envs,
        run=lambda: batch.step(next(acts)),
    )


def single(seed: int) -> Subject:
    """Return one Gymnasium environment; it acts at random."""
    env = gymnasium.make(ENV)
    env.reset(seed=seed)
    drawn = np.random.default_rng(seed).uniform(-1.0, 1.0, (RECORDED, N_ACT))
    acts = itertools.cycle(drawn.astype(np.float32))

    def run() -> None:
        *_, over, late, _ = env.step(next(acts))
        if over or late:
            env.reset()

    return Subject(name="gymnasium/reach", batch=1, run=run)


def main() -> None:
    """Measure and print."""
    options = trainer_arguments(BENCH)
    torch.set_num_threads(1)
    preset, model = ours(options.seed)
    rows = rates(
        f"tandem/{PRESET}",
        preset.learning.n_envs,
        model,
        preset.learning.total_steps,
        options,
        least_updates=preset.learning.actor_frozen_updates,
    )
    for name, kind in (("td3", TD3), ("ddpg", DDPG)):
        stock = kind("MlpPolicy", gymnasium.make(ENV), seed=options.seed, device="cpu")
        rows += rates(f"sb3-plain-{name}/reach", 1, stock, FOR_EVER, options)
    alone = [batched(preset, options.seed), single(options.seed)]
    for subject, found in zip(alone, rounds_over(alone, options.rounds, 1.0), strict=True):
        values = [subject.batch / spent for spent in found]
        rows.append(row(subject, values, "env-steps/cpu-s"))
    report(BENCH, rows, options, warm_s=options.warm)


if __name__ == "__main__":
    main()
