"""Run sorting episodes to their ends and count moves, attempts and risks.

Each episode is one environment of a batch; a policy is queried for running environments only.
Episode ``k`` of a seed has the same start for every policy. Episodes that trigger the planner
fallback are run a second time with it; a policy is deterministic, so that all others are the
same with and without it.

A pick is *riskier* if a slot with a lower failure probability holds an identical object. The
fewest moves are those of the exact planner; failed picks are attempts, not moves.

Source: docs/method.md 1.2, 1.5.
"""

from collections.abc import Callable
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from app.policies.evaluation.sorting.optimal_baseline import choose_by_planner, measure
from app.policies.evaluation.sorting.planner_fallback import BatchProgressMonitor, state_keys
from app.policies.evaluation.statistics import Flags, Index
from app.sim.core.arrays import Vec
from app.sim.sorting.batch import SortingBatch, SortingSettings
from app.sim.sorting.benchmark_tasks import TESTS, SortingTest
from app.sim.sorting.kernels.task import RUNNING, SUCCESS, TIMEOUT

Values = Callable[[NDArray[np.uint8]], NDArray[np.float32]]
"""Q of every move from observations (n, obs_size), shape (n, n_actions)."""
Chooser = Callable[[SortingBatch, Index], Index]
"""Selects the moves of some environments of a batch."""
HORIZON_FACTOR = SortingSettings().horizon_factor
"""Attempts per clutter slot until an episode ends; the count restarts at an interference and at
a planner fallback."""
ENDLESS = 1e6
"""Horizon factor of the batch itself; this module ends the episodes."""


class ScriptedInterferences:
    """Interferences of a test's person in all environments of one run.

    Args:
        n: Number of environments.
        seed: Seed; the interferences of environment ``e`` are fixed by (seed, test, e).
    """

    def __init__(self, test: SortingTest, n: int, seed: int) -> None:
        self._test, self._seed = test, seed
        self._next = np.zeros(n, dtype=np.int64)
        after = [one.after_moves for one in test.interferences]
        self._after = np.array([*(np.inf if one is None else one for one in after), np.nan])

    def due(self, which: Index, moves: Index, solved: Flags) -> Flags:
        """Return which environments have an interference now; at a goal all have.

        Args:
            which: Environments that just made an attempt, shape (k,).
            moves: Moves of each since the start or the last interference, shape (k,).
            solved: Whether each is at its goal, shape (k,).
        """
        after = self._after[self._next[which]]
        return np.asarray(~np.isnan(after) & (solved | (moves >= after)))

    def interfere(self, batch: SortingBatch, e: int) -> None:
        """Apply the next interference to environment ``e``, whose episode continues."""
        k = int(self._next[e])
        rng = np.random.default_rng((self._seed, TESTS.index(self._test), e, 1 + k))
        change = self._test.interferences[k].change
        batch.change(e, change(batch.state_of(e), batch.shape, rng))
        self._next[e] += 1


class SortingEpisodes(NamedTuple):
    """Results of a set of episodes; every array has the shape (n,)."""

    success: Flags
    """Whether the goal was reached, the last one if it changed."""
    rewards: Vec
    """Sum of rewards, not discounted."""
    moves: Index
    """Attempts that moved an object."""
    fewest: Index
    """Moves of the exact planner, over all parts of the episode."""
    attempts: Index
    """All attempts."""
    expected: Vec
    """Expected attempts of the exact planner, over all parts of the episode."""
    picks: Index
    """Attempts to pick from the clutter."""
    failed: Index
    """Failed picks."""
    choices: Index
    """Picks among duplicates of different risk."""
    riskier: Index
    """Picks of a duplicate other than the least risky one."""
    planner_fallback: Flags
    """Whether the progress monitor triggered the planner fallback."""
    repeated: Flags
    """Whether a repeated state was the reason."""

    def replaced(self, other: Self, where: Flags) -> Self:
        """Return these episodes with those of another run where ``where`` is true."""
        pairs = zip(other, self, strict=True)
        return type(self)(*(np.where(where, theirs, ours) for theirs, ours in pairs))

    def part(self, where: Any) -> Self:
        """Return selected episodes."""
        return type(self)(*(values[where] for values in self))


def joined(parts: list[SortingEpisodes]) -> SortingEpisodes:
    """Return episodes of several batches as one set."""
    return SortingEpisodes(*map(np.concatenate, zip(*parts, strict=True)))


def greedy(values: Values) -> Chooser:
    """Return the policy that selects the valid move with the greatest value."""

    def choose(batch: SortingBatch, which: Index) -> Index:
        q = values(batch.observations()[which])
        return np.asarray(np.where(batch.masks()[which], q, -np.inf).argmax(axis=1))

    return choose


