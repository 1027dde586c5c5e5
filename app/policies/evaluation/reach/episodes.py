"""Run reach episodes to their ends under any controller, and count the outcomes.

Episode ``i`` of a seed runs in environment ``i mod N_ENVS`` of a batch as its episode number
``i // N_ENVS``. Its goal, its people and their motion do not depend on the controller, the time
limit or the number of episodes.

Source: docs/method.md 2.3 and 2.6.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.policies.evaluation.contact_recheck import Trace, recheck
from app.policies.evaluation.statistics import mean_of, outcome_intervals, wilson
from app.policies.inference.controllers import Controller
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.reach.blocked_batch import new_reach_batch
from app.sim.scenario.kernels import episode as kernel

Index = NDArray[np.int64]
N_ENVS = 500
"""Maximum number of environments; fixed, because the people of an episode depend on it."""
MAX_TIME_LEFT_S = 5.0
"""Maximum remaining time that a policy observes [s]: the time limit of training episodes."""
N_RECHECKED = 200
"""Number of episodes checked again with FCL, at most N_ENVS."""
RECHECK_PARTS = 2
"""Poses per control period checked again with FCL: one every 10 ms."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReachEpisodes:
    """Outcomes of a set of episodes; entry ``i`` of every array is episode ``i``."""

    goals: Vec
    """Goal of the TCP [m], shape (n, 3)."""
    outcome: Index
    """Index into OUTCOMES, shape (n,)."""
    duration_s: Vec
    """Time to the end [s], shape (n,)."""
    start_m: Vec
    """Clearance of robot and people at the start [m], at most 0 in contact, shape (n,)."""
    redrawn: Index
    """Number of initial states rejected by the start rule, shape (n,)."""
    limit_s: float
    """Time limit [s]."""

    def rates(self, which: Any = slice(None)) -> dict[str, Any]:
        """Return the rates of outcomes of selected episodes with 95 % intervals."""
        return outcome_intervals(self.outcome[which])

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

    def initial_contact(self) -> dict[str, float]:
        """Return the share of episodes that begin in contact, which no policy can solve."""
        return wilson(int((self.start_m <= 0.0).sum()), len(self.outcome))


def against(one: ReachEpisodes, other: ReachEpisodes) -> dict[str, float] | None:
    """Return the paired difference of success rates with the 95 % interval of its mean.

    Both sets have the same people, episode by episode.
    """
    won = [(run.outcome == kernel.SUCCESS).astype(np.float64) for run in (one, other)]
    return mean_of(won[0] - won[1])


class _Queue:
    """Run a list of episodes in a batch with fewer environments.

    Args:
        batch: Environments, not reset.
        controller: Controller of the robots.
        goals: Goal of each episode [m], shape (n, 3).
    """

    def __init__(self, batch: ReachBatch, controller: Controller, goals: Vec) -> None:
        n, n_envs = len(goals), batch.n_envs
        self._batch, self._controller, self._goals = batch, controller, goals
        self._limit = batch.settings.time_limit_s
        self._episode = np.arange(n_envs)
        self._hidden = np.zeros(n_envs)
        """Remaining time beyond the observed one [s], shape (n_envs,)."""
        self._steps = np.zeros(n_envs, dtype=np.int64)
        self._outcome, self._redrawn = np.zeros((2, n), dtype=np.int64)
        self._duration, self._start = np.zeros((2, n))
        batch.reset()
        self._begin(np.arange(n_envs))

    def _begin(self, envs: Index) -> None:
        """Set goals and remaining times of environments that were reset."""
        state, which = self._batch.state, self._episode[envs]
        self._start[which] = state.clear[envs, 0]
        self._redrawn[which] = state.n_redrawn[envs]
        self._steps[envs] = 0
        self._hidden[envs] = max(0.0, self._limit - MAX_TIME_LEFT_S)
        state.time_left[envs] = min(self._limit, MAX_TIME_LEFT_S)
        self._batch.set_goals(envs, self._goals[which])

    def _period(self) -> None:
        batch, dt = self._batch, self._batch.arm.dt
        act = self._controller.acts(batch)
        spent = np.minimum(self._hidden, dt)
        np.add(batch.state.time_left, spent, out=batch.state.time_left)
        self._hidden -= spent
        ended = batch.step(act).ended
        self._steps += 1
        envs = np.flatnonzero((ended != kernel.RUNNING) & (self._episode < len(self._goals)))
        if len(envs):
            which = self._episode[envs]
            self._outcome[which] = ended[envs]
            self._duration[which] = dt * self._steps[envs]
            self._episode[envs] += batch.n_envs
            more = self._episode[envs] < len(self._goals)
            batch.state.outcome[envs[~more]] = kernel.TIMEOUT
            self._begin(envs[more])

    def run(self) -> ReachEpisodes:
        """Run until every episode has ended."""
        while (self._episode < len(self._goals)).any():
            self._period()
        return ReachEpisodes(
            goals=self._goals,
            outcome=self._outcome,
            duration_s=self._duration,
            start_m=self._start,
            redrawn=self._redrawn,
            limit_s=self._limit,
        )


