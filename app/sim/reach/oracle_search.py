"""How much is possible at all: search by hindsight over replays of the same episodes.

People do not react to the robot, so an episode's whole human motion is fixed when it starts.
Copies of its first state are played again and again, every copy moved differently, until one
reaches the goal. What is found is possible; it says nothing about whether anyone could have
known. A replay is one of

- *scripted*: to some posture (home, the start of a retreat, anywhere) until some moment, then
  straight to one of the postures at the goal;
- *disturbed*: to some posture until some moment, then a policy, with noise on its actions.

For what no replay solves, two bounds (METHOD 2.6, ``reach-oracle``): an episode is *never*
possible where the goal is covered by a person, or the robot's base is touched, before anybody
could have arrived and until the end; and its collision is *unavoided* where all replays,
retreats among them, end in one.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.planning.goal_configurations import goal_configurations
from app.sim.reach.batch import ReachBatch
from app.sim.robot.kernels.arm import Arm
from app.sim.scenario.kernels.episode import COLLISION, RUNNING, SUCCESS, SUCCESS_DISTANCE

N_COPIES = 4096
"""Rows of the batch that replays are played in."""
GAIN = 5.0
"""Speed wanted of a joint per distance from its posture [1/s]; the limits cut it."""
SPREAD = 0.09
"""Postures at a goal have the tcp within this distance of it [m]; success counts within 0.1."""
AT_HOME = 0.3
"""Share of scripted replays that wait at home first."""
NEAR_HOME = 0.4
"""Share of those that first go to a posture within NEARBY of home."""
NEARBY = np.array([1.5, 0.8, 0.8, 0.8, 0.8, 0.0])
"""How far such a posture may be from home [rad]."""
LONGEST_WAIT = 4.0
"""Latest moment at which a replay turns to its goal [s]."""
SIGMAS = (0.0, 0.1, 0.3)
"""Spreads of the noise on a policy's actions."""
CORRELATION = 0.9
"""Correlation of the noise from period to period."""