class _Run:
    """One run of all environments of a batch; arguments as :func:`run_episodes`."""

    def __init__(
        self,
        batch: SortingBatch,
        choose: Chooser,
        script: ScriptedInterferences | None,
        fallback: bool,
    ) -> None:
        n = batch.n_envs
        self._batch, self._choose, self._script = batch, choose, script
        self._fallback = fallback
        self._horizon = round(HORIZON_FACTOR * batch.shape.n_slots)
        self._monitor = BatchProgressMonitor(n)
        self._since = np.zeros(n, dtype=np.int64)
        self._moves_before = np.zeros(n, dtype=np.int64)
        self._rewards, self._expected = np.zeros(n), np.zeros(n)
        self._called, self._repeated = (np.zeros(n, dtype=np.bool_) for _ in range(2))
        names = ("fewest", "picks", "failed", "choices", "riskier")
        self._counts = {name: np.zeros(n, dtype=np.int64) for name in names}
        self._begin(self._running())

    def _running(self) -> Index:
        return np.flatnonzero(self._batch.envs.outcome == RUNNING)

    def _begin(self, which: Index) -> None:
        """Begin a part of episodes, at the start or after an interference."""
        fewest, attempts = measure(self._batch, which)
        self._counts["fewest"][which] += fewest
        self._expected[which] += attempts
        self._since[which], self._moves_before[which] = 0, self._batch.envs.moves[which]
        self._monitor.begin(which, state_keys(self._batch.envs, which), attempts)

    def run(self) -> SortingEpisodes:
        """Make attempts until every episode has ended."""
        while len(which := self._running()):
            self._attempt(which)
        envs = self._batch.envs
        return SortingEpisodes(
            success=envs.outcome == SUCCESS,
            rewards=self._rewards,
            moves=envs.moves.copy(),
            attempts=envs.steps.copy(),
            expected=self._expected,
            planner_fallback=self._called,
            repeated=self._repeated,
            **self._counts,
        )

    def _attempt(self, which: Index) -> None:
        envs = self._batch.envs
        act = self._decide(which)
        picked = self._count_picks(which, act)
        before = envs.moves[which]
        every = np.zeros(self._batch.n_envs, dtype=np.int64)
        every[which] = act
        self._rewards[which] += self._batch.step(every, auto_reset=False).rew[which]
        moved = envs.moves[which] > before
        self._counts["failed"][which] += picked & ~moved
        self._since[which] += 1
        self._disturb(which)
        self._observe(which, moved)
        late = (self._since[which] >= self._horizon) & (envs.outcome[which] == RUNNING)
        envs.outcome[which[late]] = TIMEOUT

    def _decide(self, which: Index) -> Index:
        act = np.zeros(len(which), dtype=np.int64)
        over = self._monitor.planner_fallback[which] & self._fallback
        if (~over).any():
            act[~over] = self._choose(self._batch, which[~over])
        if over.any():
            act[over] = choose_by_planner(self._batch, which[over])
        return act

    def _count_picks(self, which: Index, act: Index) -> Flags:
        """Count picks from the clutter and their risks; return which moves are picks."""
        envs, shape = self._batch.envs, self._batch.shape
        picked = act < shape.n_slots * shape.n_colours
        from_clutter, slots = which[picked], act[picked] // shape.n_colours
        clutter, fail = envs.clutter[from_clutter], envs.fail[from_clutter]
        mine = np.arange(len(slots))
        duplicates = clutter == clutter[mine, slots][:, None]
        least = np.where(duplicates, fail, np.inf).min(axis=1)
        most = np.where(duplicates, fail, -np.inf).max(axis=1)
        self._counts["picks"][from_clutter] += 1
        self._counts["choices"][from_clutter] += most > least
        self._counts["riskier"][from_clutter] += fail[mine, slots] > least
        return np.asarray(picked)

    def _disturb(self, which: Index) -> None:
        """Apply interferences; the rest of the previous part is removed from the minimum."""
        if self._script is None:
            return
        envs = self._batch.envs
        moves = envs.moves[which] - self._moves_before[which]
        due = which[self._script.due(which, moves, envs.outcome[which] == SUCCESS)]
        if len(due) == 0:
            return
        fewest, attempts = measure(self._batch, due)
        self._counts["fewest"][due] -= fewest
        self._expected[due] -= attempts
        for e in due.tolist():
            self._script.interfere(self._batch, e)
        self._begin(due)

    def _observe(self, which: Index, moved: Flags) -> None:
        """Update the progress monitor in running environments without interference."""
        envs = self._batch.envs
        same = (envs.outcome[which] == RUNNING) & (self._since[which] > 0)
        observed = which[same]
        called, repeated = self._monitor.observe_transitions(
            observed, state_keys(envs, observed), moved[same]
        )
        self._called[called] = True
        self._repeated[called[repeated]] = True
        if self._fallback:
            self._since[called] = 0


def run_episodes(
    batch: SortingBatch,
    choose: Chooser,
    *,
    script: ScriptedInterferences | None = None,
    fallback: bool = False,
    only: Flags | None = None,
) -> SortingEpisodes:
    """Run the episodes of a batch to their ends.

    Args:
        batch: Environments at their starts, with the horizon factor ENDLESS.
        choose: Policy.
        script: Interferences; none by default.
        fallback: Whether the exact planner replaces the policy once the monitor triggers.
        only: Environments to run, shape (n_envs,); the others time out at once.
    """
    if only is not None:
        batch.envs.outcome[~only] = TIMEOUT
    return _Run(batch, choose, script, fallback).run()


def run_with_fallback(
    batch: SortingBatch,
    start: Callable[[], object],
    choose: Chooser,
    script: Callable[[], ScriptedInterferences | None] = lambda: None,
) -> tuple[SortingEpisodes, SortingEpisodes]:
    """Return the same episodes without and with planner fallback.

    Args:
        batch: Environments, with the horizon factor ENDLESS.
        start: Puts all environments at their starts.
        choose: Policy.
        script: Returns the interferences of one run.
    """
    start()
    alone = run_episodes(batch, choose, script=script())
    called = alone.planner_fallback
    if not called.any():
        return alone, alone
    start()
    again = run_episodes(batch, choose, script=script(), fallback=True, only=called)
    return alone, alone.replaced(again, called)
