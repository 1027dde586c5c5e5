"""Protocol ``sorting-tests``: many episodes of each benchmark task of the thesis (3.4.3).

Rows ``test-1`` to ``test-6`` are the policy alone; in ``test-1-planner-fallback`` etc. the
exact planner replaces a cycling policy. Picks fail with the probabilities of the work cell. An
episode is a success when the last goal is reached, and counts in ``fewest`` when every part of
it took as few moves as the exact planner. Each part has 4 K attempts.

Source: thesis 3.4.3, docs/method.md 1.5. Deviates: the source shows one run of each.
"""

from functools import partial

import numpy as np

from app.errors import InvalidInput
from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.evaluation.rows import EvaluationRequest, Json
from app.policies.evaluation.sorting.episodes import (
    ENDLESS,
    Chooser,
    ScriptedInterferences,
    SortingEpisodes,
    Values,
    greedy,
    run_with_fallback,
)
from app.policies.evaluation.sorting.grid import on_checkpoint, settings_of
from app.policies.evaluation.statistics import mean_of, rate_of, share_of
from app.sim.core.arrays import Vec
from app.sim.sorting.batch import SortingBatch, SortingSettings
from app.sim.sorting.benchmark_tasks import TESTS, SortingTest
from app.sim.sorting.state import SortingShape

DEFAULT_EPISODES = 1000


def start_test(batch: SortingBatch, test: SortingTest, fail: Vec, seed: int) -> None:
    """Set every environment of a batch to a start of a test."""
    batch.reset()
    for e in range(batch.n_envs):
        rng = np.random.default_rng((seed, TESTS.index(test), e, 0))
        batch.put(e, test.start(batch.shape, fail, rng))


def run_test(
    test: SortingTest, choose: Chooser, shape: SortingShape, fail: Vec, n: int, seed: int
) -> tuple[SortingEpisodes, SortingEpisodes]:
    """Return the episodes of a test without and with planner fallback."""
    batch = SortingBatch(shape, fail, n, seed, SortingSettings(horizon_factor=ENDLESS))
    start = partial(start_test, batch, test, fail, seed)
    return run_with_fallback(
        batch, start, choose, partial(ScriptedInterferences, test, n, seed)
    )


def row_of(name: str, episodes: SortingEpisodes) -> Json:
    """Return a row of the result."""
    won = episodes.success
    good = episodes.part(won)
    return {
        "name": name,
        "n": len(won),
        "success": rate_of(won),
        "timeout": rate_of(~won),
        "fewest": rate_of(won & (episodes.moves == episodes.fewest)),
        "moves_over_minimum": mean_of(good.moves / good.fewest),
        "riskier_pick": share_of(episodes.riskier, episodes.picks),
        "safest_identical": share_of(episodes.choices - episodes.riskier, episodes.choices),
        "failed_pick": share_of(episodes.failed, episodes.picks),
        "planner_fallback": rate_of(episodes.planner_fallback),
        "repeated": rate_of(episodes.repeated),
    }


def run_tests(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate a sorting policy in the six tests."""
    return on_checkpoint(trials, checkpoint, request)


def trials(values: Values, shape: SortingShape, fail: Vec, request: EvaluationRequest) -> Json:
    """Evaluate a policy on the tests; tests that need a larger task are left out.

    Arguments as :func:`~app.policies.evaluation.sorting.grid.grid`; the episodes of the request
    are those of each test, by default 1000.

    Raises:
        InvalidInput: The task is too small for all six.
    """
    n = request.episodes or DEFAULT_EPISODES
    fitting = [test for test in TESTS if test.fits(shape)]
    if not fitting:
        raise InvalidInput("n_slots", shape.n_slots, "must be enough for one of the six tests")
    rows, with_fallback = request.rows(2 * len(fitting)), []
    for test in fitting:
        one, other = run_test(test, greedy(values), shape, fail, n, request.seed)
        rows.append(row_of(test.name, one))
        with_fallback.append(row_of(f"{test.name}-planner-fallback", other))
    for row in with_fallback:
        rows.append(row)
    return {
        "episodes": n,
        "settings": {
            **settings_of(shape, fail),
            "left_out": [test.name for test in TESTS if test not in fitting],
        },
        "results": rows,
    }
