"""Measure how well the features of a pick predict its outcome beside one kind of people.

    python -m tools.docs.outcome_bounds [FILE ...]

Writes ``docs/results/outcome-bounds.json``. For each kind of people of ``risk-calibration``,
the outcome probabilities of the shipped policy are fitted again beside this kind alone, with as
much data as in its training and the people of the evaluation in other episodes. They know what
an observation does not tell, the kind of the people, and stand for the best that a function of
the features can predict. Files are recorded motion, for the row ``recorded``. A kind takes five
minutes on one core.
"""

import argparse
import logging
from dataclasses import replace
from pathlib import Path

import torch

from app.cli.recordings import clean_runs
from app.policies.checkpoints import pretrained
from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.evaluation.pick.calibration import (
    MIXTURE,
    SHORT_TIME,
    bench_of,
    calibration_row,
    kinds_of,
)
from app.policies.evaluation.rows import EvaluationRequest, Json
from app.policies.inference.value_networks import pick_preset_of
from app.policies.training.pick import OUTCOME_SEED, outcomes_beside
from app.policies.training.train import without_denormals
from app.sim.cells.cell import Cell
from app.sim.pick.batch import PickBatch, PickSettings
from tools.docs.results import RESULTS, write_result
from tools.fit_outcomes import with_outcomes

logger = logging.getLogger(__name__)
RESULT = RESULTS / "outcome-bounds.json"
"""What the command writes."""
SEED = 21
"""Seed of the episodes, that of the results of ``risk-calibration``."""


def fitted_beside(checkpoint: Checkpoint, settings: PickSettings, cell: Cell) -> Checkpoint:
    """Return a checkpoint whose outcomes are fitted to its policy beside one kind of people.

    Raises:
        ValueError: Too few episodes ended within its number of training steps.
    """
    preset = pick_preset_of(checkpoint)
    seed = int(checkpoint.manifest["seed"]) + OUTCOME_SEED
    seen = replace(settings, observation=preset.episode.observation)
    batch = PickBatch(cell, preset.learning.n_envs, seed, seen)
    with without_denormals():
        head = outcomes_beside(checkpoint, preset, batch, lambda: False)
    if head is None:
        raise ValueError("too few episodes ended: outcomes need a longer training")
    return with_outcomes(checkpoint, head, {})


def measured(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Return the result, one row per kind of people and outcome."""
    bench, rows = bench_of(checkpoint, request), list[Json]()
    for name, settings in kinds_of(bench).items():
        if name in (MIXTURE, SHORT_TIME):
            continue
        own = bench_of(fitted_beside(checkpoint, settings, bench.cell), request)
        fitted = calibration_row(own.evaluator(settings), name, request.seed)
        shipped = calibration_row(bench.evaluator(settings), name, request.seed)
        for outcome in ("success", "contact"):
            rows.append(_row(f"{name}, {outcome}", shipped[outcome], fitted[outcome]))
            logger.info("%s", rows[-1])
    return {
        "command": "python -m tools.docs.outcome_bounds FILE ...",
        "seed": request.seed,
        "episodes": bench.n,
        "checkpoint": checkpoint.sha256,
        "results": rows,
    }


def _row(name: str, shipped: Json, fitted: Json) -> Json:
    return {
        "name": name,
        "rate_percent": 100.0 * shipped["rate"],
        "brier_of_the_rate": shipped["brier_constant"],
        "brier_shipped": shipped["brier"],
        "brier_after_half": shipped["recalibrated"]["half"]["brier"],
        "brier_fitted_beside_them": fitted["brier"],
        "auc_shipped": shipped["auc"],
        "auc_fitted_beside_them": fitted["auc"],
        "ece_fitted_beside_them_percent": 100.0 * fitted["ece"],
        "ece_by_chance_percent": 100.0 * fitted["ece_floor"],
    }


def main() -> None:
    """Fit and evaluate beside each kind of people, and write the result."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="*", type=Path, metavar="FILE")
    files = parser.parse_args().files
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    torch.set_num_threads(1)
    motions = clean_runs(files)
    result = measured(pretrained.load("pick"), EvaluationRequest(seed=SEED, motions=motions))
    write_result(RESULT, result)


if __name__ == "__main__":
    main()
