"""Search the hand motions beside which the shipped pick policy succeeds least.

Differential evolution over the numbers of a motion (``evaluation/pick/worst_people.py``); the
objective is the rate of success when the critic selects among two or three targets. The first
generation contains the motions of the last search, for another policy perhaps. All motions of a
generation are evaluated in one batch. The last generation is evaluated again on another seed,
because the least of many noisy rates is too low by chance, and its worst motions are written to
``worst_people.json``, which is committed.

Takes about ten minutes on one core.
"""

import json
import logging
from collections.abc import Sequence
from dataclasses import asdict

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.optimize import differential_evolution

from app.policies.checkpoints import pretrained
from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.evaluation.pick import selection_rules
from app.policies.evaluation.pick.episodes import PickBench
from app.policies.evaluation.pick.worst_people import FILE, HandMotion, beside, stored_motions
from app.policies.evaluation.rows import EvaluationRequest
from app.policies.inference.task_selection import HYSTERESIS
from app.sim.core.arrays import Vec
from tools.arguments import parser_of

logger = logging.getLogger(__name__)

SEED = 601
"""Seed of the search; ``SEED + 1`` is that of the second evaluation."""
N_MOTIONS, N_GENERATIONS = 48, 24
PER_MOTION, PER_MOTION_AGAIN = 24, 150
"""Episodes of each motion, on average."""
N_KEPT = 10
N_POINTS = 4
"""Points of a path."""
BOX = ((-0.65, 0.35, 0.08), (0.65, 0.8, 0.35))
"""Least and greatest coordinates of the palm [m]."""
SPEEDS = (0.2, 0.7)
"""Least and greatest mean speed of a move [m/s]; the peak is 1.9 times as high."""
PAUSES = (0.1, 2.0)
"""Shortest and longest rest before a move [s]."""
N_NUMBERS = 1 + 3 * N_POINTS + 2 * (N_POINTS - 1)
"""Numbers that describe a motion."""


def hand_motion(numbers: Vec) -> HandMotion:
    """Return the motion of numbers in [0, 1], shape (N_NUMBERS,), inside the limits."""
    points, speeds, pauses = np.split(numbers[1:], (3 * N_POINTS, 4 * N_POINTS - 1))
    low, high = np.array(BOX)
    palms = low + points.reshape(N_POINTS, 3) * (high - low)
    return HandMotion(
        hand="r" if numbers[0] < 0.5 else "l",
        palms=tuple(tuple(round(float(x), 3) for x in palm) for palm in palms),
        speeds=tuple(round(float(x), 3) for x in np.interp(speeds, (0, 1), SPEEDS)),
        pauses=tuple(round(float(x), 3) for x in np.interp(pauses, (0, 1), PAUSES)),
    )


def numbers_of(motion: HandMotion) -> Vec:
    """Return the numbers of a motion, the inverse of :func:`hand_motion`."""
    low, high = np.array(BOX)
    points = (np.array(motion.palms) - low) / (high - low)
    speeds = np.interp(motion.speeds, SPEEDS, (0, 1))
    pauses = np.interp(motion.pauses, PAUSES, (0, 1))
    return np.concatenate(
        [[0.25 if motion.hand == "r" else 0.75], points.ravel(), speeds, pauses]
    )


def success_beside(
    checkpoint: Checkpoint, motions: Sequence[HandMotion], per_motion: int, seed: int
) -> NDArray[np.float64]:
    """Return the rate of success beside each motion.

    Returns:
        Rates with one success and one failure added, shape (len(motions),).
    """
    request = EvaluationRequest(episodes=per_motion * len(motions), seed=seed)
    bench = PickBench(checkpoint, request)
    evaluator = bench.evaluator(beside(bench.usual, bench.cell, motions))
    won = evaluator.run(selection_rules.critic(HYSTERESIS)).succeeded
    track = evaluator.batch.state.people.track[:, 0]
    hits = np.bincount(track, weights=won, minlength=len(motions))
    return np.asarray((hits + 1.0) / (np.bincount(track, minlength=len(motions)) + 2.0))


def search(
    checkpoint: Checkpoint,
    first: Sequence[HandMotion],
    n_motions: int,
    n_generations: int,
    n_kept: int,
) -> list[tuple[HandMotion, float]]:
    """Return the worst motions found, and the rate of success beside each on another seed.

    Args:
        first: Motions of the first generation; the others are random.
        n_motions: Motions of a generation, at least five and as many as ``first``.
        n_generations: Generations after the first.
        n_kept: Motions returned, from the worst on.
    """

    def rates(numbers: NDArray[np.float64]) -> NDArray[np.float64]:
        motions = [hand_motion(one) for one in np.atleast_2d(numbers.T)]
        found = success_beside(checkpoint, motions, PER_MOTION, SEED)
        logger.info("success from %.2f, mean %.2f", found.min(), found.mean())
        return found

    rng = np.random.default_rng(SEED)
    start = rng.random((n_motions, N_NUMBERS))
    start[: len(first)] = np.reshape([numbers_of(one) for one in first], (-1, N_NUMBERS))
    result = differential_evolution(
        rates,
        [(0.0, 1.0)] * N_NUMBERS,
        init=start,
        maxiter=n_generations,
        tol=0.0,
        polish=False,
        vectorized=True,
        updating="deferred",
        rng=rng,
    )
    motions = [hand_motion(one) for one in result.population]
    again = success_beside(checkpoint, motions, PER_MOTION_AGAIN, SEED + 1)
    return [(motions[k], float(again[k])) for k in np.argsort(again)[:n_kept]]


def main() -> None:
    """Search beside the shipped policy and write the motions."""
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    torch.set_num_threads(1)
    checkpoint = pretrained.load("pick")
    found = search(checkpoint, stored_motions(), N_MOTIONS, N_GENERATIONS, N_KEPT)
    lines = ",\n  ".join(
        json.dumps(asdict(motion) | {"success": round(rate, 3)}) for motion, rate in found
    )
    head = f'{{"checkpoint": "{checkpoint.sha256}", "seed": {SEED}, "motions": ['
    FILE.write_text(f"{head}\n  {lines}\n]}}\n")
    logger.info("wrote %s: success %s", FILE, [round(rate, 3) for _, rate in found])


if __name__ == "__main__":
    parser_of(__doc__).parse_args()
    main()