Index = NDArray[np.int64]
Acts = Callable[[ReachBatch], NDArray[np.float32]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Resimulations:
    """How many copies of each episode did what."""

    n: Index
    """Resimulations played, shape (n,)."""
    reached: Index
    """Resimulations that came to the goal, shape (n,)."""
    untouched: Index
    """Resimulations without a collision, shape (n,)."""
    soonest: Vec
    """Least time to the goal [s]; infinity where none came, shape (n,)."""


def copy_rows(source: Any, rows: Index, target: Any, first: int = 0) -> None:
    """Copy rows of a state, a tuple of arrays or of such tuples, into another.

    Args:
        source: From where.
        rows: Rows of the source, shape (k,).
        target: Of the same kind.
        first: Row of the target where the copies begin.
    """
    for old, new in zip(source, target, strict=True):
        if isinstance(old, tuple):
            copy_rows(old, rows, new, first)
        else:
            new[first : first + len(rows)] = old[rows]


def sample_detours(
    arm: Arm, rng: np.random.Generator, k: int, longest: float = LONGEST_WAIT
) -> tuple[Vec, Vec]:
    """Draw where replays go first [rad], shape (k, 6), and until when [s], shape (k,)."""
    kind, home = rng.uniform(size=k), np.repeat(np.array(arm.home)[None], k, axis=0)
    near = home + rng.uniform(-1.0, 1.0, (k, 6)) * NEARBY
    low, high = np.maximum(arm.limits.q_min, -np.pi), np.minimum(arm.limits.q_max, np.pi)
    anywhere = rng.uniform(low, high, (k, 6))
    anywhere[:, 5] = near[:, 5] = home[:, 5]
    first = np.where((kind < AT_HOME + NEAR_HOME)[:, None], near, anywhere)
    first = np.where((kind < AT_HOME)[:, None], home, first)
    return np.clip(first, arm.limits.q_min, arm.limits.q_max), rng.uniform(0.0, longest, k)


def toward(arm: Arm, q: Vec, aim: Vec) -> NDArray[np.float32]:
    """Return actions, shares of the speed limits, that lead straight to postures [rad]."""
    return np.clip(GAIN * (aim - q) / arm.limits.qd_max, -1.0, 1.0).astype(np.float32)


class OracleSearch:
    """Resimulations the episodes of one batch, as it was when they started.

    Args:
        batch: Rows at the start of their episodes; not changed.
        seed: Seed of the search.
        n_copies: Rows of the batch that replays are played in.
    """

    def __init__(self, batch: ReachBatch, seed: int, n_copies: int = N_COPIES) -> None:
        self._batch, self._arm, self._seed = batch, batch.arm, seed
        self._rng = np.random.default_rng(seed)
        self.n = batch.n_envs
        self._copies = ReachBatch(batch.cell, n_copies, seed, batch.settings)
        goals, self._which = np.unique(batch.state.goal, axis=0, return_inverse=True)
        found = [
            goal_configurations(
                self._arm, goal, np.random.default_rng([seed, k]), spread=SPREAD
            )
            for k, goal in enumerate(goals)
        ]
        home = np.array(self._arm.home)[None]
        self._postures = [each if len(each) else home for each in found]
        self.replays = Resimulations(
            n=np.zeros(self.n, dtype=np.int64),
            reached=np.zeros(self.n, dtype=np.int64),
            untouched=np.zeros(self.n, dtype=np.int64),
            soonest=np.full(self.n, np.inf),
        )

    def unsolved(self) -> Index:
        """Return the episodes in which no replay has reached the goal yet."""
        return np.flatnonzero(self.replays.reached == 0)

    def scripted(self, episodes: Index, n_each: int, *, at_once: bool = False) -> None:
        """Play scripted replays of some episodes, ``n_each`` of each.

        Args:
            episodes: Which.
            n_each: Resimulations of each.
            at_once: Whether all go to the goal at once.
        """
        for rows in self._parts(episodes, n_each):
            first, until = sample_detours(self._arm, self._rng, len(rows))
            if at_once:
                until[:] = 0.0
            last = self._at_goal(rows)
            self._play(rows, lambda batch, k: np.zeros(0), first, until, last)

    def disturbed(self, episodes: Index, n_each: int, acts: Acts) -> None:
        """Play replays of a policy, ``n_each`` of each episode.

        Args:
            episodes: Which.
            n_each: Resimulations of each.
            acts: The policy: actions of all rows from a batch.
        """
        for rows in self._parts(episodes, n_each):
            first, until = sample_detours(self._arm, self._rng, len(rows))
            until[self._rng.uniform(size=len(rows)) < 0.5] = 0.0
            sigma = self._rng.choice(SIGMAS, size=len(rows))[:, None]
            noise = np.zeros((len(rows), 6))

            def policy(
                batch: ReachBatch, k: int, noise: Vec = noise, sigma: Vec = sigma
            ) -> Vec:
                fresh = self._rng.normal(size=noise.shape)
                noise[:] = CORRELATION * noise + np.sqrt(1.0 - CORRELATION**2) * fresh
                return acts(batch)[:k] + sigma * noise

            self._play(rows, policy, first, until, None)

    def undisturbed(self, acts: Acts) -> None:
        """Play every episode once as a policy does by itself."""
        for rows in self._parts(np.arange(self.n), 1):
            none = np.zeros(len(rows))
            self._play(
                rows, lambda batch, k: acts(batch)[:k], self._home(len(rows)), none, None
            )

    def _home(self, k: int) -> Vec:
        return np.repeat(np.array(self._arm.home)[None], k, axis=0)

    def _parts(self, episodes: Index, n_each: int) -> Sequence[Index]:
        """Return the episodes of the replays, as many at a time as there are copies."""
        every = np.repeat(episodes, n_each)
        n = self._copies.n_envs
        return [every[k : k + n] for k in range(0, len(every), n)]

    def _at_goal(self, rows: Index) -> Vec:
        """Draw a posture at the goal of each replay [rad], shape (k, 6)."""
        postures = [self._postures[self._which[row]] for row in rows]
        return np.stack([each[self._rng.integers(len(each))] for each in postures])

    def _play(
        self,
        rows: Index,
        policy: Callable[[ReachBatch, int], NDArray[np.floating]],
        first: Vec,
        until: Vec,
        last: Vec | None,
    ) -> None:
        """Play one replay per row: to ``first``, later to ``last`` or as the policy acts."""
        batch, k = self._copies, len(rows)
        batch.reset()
        batch.state.outcome[:] = COLLISION  # rows that are not needed stand still
        copy_rows(self._batch.state, rows, batch.state)
        act, t = np.zeros((batch.n_envs, 6), dtype=np.float32), 0.0
        while (batch.state.outcome[:k] == RUNNING).any():
            aim = first if last is None else np.where((t < until)[:, None], first, last)
            act[:k] = toward(self._arm, batch.state.q[:k], aim)
            if last is None:
                free = t >= until
                act[:k][free] = np.clip(policy(batch, k), -1.0, 1.0)[free]
            batch.step(act, auto_reset=False, features=False)
            t += self._arm.dt
        self._count(rows, batch)

    def _count(self, rows: Index, batch: ReachBatch) -> None:
        """Add what came of the replays of some episodes."""
        outcome, found = batch.state.outcome[: len(rows)], self.replays
        np.add.at(found.n, rows, 1)
        np.add.at(found.reached, rows, outcome == SUCCESS)
        np.add.at(found.untouched, rows, outcome != COLLISION)
        seconds = np.where(outcome == SUCCESS, batch.state.elapsed[: len(rows)], np.inf)
        np.minimum.at(found.soonest, rows, seconds)


def future_cylinders(batch: ReachBatch, n_periods: int) -> Vec:
    """Return where the walkers of a batch will be: x, y, radius [m], shape (n + 1, rows, W, 3).

    Args:
        batch: Rows at the start of their episodes; played to the end, so use one of its own.
        n_periods: Number of periods.
    """
    still = np.zeros((batch.n_envs, 6), dtype=np.float32)
    found = [batch.state.people.cylinders.copy()]
    for _ in range(n_periods):
        batch.state.outcome[:] = RUNNING
        batch.step(still, auto_reset=False, features=False)
        found.append(batch.state.people.cylinders.copy())
    return np.array(found)


def provably_unsolvable(
    walks: Vec, goals: Vec, soonest: Vec, dt: float, tool_radius: float, base_radius: float
) -> NDArray[np.bool_]:
    """Return the episodes that nobody could have solved, for one of two reasons, shape (n,).

    The tool would be inside a person wherever it counts as at the goal, in every period in
    which it could be there; or a person touches the base, which cannot get out of the way,
    before the tool could be there.

    Args:
        walks: From :func:`future_cylinders`, shape (n_periods + 1, n, W, 3).
        goals: Goals [m], shape (n, 3).
        soonest: Least time in which anybody could be at each goal [s], shape (n,).
        dt: Control period [s].
        tool_radius: Radius of the tool about the tcp [m].
        base_radius: Radius of the base about its axis [m].
    """
    away = np.linalg.norm(walks[..., :2] - goals[:, None, :2], axis=3)
    covered = (away + SUCCESS_DISTANCE < walks[..., 2] + tool_radius).any(axis=2)
    early = np.arange(len(walks))[:, None] * dt < soonest - 1e-9
    hidden = (covered | early).all(axis=0)
    base = (np.linalg.norm(walks[..., :2], axis=3) < walks[..., 2] + base_radius).any(axis=2)
    return np.asarray(hidden | (base & early).any(axis=0))
