"""Run reach episodes to their ends under any controller, and count the outcomes.

Episode ``i`` of a seed is played by row ``i mod N_ENVS`` of a batch as its number ``i //
N_ENVS``: its people and their whole motion, and its goal, are the same whoever moves the robot,
whatever the time limit, and however many episodes are played.

Source: METHOD 2.3 and 2.6.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.policies.evaluation.pick.recorded_people import Trace, recheck
from app.policies.evaluation.statistics import mean_of, wilson
from app.policies.inference.controllers import Controller
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.scenario.kernels import episode as kernel

Index = NDArray[np.int64]
N_ENVS = 500
"""Most rows of a batch: which person an episode meets hangs on it, so it is never varied."""
REPORTED_TIME_LEFT_S = 5.0
"""Most time left that a policy is told [s]: what episodes of training have. In longer episodes
it is told this much until no more is left."""
N_RECHECKED = 200
"""Episodes whose poses go to FCL, at most N_ENVS."""
RECHECK_PARTS = 2
"""Poses per control period that go to FCL: one every 10 ms."""
ENDS = (kernel.SUCCESS, kernel.COLLISION, kernel.TIMEOUT, kernel.UNFEASIBLE)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReachEpisodes:
    """How a set of episodes went; row ``i`` of every array is episode ``i``."""

    goals: Vec
    """Where the tcp had to be [m], shape (n, 3)."""
    outcome: Index
    """Index into OUTCOMES, shape (n,)."""
    duration_s: Vec
    """Time to the end [s], shape (n,)."""
    start_m: Vec
    """Distance of robot and people at the start [m], at most 0 in contact, shape (n,)."""
    redrawn: Index
    """Starts that the rule rejected before the one played, shape (n,)."""
    limit_s: float
    """Longest episode [s]."""

    def rates(self, which: Any = slice(None)) -> dict[str, Any]:
        """Return how some of the episodes ended, rates with 95 % intervals."""
        outcome = self.outcome[which]
        n, counts = len(outcome), np.bincount(outcome, minlength=max(ENDS) + 1)
        unfeasible = int(counts[kernel.UNFEASIBLE])
        return {
            "n": n,
            "success": wilson(int(counts[kernel.SUCCESS]), n),
            "collision": wilson(int(counts[kernel.COLLISION]), n),
            "timeout": wilson(int(counts[kernel.TIMEOUT]), n),
            **({"unfeasible": wilson(unfeasible, n)} if unfeasible else {}),
        }

    def row(self, name: str) -> dict[str, Any]:
        """Return the result row of these episodes."""
        times = self.duration_s[self.outcome == kernel.SUCCESS]
        spread = np.percentile(times, [50, 95]).tolist() if len(times) else (None, None)
        return {
            "name": name,
            **self.rates(),
            "time_to_goal_s": float(times.mean()) if len(times) else None,
            "time_to_goal_median_s": spread[0],
            "time_to_goal_p95_s": spread[1],
        }

    def begun_in_contact(self) -> dict[str, float]:
        """Return the share of episodes that begin in contact: no policy can help."""
        return wilson(int((self.start_m <= 0.0).sum()), len(self.outcome))


def against(one: ReachEpisodes, other: ReachEpisodes) -> dict[str, float] | None:
    """Return by how much the success rate of ``one`` exceeds that of ``other``, paired.

    Both have the same people, episode by episode; the 95 % interval is that of the mean of the
    differences.
    """
    won = [(run.outcome == kernel.SUCCESS).astype(np.float64) for run in (one, other)]
    return mean_of(won[0] - won[1])


class _Play:
    """One run of a list of episodes.

    Args:
        batch: Not started.
        controller: Controller of the robots.
        goals: Goal of each episode [m], shape (n, 3).
    """

    def __init__(self, batch: ReachBatch, controller: Controller, goals: Vec) -> None:
        n, rows = len(goals), batch.n_envs
        self._batch, self._controller, self._goals = batch, controller, goals
        self._limit = batch.settings.time_limit_s
        self._playing = np.arange(rows)
        self._patience = np.zeros(rows)
        self._steps = np.zeros(rows, dtype=np.int64)
        self._outcome, self._redrawn = np.zeros((2, n), dtype=np.int64)
        self._duration, self._start = np.zeros((2, n))
        batch.reset()
        self._begin(np.arange(rows))

    def _begin(self, rows: Index) -> None:
        """Give rows that just started their goals, and note how they start."""
        state, which = self._batch.state, self._playing[rows]
        self._start[which] = state.clear[rows, 0]
        self._redrawn[which] = state.n_redrawn[rows]
        self._steps[rows] = 0
        self._patience[rows] = max(0.0, self._limit - REPORTED_TIME_LEFT_S)
        state.time_left[rows] = min(self._limit, REPORTED_TIME_LEFT_S)
        self._batch.set_goals(rows, self._goals[which])

    def _period(self) -> None:
        batch, dt = self._batch, self._batch.arm.dt
        act = self._controller.acts(batch)
        spare = np.minimum(self._patience, dt)
        np.add(batch.state.time_left, spare, out=batch.state.time_left)
        self._patience -= spare
        ended = batch.step(act).ended
        self._steps += 1
        rows = np.flatnonzero((ended != kernel.RUNNING) & (self._playing < len(self._goals)))
        if len(rows):
            which = self._playing[rows]
            self._outcome[which] = ended[rows]
            self._duration[which] = dt * self._steps[rows]
            self._playing[rows] += batch.n_envs
            more = self._playing[rows] < len(self._goals)
            batch.state.outcome[rows[~more]] = kernel.TIMEOUT  # nobody need move these
            self._begin(rows[more])

    def to_the_end(self) -> ReachEpisodes:
        """Play until every episode has ended."""
        while (self._playing < len(self._goals)).any():
            self._period()
        return ReachEpisodes(
            goals=self._goals,
            outcome=self._outcome,
            duration_s=self._duration,
            start_m=self._start,
            redrawn=self._redrawn,
            limit_s=self._limit,
        )


def play(
    cell: Cell, settings: ReachSettings, controller: Controller, goals: Vec, seed: int
) -> ReachEpisodes:
    """Play one episode per goal.

    Args:
        cell: Work cell.
        settings: Starts, ends, people; where goals are drawn from does not matter.
        controller: Controller of the robots.
        goals: Goal of each episode [m], shape (n, 3).
        seed: Seed of the episodes.
    """
    batch = ReachBatch(cell, min(N_ENVS, len(goals)), seed, settings)
    return _Play(batch, controller, goals).to_the_end()


def recheck_contacts(
    cell: Cell, settings: ReachSettings, controller: Controller, goals: Vec, seed: int
) -> dict[str, int]:
    """Play the first episodes once more and ask FCL whether the kernels missed a contact.

    Arguments as :func:`play`; at most N_RECHECKED episodes are played.
    """
    n = min(len(goals), N_RECHECKED)
    batch = ReachBatch(cell, n, seed, settings)
    trace = Trace(batch, n, RECHECK_PARTS)
    batch.reset()
    batch.set_goals(np.arange(n), goals[:n])
    while (rows := np.flatnonzero(batch.state.outcome == kernel.RUNNING)).size:
        act = controller.acts(batch)
        trace.before(rows)
        batch.step(act, auto_reset=False)
        trace.after()
    return recheck(batch.cell, trace.trajectories())


def target_goals(targets: Vec, n: int) -> Vec:
    """Return the goals of ``n`` episodes that go round all targets [m], shape (n, 3)."""
    return np.asarray(targets[np.arange(n) % len(targets)])


def random_goals(low: Vec, high: Vec, n: int, seed: int) -> Vec:
    """Return ``n`` goals drawn evenly from a box [m], shape (n, 3); fewer are the first ones.

    Args:
        low: Lower corner [m], shape (3,).
        high: Upper corner [m], shape (3,).
        n: How many.
        seed: Seed of the episodes; training draws from other streams.
    """
    rng = np.random.default_rng([seed, 0x60A15])
    return np.asarray(low + (high - low) * rng.random((n, 3)))
