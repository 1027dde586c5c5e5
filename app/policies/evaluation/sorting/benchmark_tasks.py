"""Protocol ``sorting-tests``: many episodes of each benchmark task of the thesis (3.4.3).

Rows ``test-1`` to ``test-6`` are the policy alone; in ``test-1-planner-fallback`` etc. the
exact planner replaces a cycling policy. Picks fail with the probabilities of the work cell. An
episode is a success when the last goal is reached, and counts in ``fewest`` when every part of
it took as few moves as the exact planner. Each part has 4 K attempts.

Source: thesis 3.4.3, docs/method.md 1.5. Deviates: the source shows one run of each.
"""

from typing import Any

import numpy as np

from app.errors import InvalidInput
from app.policies.evaluation.rows import EvaluationRequest, Json
from app.policies.evaluation.sorting.episodes import (
    ENDLESS,
    Chooser,
    Flags,
    Index,
    SortingEpisodes,
    Values,
    greedy,
    run_with_fallback,
)
from app.policies.evaluation.sorting.grid import settings_of
from app.policies.evaluation.statistics import mean_of, share_of, wilson
from app.sim.core.arrays import Vec
from app.sim.sorting.batch import SortingBatch, SortingSettings
from app.sim.sorting.benchmark_tasks import TESTS, SortingTest
from app.sim.sorting.state import SortingShape

DEFAULT_EPISODES = 1000


class ScriptedInterferences:
    """Interferences of a test's person in all environments of one run.

    Args:
        n: Number of environments.
        seed: Seed; the interferences of environment ``e`` are fixed by (seed, test, e).
    """

    def __init__(self, test: SortingTest, n: int, seed: int) -> None:
        self._test, self._seed = test, seed
        self._next = np.zeros(n, dtype=np.int64)
        self._after = np.array(
            [
                np.inf if one.after_moves is None else one.after_moves
                for one in test.interferences
            ]
            + [np.nan]
        )

    def due(self, which: Index, moves: Index, solved: Flags) -> Flags:
        """Return the environments with an interference now; at a goal there always is one."""
        after = self._after[self._next[which]]
        return np.asarray(~np.isnan(after) & (solved | (moves >= after)))

    def interfere(self, batch: SortingBatch, e: int) -> None:
        """Apply the next interference to environment ``e``."""
        k = int(self._next[e])
        rng = _random(self._test, self._seed, e, 1 + k)
        change = self._test.interferences[k].change
        batch.change(e, change(batch.state_of(e), batch.shape, rng))
        self._next[e] += 1


def _random(test: SortingTest, seed: int, e: int, part: int) -> np.random.Generator:
    return np.random.default_rng((seed, TESTS.index(test), e, part))


def start_test(batch: SortingBatch, test: SortingTest, fail: Vec, seed: int) -> None:
    """Set every environment of a batch to a start of a test."""
    batch.reset()
    for e in range(batch.n_envs):
        batch.put(e, test.start(batch.shape, fail, _random(test, seed, e, 0)))


def run_test(
    test: SortingTest, choose: Chooser, shape: SortingShape, fail: Vec, n: int, seed: int
) -> tuple[SortingEpisodes, SortingEpisodes]:
    """Return the episodes of a test without and with planner fallback."""
    batch = SortingBatch(shape, fail, n, seed, SortingSettings(horizon_factor=ENDLESS))

    def started() -> SortingBatch:
        start_test(batch, test, fail, seed)
        return batch

    def script() -> ScriptedInterferences:
        return ScriptedInterferences(test, n, seed)

    return run_with_fallback(started, choose, script)


def row_of(name: str, episodes: SortingEpisodes) -> dict[str, Any]:
    """Return a row of the result."""
    n, good = len(episodes.success), episodes.part(episodes.success)
    return {
        "name": name,
        "n": n,
        "success": wilson(len(good.success), n),
        "timeout": wilson(n - len(good.success), n),
        "fewest": wilson(int((good.moves == good.fewest).sum()), n),
        "moves_over_minimum": mean_of(good.moves / good.fewest),
        "riskier_pick": share_of(episodes.riskier, episodes.picks),
        "safest_identical": share_of(episodes.choices - episodes.riskier, episodes.choices),
        "failed_pick": share_of(episodes.failed, episodes.picks),
        "planner_fallback": wilson(int(episodes.planner_fallback.sum()), n),
        "repeated": wilson(int(episodes.repeated.sum()), n),
    }


def trials(values: Values, shape: SortingShape, fail: Vec, request: EvaluationRequest) -> Json:
    """Evaluate a policy on the tests; tests that need a larger task are left out.

    Args:
        values: Q of every move, from observations.
        shape: Size of the task.
        fail: Failure probabilities of the clutter slots, shape (K,).
        request: Its episodes are those of each test, by default 1000.

    Raises:
        InvalidInput: The task is too small for all six.
    """
    n = request.episodes or DEFAULT_EPISODES
    fitting = [test for test in TESTS if test.fits(shape)]
    if not fitting:
        raise InvalidInput("n_cells", shape.n_cells, "must be enough for one of the six tests")
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
