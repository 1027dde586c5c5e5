"""Train the stock DQN of Stable-Baselines3 on the plain environment, as its users do.

    PYTHONPATH=. python -m tests.benchmarks.peers.stock_dqn --cell sorting-e0 --out curve.jsonl

Hyper-parameters are those of the thesis' table 3.1, as far as Stable-Baselines3 has them: it
has neither prioritised replay nor duelling nor double Q-learning, and no masks. Every
``--every`` environment steps the greedy policy is tried on random episodes, with pairs (K_E,
K_G) drawn as in training and evenly over all pairs; this is not counted. A line of JSON per
point goes to ``--out``: environment steps, updates, processor seconds of training, shares of
success and mean returns. Training stops when both shares reach ``--target``, or after ``--cap``
processor seconds.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import DQN
from stable_baselines3.common.callbacks import BaseCallback

from app.sim.cells.cell import load_cell
from tests.benchmarks.peers.plain_sorting import PlainSorting

EXPLORATION_STEPS = {"sorting-e0": 2_000_000, "sorting-e1": 8_000_000}
"""N_t: epsilon falls over so many steps, linearly."""
TRAIN_FREQ = 4
EPISODES = 200
FOR_EVER = 10**9
"""More steps than any run makes; ``--cap`` ends it."""


def plain(cell_name: str, pair: tuple[int, int] | None = None) -> PlainSorting:
    """Return the plain environment of a sorting cell."""
    stations = load_cell(cell_name).stations
    fail = [s.failure_probability for s in stations if s.kind == "clutter"]
    n_colours = sum(s.kind == "cluster" for s in stations)
    return PlainSorting(np.array(fail), n_colours, pair=pair)


def stock(cell_name: str, seed: int) -> DQN:
    """Return the stock learner with the hyper-parameters of table 3.1."""
    return DQN(
        "MlpPolicy",
        plain(cell_name),
        learning_rate=1e-4,
        buffer_size=100_000,
        batch_size=256,
        gamma=0.92,
        train_freq=TRAIN_FREQ,
        gradient_steps=1,
        target_update_interval=500,
        exploration_initial_eps=1.0,
        exploration_final_eps=0.05,
        exploration_fraction=EXPLORATION_STEPS[cell_name] / FOR_EVER,
        policy_kwargs={"net_arch": [128, 128]},
        seed=seed,
        device="cpu",
    )


def evaluated(model: DQN, envs: list[PlainSorting], seed: int) -> tuple[float, float]:
    """Return share of success and mean return of one greedy episode in each environment."""
    obs = np.stack([env.reset(seed=seed + k)[0] for k, env in enumerate(envs)])
    running = np.ones(len(envs), dtype=bool)
    solved, returns = np.zeros(len(envs), dtype=bool), np.zeros(len(envs))
    while running.any():
        rows = np.flatnonzero(running)
        acts: NDArray[np.int64] = model.predict(obs[rows], deterministic=True)[0]
        for row, act in zip(rows, acts, strict=True):
            obs[row], rew, over, late, _ = envs[row].step(act)
            returns[row] += rew
            solved[row] = over
            running[row] = not (over or late)
    return float(solved.mean()), float(returns.mean())


class Curve(BaseCallback):
    """Write a point of the learning curve now and then; end at the target or the cap."""

    def __init__(self, options: argparse.Namespace) -> None:
        super().__init__()
        self._options, self._uncounted = options, 0.0
        self._begin, self._next = time.process_time(), options.every
        n_slots = plain(options.cell).k
        pairs = [(e, g) for e in range(1, n_slots + 1) for g in range(1, e + 1)]
        drawn = np.random.default_rng(options.seed).integers(len(pairs), size=EPISODES)
        self._triangular = [plain(options.cell) for _ in range(EPISODES)]
        self._even = [plain(options.cell, pairs[k]) for k in drawn]
        self._uncounted = time.process_time() - self._begin

    def _on_step(self) -> bool:
        spent = time.process_time() - self._begin - self._uncounted
        late = spent >= self._options.cap
        if self.num_timesteps < self._next and not late:
            return True
        self._next += self._options.every
        begin = time.process_time()
        point = self._point(spent)
        with Path(self._options.out).open("a") as file:
            file.write(json.dumps(point) + "\n")
        self._uncounted += time.process_time() - begin
        target = self._options.target
        return not late and min(point["success"], point["success_even"]) < target

    def _point(self, spent: float) -> dict[str, float]:
        assert isinstance(self.model, DQN)
        seed = 10_000_000 + self.num_timesteps
        success, mean_return = evaluated(self.model, self._triangular, seed)
        success_even, mean_return_even = evaluated(self.model, self._even, seed + 1_000_000)
        return {
            "env_steps": self.num_timesteps,
            "updates": int(self.model._n_updates),
            "cpu_s": round(spent, 1),
            "epsilon": round(float(self.model.exploration_rate), 4),
            "success": success,
            "return": round(mean_return, 4),
            "success_even": success_even,
            "return_even": round(mean_return_even, 4),
        }


def main() -> None:
    """Train."""
    parser = argparse.ArgumentParser(prog="stock_dqn")
    parser.add_argument("--cell", default="sorting-e0", choices=sorted(EXPLORATION_STEPS))
    parser.add_argument("--out", required=True, help="file that points are appended to")
    parser.add_argument("--cap", type=float, default=7200.0, help="processor seconds")
    parser.add_argument("--target", type=float, default=0.9, help="share of success")
    parser.add_argument("--every", type=int, default=20_000, help="environment steps")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    torch.set_num_threads(1)
    model = stock(options.cell, options.seed)
    model.learn(FOR_EVER, callback=Curve(options))


if __name__ == "__main__":
    main()