def run_episodes(
    cell: Cell, settings: ReachSettings, controller: Controller, goals: Vec, seed: int
) -> ReachEpisodes:
    """Run one episode per goal.

    Args:
        settings: Start, end and people; their rule for goals is not used.
        controller: Controller of the robots.
        goals: Goal of each episode [m], shape (n, 3).
    """
    batch = new_reach_batch(cell, min(N_ENVS, len(goals)), seed, settings)
    return _Queue(batch, controller, goals).run()


def run_to_end(
    batch: ReachBatch,
    acts: Callable[[Any], NDArray[np.float32]],
    *,
    before: Callable[[Index], object] = lambda _envs: None,
    after: Callable[[], object] = lambda: None,
    features: bool = True,
) -> None:
    """Step started environments until every episode has ended.

    Args:
        batch: Environments at the start of their episodes.
        acts: Returns the actions of a batch, shape (n_envs, 6).
        before: Called before each step with the running environments, shape (k,).
        after: Called after each step.
        features: Whether steps compute the features of observations.
    """
    while (envs := np.flatnonzero(batch.state.outcome == kernel.RUNNING)).size:
        before(envs)
        batch.step(acts(batch), auto_reset=False, features=features)
        after()


def recheck_contacts(
    cell: Cell, settings: ReachSettings, controller: Controller, goals: Vec, seed: int
) -> dict[str, int]:
    """Run the first N_RECHECKED episodes again and check with FCL for missed contacts.

    Arguments as :func:`run_episodes`.
    """
    n = min(len(goals), N_RECHECKED)
    batch = new_reach_batch(cell, n, seed, settings)
    trace = Trace(batch, n, RECHECK_PARTS)
    batch.reset()
    batch.set_goals(np.arange(n), goals[:n])
    run_to_end(batch, controller.acts, before=trace.before, after=trace.after)
    return recheck(batch.cell, trace.trajectories())


def target_goals(targets: Vec, n: int) -> Vec:
    """Return the goals of ``n`` episodes that cycle through the targets [m], shape (n, 3)."""
    return np.asarray(targets[np.arange(n) % len(targets)])


def random_goals(low: Vec, high: Vec, n: int, seed: int) -> Vec:
    """Return ``n`` uniform random goals in a box [m], shape (n, 3); fewer are the first ones.

    Args:
        low: Lower corner [m], shape (3,).
        high: Upper corner [m], shape (3,).
        n: Number of goals.
        seed: Seed of the episodes; training uses other random streams.
    """
    rng = np.random.default_rng([seed, 0x60A15])
    return np.asarray(low + (high - low) * rng.random((n, 3)))
