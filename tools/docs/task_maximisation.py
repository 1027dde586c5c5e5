"""Compare targets chosen by the critic in training with uniform targets (thesis 5.2).

    python -m tools.docs.task_maximisation FOLDER [--seeds 1 2 3]

trains ``pick-reach-td3``, shortened as in ``SETUP``, with each choice and seed into
``FOLDER/uniform-1`` and so on. An interrupted training is resumed, a finished one is kept. Then
all policies play the same episodes; none of their people occurred in training. Each target is
also judged by its critic: the value at the start less the discounted return that followed.
Writes ``docs/results/task-maximisation-bias.json`` and
``docs/img/pick/task-maximisation-bias.png``.
"""

import argparse
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from matplotlib.figure import Figure

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.checkpoints.model_state import tensors_under
from app.policies.configs import presets
from app.policies.configs.pick import PickPreset
from app.policies.evaluation.pick.episodes import EVALUATION_LIBRARY
from app.policies.evaluation.statistics import clustered
from app.policies.inference.value_networks import pick_preset_of
from app.policies.networks.pick import actor_of, critics_for
from app.policies.training.curve import play
from app.policies.training.pick import settings_of, values_of
from app.sim.cells.cell import load_cell
from app.sim.pick.batch import OUTCOMES
from app.sim.pick.valued_targets import ValuedTargetBatch
from tools.docs.learning_curves import policies
from tools.docs.results import IMAGES, RESULTS, Json, write_result
from tools.docs.training_curves import record
from tools.docs.world.plots import BLUE, GREY, ORANGE, panels, save

RESULT = RESULTS / "task-maximisation-bias.json"
IMAGE = IMAGES / "pick/task-maximisation-bias.png"
CHOICES = ("critic", "uniform")
SEEDS = (1, 2, 3)
EPISODES, SEED = 1600, 11
SETUP: dict[str, Any] = {
    "learning.total_steps": 1_024_000,
    "learning.buffer_size": 200_000,
    "learning.batch_size": 256,
    "learning.actor_frozen_updates": 1_000,
    "learning.progress_steps": 102_400,
    "learning.checkpoint_steps": 102_400,
    "networks.width": 128,
    "episode.target_jitter_m": 0.0,
    "episode.on_path_share": 0.0,
    "people.n_people": 1,
}
"""Changes to ``pick-reach-td3`` in all trainings: targets are stations, and no start depends
on the target."""
Numbers = dict[str, dict[str, float]]
"""Numbers of one policy by row and name."""


def preset_of(choice: str) -> PickPreset:
    """Return the preset of the trainings with a choice of targets."""
    changes = {**SETUP, "episode.target_choice": choice}
    preset = presets.resolve("pick-reach-td3", presets.nested(changes))
    assert isinstance(preset, PickPreset)
    return preset


@dataclass(frozen=True, kw_only=True)
class Judge:
    """The networks of a policy in the episodes of the comparison."""

    actor: torch.nn.Module
    """Its actor."""
    batch: ValuedTargetBatch
    """The episodes; targets are drawn uniformly until its values are set."""
    critic: Any
    """Returns its values of observations."""
    gamma: float
    """Its discount factor per step."""

    def shares(self) -> np.ndarray:
        """Return the share of the starts at which each station has the greatest value."""
        batch = self.batch
        batch.values = None
        batch.reset()
        best = batch.station_values(np.arange(batch.n_envs), self.critic).argmax(axis=1)
        return np.bincount(best, minlength=len(batch.world.stations)) / batch.n_envs

    def numbers(self, chosen: np.ndarray) -> Numbers:
        """Return the numbers of the policy, of all episodes and by target.

        Args:
            chosen: Share of each station among the targets of its training.
        """
        batch = self.batch
        batch.values = None
        value = self.critic(batch.reset())
        target = batch.state.candidates[:, 0].copy()
        ended, returns = play(self.actor, batch, self.gamma)
        found = {"all": rates(ended, value - returns)}
        for number, station in enumerate(batch.cell.pick_stations):
            rows = target == number
            found[station.id] = {
                **rates(ended[rows], (value - returns)[rows]),
                "trained": float(chosen[number]),
            }
        tried = list(found.values())[1:]
        found["all"]["least_success"] = min(one["success"] for one in tried)
        batch.values = self.critic
        value = self.critic(batch.reset())
        ended, returns = play(self.actor, batch, self.gamma)
        return found | {"chosen": rates(ended, value - returns)}


def rates(ended: np.ndarray, error: np.ndarray) -> dict[str, float]:
    """Return shares of outcomes, and mean and mean absolute error of values, each (n,)."""
    shares = {
        name: float((ended == OUTCOMES.index(name)).mean())
        for name in ("success", "collision", "timeout")
    }
    return {**shares, "error": float(error.mean()), "error_abs": float(np.abs(error).mean())}


def judge_of(policy: Checkpoint, batch: ValuedTargetBatch) -> Judge:
    """Return the judge of a policy in a batch of episodes."""
    preset, arrays = pick_preset_of(policy), policy.arrays()
    actor, critics = actor_of(preset, batch.obs_size), critics_for(preset, batch.obs_size)
    actor.load_state_dict(tensors_under(arrays, "actor"))
    critics.load_state_dict(tensors_under(arrays, "critic"))
    critic, gamma = values_of(actor, critics), preset.learning.gamma
    return Judge(actor=actor, batch=batch, critic=critic, gamma=gamma)


