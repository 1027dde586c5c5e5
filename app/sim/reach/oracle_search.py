"""Oracle search: what is possible with knowledge of the future motion of people.

People do not react to the robot, so the human motion of an episode is fixed when it starts.
Copies of its first state are simulated again with different robot motions until one reaches the
goal. A success proves that the episode is solvable, not that a policy without knowledge of the
future can solve it. A resimulation is

- *scripted*: to a configuration (home, the start of a retreat, or random) until some time, then
  straight to a configuration at the goal; or
- *disturbed*: to a configuration until some time, then a policy with noise on its actions; the
  policy at once where its actions are no joint speeds.

Unsolved episodes have two marks (docs/method.md 2.6): an episode is *presumably unsolvable* if
a person covers the goal, or touches the robot's base, from before the earliest arrival that was
found; a collision is *unavoided* if all resimulations, including retreats, collide. The first
is no proof: a tool that points at the person needs less room than its radius about the goal,
and an earlier arrival may exist.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.planning.goal_configurations import goal_configurations_of
from app.sim.reach.batch import ReachBatch
from app.sim.robot.kernels.arm import Arm
from app.sim.scenario.kernels.episode import COLLISION, RUNNING, SUCCESS, SUCCESS_DISTANCE

N_COPIES = 4096
"""Environments of the batch of resimulations."""
GAIN = 5.0
"""Joint speed per remaining joint difference [1/s]."""
SPREAD = 0.09
"""Largest distance of the tcp to the goal in a configuration at the goal [m]."""
AT_HOME = 0.3
"""Share of resimulations that wait at home first."""
NEAR_HOME = 0.4
"""Share of resimulations that first move to a configuration within NEARBY of home."""
NEARBY = np.array([1.5, 0.8, 0.8, 0.8, 0.8, 0.0])
"""Half width of that box around home [rad]."""
LONGEST_WAIT = 4.0
"""Latest time at which a resimulation turns to its goal [s]."""
SIGMAS = (0.0, 0.1, 0.3)
"""Standard deviations of the noise on a policy's actions."""
CORRELATION = 0.9
"""Correlation of the noise between control periods."""

