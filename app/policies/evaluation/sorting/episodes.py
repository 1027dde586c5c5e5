"""Runs sorting episodes to their ends, greedily, and counts what they cost.

Every episode is a row of a batch; a policy is asked only about rows that still run. Episode
``k`` of a seed starts the same whoever decides. With hand-over, an episode that calls for it is
run once more with the rule in force: a policy decides the same again, so all others are what
they were without.

A pick is *riskier* when a cell that is less likely to fail holds the same object. The fewest
moves are the exact planner's, for the very start; failed picks are attempts, never moves.

Source: METHOD 1.2, 1.5.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from app.policies.evaluation.sorting.optimal_baseline import choose_by_planner, measure
from app.policies.evaluation.sorting.planner_fallback import BatchProgressMonitor, state_keys
from app.sim.sorting.batch import SortingBatch, SortingSettings
from app.sim.sorting.kernels.task import RUNNING, SUCCESS, TIMEOUT

Index = NDArray[np.int64]
Flags = NDArray[np.bool_]
Values = Callable[[NDArray[np.uint8]], NDArray[np.float32]]
"""Q of every move from observations (n, obs_size), shape (n, n_actions)."""
Chooser = Callable[[SortingBatch, Index], Index]
"""Chooses the moves of some rows of a batch."""
HORIZON_FACTOR = SortingSettings().horizon_factor
"""Attempts per clutter cell after which an episode is cut off; counted again where a person
interferes and at a hand-over."""
ENDLESS = 1e6
"""Horizon factor of the batch itself: the end is decided here."""


class Script(Protocol):
    """What people do during the episodes of a batch."""

    def due(self, which: Index, moves: Index, solved: Flags) -> Flags:
        """Tell in which rows somebody interferes now.

        Args:
            which: Rows that just made an attempt.
            moves: Moves in each since the start or the last interference, same shape.
            solved: Whether each is at its goal, same shape.
        """

    def interfere(self, batch: SortingBatch, e: int) -> None:
        """Change row ``e``, which then runs on."""


class Undisturbed:
    """Nobody interferes."""

    def due(self, which: Index, moves: Index, solved: Flags) -> Flags:
        """Tell that nobody interferes anywhere."""
        del moves, solved
        return np.zeros(len(which), dtype=np.bool_)

    def interfere(self, batch: SortingBatch, e: int) -> None:
        """Do nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SortingEpisodes:
    """What a set of episodes came to; every array has the shape (n,)."""

    success: Flags
    """Whether the goal was reached, the last one where it changed."""
    rewards: NDArray[np.float64]
    """Sum of rewards, not discounted."""
    moves: Index
    """Attempts that changed something."""
    fewest: Index
    """Moves the exact planner needs, over all parts of the episode."""
    attempts: Index
    """All attempts."""
    expected: NDArray[np.float64]
    """Attempts the exact planner expects, over all parts of the episode."""
    picks: Index
    """Attempts that picked from the clutter."""
    failed: Index
    """Of these, the ones that failed."""
    choices: Index
    """Of the picks, those with duplicates of different risk to choose from."""
    riskier: Index
    """Of these, those that did not take the least risky duplicate."""
    planner_fallback: Flags
    """Whether the rule called for the exact planner."""
    repeated: Flags
    """Whether it did so because a state came back."""

    def with_those(self, other: Self, where: Flags) -> Self:
        """Return these episodes with some of another run in their place."""
        taken = {
            one.name: np.where(where, getattr(other, one.name), getattr(self, one.name))
            for one in fields(self)
        }
        return replace(self, **taken)

    def part(self, where: Any) -> Self:
        """Return some of these episodes."""
        return replace(
            self, **{one.name: getattr(self, one.name)[where] for one in fields(self)}
        )


def joined(parts: list[SortingEpisodes]) -> SortingEpisodes:
    """Return episodes of several batches as one set."""
    names = [one.name for one in fields(SortingEpisodes)]
    return SortingEpisodes(
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    )


def greedy(values: Values) -> Chooser:
    """Return who takes the valid move of the greatest value."""

    def choose(batch: SortingBatch, which: Index) -> Index:
        q = values(batch.observations()[which])
        return np.asarray(np.where(batch.masks()[which], q, -np.inf).argmax(axis=1))

    return choose


