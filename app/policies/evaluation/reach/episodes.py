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
from app.policies.evaluation.statistics import Index, mean_of, outcome_intervals, rate_of
from app.policies.inference.controllers import Controller
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.reach.batch import ReachBatch, ReachSettings, goal_region_of
from app.sim.reach.blocked_batch import new_reach_batch
from app.sim.scenario.kernels import episode as kernel

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
        return rate_of(self.start_m <= 0.0)


def against(one: ReachEpisodes, other: ReachEpisodes) -> dict[str, float] | None:
    """Return the paired difference of success rates with the 95 % interval of its mean.

    Both sets have the same people, episode by episode.
    """
    won = [(run.outcome == kernel.SUCCESS).astype(np.float64) for run in (one, other)]
    return mean_of(won[0] - won[1])


def run_episodes(
    cell: Cell, settings: ReachSettings, controller: Controller, goals: Vec, seed: int
) -> ReachEpisodes:
    """Run one episode per goal, in a batch with fewer environments.

    Args:
        settings: Start, end and people; their rule for goals is not used.
        goals: Goal of each episode [m], shape (n, 3).
    """
    n, n_envs, limit = len(goals), min(N_ENVS, len(goals)), settings.time_limit_s
    batch = new_reach_batch(cell, n_envs, seed, settings)
    state, dt, episode = batch.state, batch.arm.dt, np.arange(n_envs)
    hidden, steps = np.zeros(n_envs), np.zeros(n_envs, dtype=np.int64)
    outcome, redrawn = np.zeros((2, n), dtype=np.int64)
    duration, start = np.zeros((2, n))

    def begin(envs: Index) -> None:
        """Set goals and remaining times of environments that were reset."""
        which = episode[envs]
        start[which], redrawn[which] = state.clear[envs, 0], state.n_redrawn[envs]
        steps[envs] = 0
        hidden[envs] = max(0.0, limit - MAX_TIME_LEFT_S)  # beyond the observed time [s]
        state.time_left[envs] = min(limit, MAX_TIME_LEFT_S)
        batch.set_goals(envs, goals[which])

    batch.reset()
    begin(episode.copy())
    while (episode < n).any():
        act = controller.acts(batch)
        spent = np.minimum(hidden, dt)
        state.time_left[:] += spent
        hidden -= spent
        ended = batch.step(act).ended
        steps += 1
        envs = np.flatnonzero((ended != kernel.RUNNING) & (episode < n))
        outcome[episode[envs]] = ended[envs]
        duration[episode[envs]] = dt * steps[envs]
        episode[envs] += n_envs
        more = episode[envs] < n
        state.outcome[envs[~more]] = kernel.TIMEOUT
        if more.any():
            begin(envs[more])
    return ReachEpisodes(
        goals=goals,
        outcome=outcome,
        duration_s=duration,
        start_m=start,
        redrawn=redrawn,
        limit_s=limit,
    )


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


def random_goals(cell: Cell, n: int, seed: int) -> Vec:
    """Return ``n`` uniform random goals in the box of a cell's goals [m], shape (n, 3).

    Fewer goals of a seed are the first ones. Training uses other random streams.
    """
    low, high = goal_region_of(cell).box()
    rng = np.random.default_rng([seed, 0x60A15])
    return np.asarray(low + (high - low) * rng.random((n, 3)))