Index = NDArray[np.int64]
Acts = Callable[[ReachBatch], NDArray[np.float32]]
"""A policy: returns the actions of all environments of a batch."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Resimulations:
    """Counts of resimulations of each episode."""

    n: Index
    """Resimulations, shape (n,)."""
    reached: Index
    """Resimulations that reached the goal, shape (n,)."""
    untouched: Index
    """Resimulations without a collision, shape (n,)."""
    soonest: Vec
    """Least time to the goal [s]; infinity where none reached it, shape (n,)."""


def copy_rows(source: Any, rows: Index, target: Any, first: int = 0) -> None:
    """Copy environments of a state, a tuple of arrays or of such tuples, into another.

    Args:
        source: State to copy from.
        rows: Numbers of the environments, shape (k,).
        target: State to copy into.
        first: Number of the first copy in the target.
    """
    for old, new in zip(source, target, strict=True):
        if isinstance(old, tuple):
            copy_rows(old, rows, new, first)
        else:
            new[first : first + len(rows)] = old[rows]


def sample_detours(
    arm: Arm, rng: np.random.Generator, k: int, longest: float = LONGEST_WAIT
) -> tuple[Vec, Vec]:
    """Sample first configurations [rad], shape (k, 6), and their end times [s], shape (k,)."""
    kind, home = rng.uniform(size=k), np.repeat(np.array(arm.home)[None], k, axis=0)
    near = home + rng.uniform(-1.0, 1.0, (k, 6)) * NEARBY
    anywhere = rng.uniform(*arm.limits.within_half_turn(), (k, 6))
    anywhere[:, 5] = near[:, 5] = home[:, 5]
    first = np.where((kind < AT_HOME + NEAR_HOME)[:, None], near, anywhere)
    first = np.where((kind < AT_HOME)[:, None], home, first)
    return np.clip(first, arm.limits.q_min, arm.limits.q_max), rng.uniform(0.0, longest, k)


def toward(arm: Arm, q: Vec, aim: Vec) -> NDArray[np.float32]:
    """Return actions of straight joint motions, in [-1, 1], shape (n, 6).

    Args:
        arm: From ``scene.arm_of``.
        q: Joint positions [rad], shape (n, 6).
        aim: Target configurations [rad], shape (n, 6).
    """
    return np.clip(GAIN * (aim - q) / arm.limits.qd_max, -1.0, 1.0).astype(np.float32)


class OracleSearch:
    """Resimulates the episodes of a batch from their first states.

    In the methods, ``episodes`` are indices of episodes, shape (k,), and ``n_each`` is the
    number of resimulations of each.

    Args:
        batch: Environments at the start of their episodes; not changed.
        n_copies: Environments of the batch of resimulations.
    """

    def __init__(self, batch: ReachBatch, seed: int, n_copies: int = N_COPIES) -> None:
        self._batch, self._arm, self._seed = batch, batch.arm, seed
        self._rng = np.random.default_rng(seed)
        self.n = batch.n_envs
        settings = batch.settings
        self._by_speed = settings.action.meaning == "speed"
        self._copies = self._scripted = ReachBatch(batch.cell, n_copies, seed, settings)
        if not self._by_speed:
            settings = replace(settings, action=replace(settings.action, meaning="speed"))
            self._scripted = ReachBatch(batch.cell, n_copies, seed, settings)
        goals, self._which = np.unique(batch.state.goal, axis=0, return_inverse=True)
        found = goal_configurations_of(self._arm, goals, seed, SPREAD)
        home = np.array(self._arm.home)[None]
        self._configurations = [each if len(each) else home for each in found]
        self.resimulations = Resimulations(
            n=np.zeros(self.n, dtype=np.int64),
            reached=np.zeros(self.n, dtype=np.int64),
            untouched=np.zeros(self.n, dtype=np.int64),
            soonest=np.full(self.n, np.inf),
        )

    def unsolved(self) -> Index:
        """Return the indices of the episodes that no resimulation has solved, shape (k,)."""
        return np.flatnonzero(self.resimulations.reached == 0)

    def scripted(self, episodes: Index, n_each: int, *, at_once: bool = False) -> None:
        """Run scripted resimulations of some episodes.

        Args:
            episodes: Their indices, shape (k,).
            n_each: Resimulations of each.
            at_once: Whether all move to the goal immediately.
        """
        for rows in self._parts(episodes, n_each):
            first, until = sample_detours(self._arm, self._rng, len(rows))
            if at_once:
                until[:] = 0.0
            last = self._at_goal(rows)
            self._simulate(rows, lambda batch, k: np.zeros(0), first, until, last)

    def disturbed(self, episodes: Index, n_each: int, acts: Acts) -> None:
        """Run resimulations of some episodes with a policy and noise on its actions.

        Args:
            episodes: Their indices, shape (k,).
            n_each: Resimulations of each.
            acts: The policy: actions of all environments of a batch.
        """
        for rows in self._parts(episodes, n_each):
            first, until = sample_detours(self._arm, self._rng, len(rows))
            until[self._rng.uniform(size=len(rows)) < 0.5] = 0.0
            if not self._by_speed:
                until[:] = 0.0  # configurations are approached by joint speeds
            sigma = self._rng.choice(SIGMAS, size=len(rows))[:, None]
            noise = np.zeros((len(rows), 6))

            def policy(
                batch: ReachBatch, k: int, noise: Vec = noise, sigma: Vec = sigma
            ) -> Vec:
                fresh = self._rng.normal(size=noise.shape)
                noise[:] = CORRELATION * noise + np.sqrt(1.0 - CORRELATION**2) * fresh
                return acts(batch)[:k] + sigma * noise

            self._simulate(rows, policy, first, until, None)

    def simulate_policy(self, acts: Acts) -> None:
        """Simulate every episode once with a policy alone."""
        for rows in self._parts(np.arange(self.n), 1):
            none = np.zeros(len(rows))
            home = np.tile(self._arm.home, (len(rows), 1))
            self._simulate(rows, lambda batch, k: acts(batch)[:k], home, none, None)

    def _parts(self, episodes: Index, n_each: int) -> Sequence[Index]:
        """Split the resimulations into groups of at most ``n_copies`` episodes."""
        every = np.repeat(episodes, n_each)
        n = self._copies.n_envs
        return [every[k : k + n] for k in range(0, len(every), n)]

    def _at_goal(self, rows: Index) -> Vec:
        """Draw a configuration at the goal of each resimulation [rad], shape (k, 6)."""
        choices = [self._configurations[self._which[row]] for row in rows]
        return np.stack([each[self._rng.integers(len(each))] for each in choices])

    def _simulate(
        self,
        rows: Index,
        policy: Callable[[ReachBatch, int], NDArray[np.floating]],
        first: Vec,
        until: Vec,
        last: Vec | None,
    ) -> None:
        """Simulate each row: to ``first``, from ``until`` on to ``last`` or with the policy."""
        batch, k = self._copies if last is None else self._scripted, len(rows)
        batch.reset()
        batch.state.outcome[:] = COLLISION  # unused environments do not move
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
        """Count the outcomes of resimulations."""
        outcome, found = batch.state.outcome[: len(rows)], self.resimulations
        np.add.at(found.n, rows, 1)
        np.add.at(found.reached, rows, outcome == SUCCESS)
        np.add.at(found.untouched, rows, outcome != COLLISION)
        seconds = np.where(outcome == SUCCESS, batch.state.elapsed[: len(rows)], np.inf)
        np.minimum.at(found.soonest, rows, seconds)


def future_cylinders(batch: ReachBatch, n_periods: int) -> Vec:
    """Return the future cylinders of pedestrians: x, y, radius [m], shape (n + 1, rows, W, 3).

    Args:
        batch: Environments at the start of their episodes; simulated to the end.
        n_periods: Number of control periods.
    """
    still = np.zeros((batch.n_envs, 6), dtype=np.float32)
    found = [batch.state.people.cylinders.copy()]
    for _ in range(n_periods):
        batch.state.outcome[:] = RUNNING
        batch.step(still, auto_reset=False, features=False)
        found.append(batch.state.people.cylinders.copy())
    return np.array(found)


def presumably_unsolvable(
    walks: Vec, goals: Vec, soonest: Vec, dt: float, tool_radius: float, base_radius: float
) -> NDArray[np.bool_]:
    """Return which episodes presumably cannot be solved, shape (n,).

    Either a person covers every position of success in every control period in which the tool
    could be there, or a person touches the fixed base before the earliest possible arrival.

    Args:
        walks: From :func:`future_cylinders`, shape (n_periods + 1, n, W, 3).
        goals: Goals [m], shape (n, 3).
        soonest: Least time to each goal in an empty cell [s], shape (n,).
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