class _Run:
    """One run of all rows of a started batch.

    Args:
        batch: Started, and with a horizon that is never reached.
        choose: Who decides.
        script: What people do.
        obey: Whether the planner takes over where the rule calls for it.
    """

    def __init__(
        self, batch: SortingBatch, choose: Chooser, script: Script, obey: bool
    ) -> None:
        n = batch.n_envs
        self._batch, self._choose, self._script, self._obey = batch, choose, script, obey
        self._horizon = round(HORIZON_FACTOR * batch.shape.n_cells)
        self._monitor = BatchProgressMonitor(n)
        self._since = np.zeros(n, dtype=np.int64)
        self._moves_before = np.zeros(n, dtype=np.int64)
        self._rewards, self._expected = np.zeros(n), np.zeros(n)
        self._called, self._repeated = (np.zeros(n, dtype=np.bool_) for _ in range(2))
        names = ("fewest", "picks", "failed", "choices", "riskier")
        self._counts = {name: np.zeros(n, dtype=np.int64) for name in names}
        self._begin(self._running())

    def _running(self) -> Index:
        return np.flatnonzero(self._batch.rows.outcome == RUNNING)

    def _begin(self, which: Index) -> None:
        """Begin a part of an episode: its start, or what a person made of it."""
        fewest, attempts = measure(self._batch, which)
        self._counts["fewest"][which] += fewest
        self._expected[which] += attempts
        self._since[which], self._moves_before[which] = 0, self._batch.rows.moves[which]
        self._monitor.begin(which, state_keys(self._batch.rows, which), attempts)

    def to_the_end(self) -> SortingEpisodes:
        """Make attempts until every row has ended."""
        while len(which := self._running()):
            self._attempt(which)
        rows = self._batch.rows
        return SortingEpisodes(
            success=rows.outcome == SUCCESS,
            rewards=self._rewards,
            moves=rows.moves.copy(),
            attempts=rows.steps.copy(),
            expected=self._expected,
            planner_fallback=self._called,
            repeated=self._repeated,
            **self._counts,
        )

    def _attempt(self, which: Index) -> None:
        rows = self._batch.rows
        act = self._decide(which)
        picked = self._count_picks(which, act)
        before = rows.moves[which]
        every = np.zeros(self._batch.n_envs, dtype=np.int64)
        every[which] = act
        self._rewards[which] += self._batch.step(every, auto_reset=False).rew[which]
        moved = rows.moves[which] > before
        self._counts["failed"][which] += picked & ~moved
        self._since[which] += 1
        self._disturb(which)
        self._observe(which, moved)
        late = (self._since[which] >= self._horizon) & (rows.outcome[which] == RUNNING)
        rows.outcome[which[late]] = TIMEOUT

    def _decide(self, which: Index) -> Index:
        act = np.zeros(len(which), dtype=np.int64)
        over = self._monitor.planner_fallback[which] & self._obey
        if (~over).any():
            act[~over] = self._choose(self._batch, which[~over])
        if over.any():
            act[over] = choose_by_planner(self._batch, which[over])
        return act

    def _count_picks(self, which: Index, act: Index) -> Flags:
        """Count picks from the clutter and what they left; return which moves are picks."""
        rows, shape = self._batch.rows, self._batch.shape
        picked = act < shape.n_cells * shape.n_colours
        from_clutter, cells = which[picked], act[picked] // shape.n_colours
        clutter, fail = rows.clutter[from_clutter], rows.fail[from_clutter]
        mine = np.arange(len(cells))
        duplicates = clutter == clutter[mine, cells][:, None]
        least = np.where(duplicates, fail, np.inf).min(axis=1)
        most = np.where(duplicates, fail, -np.inf).max(axis=1)
        self._counts["picks"][from_clutter] += 1
        self._counts["choices"][from_clutter] += most > least
        self._counts["riskier"][from_clutter] += fail[mine, cells] > least
        return np.asarray(picked)

    def _disturb(self, which: Index) -> None:
        """Let people interfere; what was left to do before is no longer asked for."""
        rows = self._batch.rows
        moves = rows.moves[which] - self._moves_before[which]
        due = which[self._script.due(which, moves, rows.outcome[which] == SUCCESS)]
        if len(due) == 0:
            return
        fewest, attempts = measure(self._batch, due)
        self._counts["fewest"][due] -= fewest
        self._expected[due] -= attempts
        for e in due.tolist():
            self._script.interfere(self._batch, e)
        self._begin(due)

    def _observe(self, which: Index, moved: Flags) -> None:
        """Take in what the attempts gave, in rows that go on as they did."""
        rows = self._batch.rows
        same = (rows.outcome[which] == RUNNING) & (self._since[which] > 0)
        looked = which[same]
        called, repeated = self._monitor.observe_transitions(
            looked, state_keys(rows, looked), moved[same]
        )
        self._called[called] = True
        self._repeated[called[repeated]] = True
        if self._obey:
            self._since[called] = 0


def run_episodes(
    batch: SortingBatch,
    choose: Chooser,
    *,
    script: Script | None = None,
    obey: bool = False,
    only: Flags | None = None,
) -> SortingEpisodes:
    """Run the episodes of a batch that :func:`endless_batch` gave and somebody started.

    Args:
        batch: Rows at their starts.
        choose: Who decides.
        script: What people do; by default nobody does anything.
        obey: Whether the exact planner takes over where the rule calls for it.
        only: Rows that are run, shape (n_envs,); the others count as lost at once.
    """
    if only is not None:
        batch.rows.outcome[~only] = TIMEOUT
    return _Run(batch, choose, script or Undisturbed(), obey).to_the_end()