def episodes_of(preset: PickPreset, episodes: int) -> ValuedTargetBatch:
    """Return the episodes of the comparison, at the last collision cost of the training."""
    settings = settings_of(preset)
    settings = replace(settings, work=replace(settings.work, seed=EVALUATION_LIBRARY))
    batch = ValuedTargetBatch(load_cell(preset.cell), episodes, SEED, settings)
    batch.set_collision_cost(preset.reward.c_c_end)
    return batch


def numbers_of(folder: Path, batch: ValuedTargetBatch, choice: str) -> Numbers:
    """Return the numbers of the last policy of a training.

    The share of a station among the targets of a training with the critic's choice is the mean
    of the shares at its stored policies.
    """
    judges = [judge_of(policy, batch) for policy in policies(folder)]
    n_stations = len(batch.world.stations)
    chosen = np.full(n_stations, 1.0 / n_stations)
    if choice == "critic":
        chosen = np.mean([judge.shares() for judge in judges], axis=0)
    return judges[-1].numbers(chosen)


def table_of(found: dict[str, list[Numbers]]) -> tuple[list[Json], list[Json]]:
    """Return the rows of both choices, and the differences critic - uniform, seed by seed.

    Args:
        found: Numbers by choice, one of each seed.
    """
    rows: list[Json] = []
    paired: list[Json] = []
    for row, names in found[CHOICES[0]][0].items():
        each = {
            choice: {name: [one[row][name] for one in found[choice]] for name in names}
            for choice in CHOICES
        }
        for choice, values in each.items():
            rows.append({"name": f"{choice} {row}", **_intervals(values, 0.0)})
        first, second = (each[choice] for choice in CHOICES)
        differences = {
            name: [a - b for a, b in zip(first[name], second[name], strict=True)]
            for name in first
        }
        paired.append({"name": f"critic - uniform {row}", **_intervals(differences, -1.0)})
    return rows, paired


def _intervals(values: dict[str, list[float]], low: float) -> Json:
    """Return means over seeds with their intervals, and the value of each seed."""
    line: Json = {}
    for name, each in values.items():
        ends = (-math.inf, math.inf) if name.startswith("error") else (low, 1.0)
        line |= {name: clustered(each, *ends), f"{name}_by_seed": each}
    return line


def draw(result: Json) -> Figure:
    """Draw success, error of the critic and share in training by target, a dot per seed."""
    figure, axes = panels(1, 3, 3.3, sharex=True)
    rows = {row["name"]: row for row in result["results"]}
    stations = [name.split()[1] for name in rows if "trained" in rows[name]]
    stations = list(dict.fromkeys(stations))
    for shift, choice, colour in ((-0.15, CHOICES[0], ORANGE), (0.15, CHOICES[1], BLUE)):
        place = np.arange(len(stations)) + shift
        for view, name, factor in zip(
            axes[0], ("success", "error", "trained"), (100.0, 1.0, 100.0), strict=True
        ):
            each = [rows[f"{choice} {one}"] for one in stations]
            mean = [factor * one[name]["mean"] for one in each]
            view.bar(place, mean, 0.3, color=colour, alpha=0.5, label=choice)
            dots = factor * np.array([one[f"{name}_by_seed"] for one in each])
            view.plot(np.repeat(place, dots.shape[1]), dots.ravel(), ".", color=colour, ms=4)
    titles = ("success [%]", "value less return", "share of targets in training [%]")
    for view, title in zip(axes[0], titles, strict=True):
        view.axhline(0.0, color=GREY, lw=0.9)
        view.set_title(title)
        view.set_xticks(range(len(stations)), stations, rotation=60)
    shown = axes[0, 0].get_legend_handles_labels()
    figure.legend(*shown, loc="outside lower center", ncols=2, title="targets in training")
    return figure


def main() -> None:
    """Train what is missing, compare, and write the result and its picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    parser.add_argument("--seeds", type=int, nargs="+", default=SEEDS)
    parser.add_argument("--episodes", type=int, default=EPISODES)
    options = parser.parse_args()
    torch.set_num_threads(1)
    found: dict[str, list[Numbers]] = {choice: [] for choice in CHOICES}
    batch = episodes_of(preset_of("uniform"), options.episodes)
    for seed in options.seeds:
        for choice in CHOICES:
            folder, preset = options.folder / f"{choice}-{seed}", preset_of(choice)
            end = f"step-{preset.learning.total_steps:09d}.json"
            if not (folder / end).exists():
                record(preset, seed, folder, predicts=False)
            found[choice].append(numbers_of(folder, batch, choice))
    rows, paired = table_of(found)
    result = {
        "command": "python -m tools.docs.task_maximisation FOLDER",
        "seed": SEED,
        "episodes": options.episodes,
        "settings": {"preset": "pick-reach-td3", **SETUP, "seeds": list(options.seeds)},
        "results": rows,
        "paired": paired,
    }
    write_result(RESULT, result)
    save(draw, IMAGE, result)


if __name__ == "__main__":
    main()
