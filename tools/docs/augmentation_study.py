"""Measure the effect of motion augmentation: training with and without it, three seeds each.

    SETS="--set learning.total_steps=1024000 --set people.augmentation=sampled
        --set people.n_people=1 --set people.human_absent=0 --set people.human_off_task=0"
    python -m app train pick-reach-td3 --seed 21 $SETS --output FOLDER/sampled-21

Repeat for ``replayed`` and for seeds 22 and 23. Then

    python -m tools.docs.augmentation_study FOLDER [FILE ...]

evaluates each policy on the same episodes, none of which occurred in training, and writes
``docs/results/augmentation.json``. If recordings are given, the policies are also evaluated
beside recorded people.
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import torch

from app.cli.recordings import clean_runs
from app.errors import InvalidInput
from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.evaluation.pick import selection_rules
from app.policies.evaluation.pick.episodes import PickBench
from app.policies.evaluation.rows import EvaluationRequest
from app.policies.evaluation.statistics import clustered
from app.policies.inference.task_selection import HYSTERESIS
from app.sim.mocap.importer import Motion
from app.sim.people.human_motion_config import at_the_table
from app.sim.pick.batch import PickSettings
from tools.docs.results import RESULTS, Json, read_result, write_result
from tools.docs.training_curves import read

KINDS = ("sampled", "replayed")
EPISODES, SEED = 1000, 11
RESULT = RESULTS / "augmentation.json"


def trained(folder: Path, kind: str) -> dict[int, Checkpoint]:
    """Return the policies of one kind by seed.

    Args:
        folder: Folder of the trainings.
        kind: One of KINDS.

    Raises:
        InvalidInput: There are fewer than two, one is unfinished, or one is of another kind.
    """
    found: dict[int, Checkpoint] = {}
    for path in sorted(folder.glob(f"{kind}-*/policy.json")):
        manifest, place = read_result(path), path.parent.name
        preset = manifest["preset"]
        augmentation = preset["people"]["augmentation"]
        total_steps = preset["learning"]["total_steps"]
        if augmentation != kind:
            raise InvalidInput(place, augmentation, f"must be trained with {kind}")
        if manifest["step"] < total_steps:
            raise InvalidInput(place, manifest["step"], f"must reach {total_steps}")
        found[int(manifest["seed"])] = read(path)
    if len(found) < 2:
        raise InvalidInput(str(folder), len(found), f"must hold two or more {kind}-SEED")
    return found


def tests(usual: PickSettings, recorded: tuple[Motion, ...]) -> dict[str, PickSettings]:
    """Return the settings of the comparison by name.

    Args:
        usual: An evaluation's settings, 2-3 targets, the library's people.
        recorded: Recorded runs, placed in the cell; none to leave that test out.
    """
    work = usual.work
    found = {
        "one_target": replace(usual, n_candidates=(1, 1)),
        "2_or_3_targets": usual,
        "people_off_task": replace(usual, work=replace(work, off_task=1.0)),
    }
    if recorded:
        beside = replace(work, motion="recorded", recorded=recorded)
        found["recorded_people"] = replace(usual, work=beside)
    return found


def successes(checkpoint: Checkpoint, motions: Sequence[Motion], episodes: int) -> Json:
    """Return the success rate of a policy in each test."""
    bench, rates = PickBench(checkpoint, EvaluationRequest(episodes=episodes, seed=SEED)), {}
    recorded = tuple(at_the_table(motion, bench.cell) for motion in motions)
    for name, settings in tests(bench.usual, recorded).items():
        one = settings.n_candidates == (1, 1)
        rule = selection_rules.fixed(0) if one else selection_rules.critic(HYSTERESIS)
        rates[name] = bench.evaluator(settings).run(rule).row(name)["success"]["mean"]
    return rates


def table_of(rates: dict[str, dict[int, Json]]) -> list[Json]:
    """Return the rows of the table: each kind, and the paired difference.

    Args:
        rates: Success by kind, seed and test.
    """
    names = list(next(iter(rates[KINDS[0]].values())))
    rows: list[Json] = []
    for kind in KINDS:
        line: Json = {"name": kind, "seeds": len(rates[kind])}
        for name in names:
            each = [one[name] for one in rates[kind].values()]
            line |= {name: clustered(each), f"{name}_by_seed": each}
        rows.append(line)
    both = sorted(set(rates[KINDS[0]]) & set(rates[KINDS[1]]))
    if len(both) > 1:
        last: Json = {"name": "difference", "seeds": len(both)}
        for name in names:
            each = [rates[KINDS[0]][seed][name] - rates[KINDS[1]][seed][name] for seed in both]
            last |= {name: clustered(each, -1.0), f"{name}_by_seed": each}
        rows.append(last)
    return rows


def main() -> None:
    """Evaluate all policies and write the result."""
    parser = argparse.ArgumentParser(description="Measure what augmentation buys.")
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    parser.add_argument("recordings", nargs="*", type=Path, metavar="FILE")
    parser.add_argument("--episodes", type=int, default=EPISODES)
    options = parser.parse_args()
    torch.set_num_threads(1)
    policies = {kind: trained(options.folder, kind) for kind in KINDS}
    motions = clean_runs(options.recordings)
    rates = {
        kind: {seed: successes(one, motions, options.episodes) for seed, one in found.items()}
        for kind, found in policies.items()
    }
    result = {
        "command": "python -m tools.docs.augmentation_study FOLDER"
        + (" FILE ..." if motions else ""),
        "seed": SEED,
        "episodes": options.episodes,
        "steps": next(iter(policies[KINDS[0]].values())).manifest["step"],
        "checkpoints": {
            kind: {seed: one.sha256 for seed, one in found.items()}
            for kind, found in policies.items()
        },
        "results": table_of(rates),
    }
    write_result(RESULT, result)


if __name__ == "__main__":
    main()
