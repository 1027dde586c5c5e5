"""Protocol ``reach-smoothness``: what the joints do along whole episodes.

Every control period is one polynomial piece of degree 2 or 3 per joint. The row says how far
positions, speeds, accelerations and jerks go inside the pieces, beside their limits, and what
jumps where pieces meet: the speed never does, which is checked against the positions that were
driven; the acceleration does with degree 2, which bounds no jerk; with degree 3 it does not.

``mean_jerk`` is the change of the acceleration from period to period, by which degrees can be
compared; ``rms_acceleration`` goes over time and joints. One episode is kept whole for the
plot: of the first hundred successes the longest.

Source: thesis 4.4.3 (joint positions and velocities over an episode, "no discontinuity").
Deviates: accelerations and jerk are ours.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.evaluation.reach.bench import ReachBench
from app.policies.evaluation.rows import OnRow, ignore_row
from app.policies.evaluation.statistics import wilson
from app.policies.inference.controllers import Controller, controller_of
from app.sim.core.arrays import Vec
from app.sim.reach.batch import ReachBatch
from app.sim.robot.kernels.arm import Arm
from app.sim.scenario.kernels import episode as kernel

DEFAULT_EPISODES = 1000
PARTS = 10
"""Instants per period at which positions and speeds are looked at, besides the ends."""
SHOWN_OF = 100
"""Successes among which the episode of the plot is."""
DIGITS = 5
"""Decimals kept of that episode."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Paths:
    """Robots at the ends of all control periods, NaN after the end of an episode."""

    q: Vec
    """Joint positions [rad], shape (n_periods + 1, n, 6)."""
    qd: Vec
    """Joint speeds [rad/s], same shape."""
    qdd: Vec
    """Joint accelerations [rad/s^2], same shape."""
    clearance: Vec
    """Distance of robot and people [m], shape (n_periods + 1, n)."""
    distance: Vec
    """Distance of tcp and goal [m], same shape."""
    outcome: NDArray[np.int64]
    """Index into OUTCOMES, shape (n,)."""


def drive(batch: ReachBatch, controller: Controller, goals: Vec) -> Paths:
    """Play one episode in every row of a batch and keep the whole way.

    Args:
        batch: Not started.
        controller: Controller of the robots.
        goals: Goal of each row [m], shape (n_envs, 3).
    """
    batch.reset()
    batch.set_goals(np.arange(batch.n_envs), goals)
    state, kept = batch.state, []
    running = np.ones(batch.n_envs, dtype=np.bool_)
    while True:
        now = (state.q, state.qd, state.qdd, state.clear[:, 0], state.distance)
        kept.append([np.where(_as(running, part), part, np.nan) for part in now])
        running = state.outcome == kernel.RUNNING
        if not running.any():
            break
        batch.step(controller.acts(batch), auto_reset=False)
    q, qd, qdd, clearance, distance = (
        np.array([period[i] for period in kept]) for i in range(5)
    )
    return Paths(
        q=q,
        qd=qd,
        qdd=qdd,
        clearance=clearance,
        distance=distance,
        outcome=state.outcome.copy(),
    )


def _as(rows: NDArray[np.bool_], part: Vec) -> NDArray[np.bool_]:
    return rows.reshape(-1, *(1 for _ in part.shape[1:]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Pieces:
    """The polynomial pieces ``q0 + v0 x + c x^2 + d x^3`` of all periods."""

    q0: Vec
    """Position at the start of each [rad], shape (n_periods, n, 6)."""
    v0: Vec
    """Speed at the start [rad/s]."""
    c: Vec
    """Second coefficient [rad/s^2]."""
    d: Vec
    """Third coefficient [rad/s^3]."""

    def at(self, x: float) -> tuple[Vec, Vec, Vec]:
        """Return positions, speeds and accelerations ``x`` seconds into the pieces."""
        q = self.q0 + x * (self.v0 + x * (self.c + x * self.d))
        v = self.v0 + x * (2.0 * self.c + 3.0 * x * self.d)
        return q, v, 2.0 * self.c + 6.0 * x * self.d


def pieces_of(paths: Paths, degree: int, dt: float) -> Pieces:
    """Return the pieces that were driven, from speeds or accelerations at their ends."""
    q0, v0 = paths.q[:-1], paths.qd[:-1]
    if degree == 3:
        c = 0.5 * paths.qdd[:-1]
        return Pieces(q0=q0, v0=v0, c=c, d=(paths.qdd[1:] - paths.qdd[:-1]) / (6.0 * dt))
    c = (paths.qd[1:] - paths.qd[:-1]) / (2.0 * dt)
    return Pieces(q0=q0, v0=v0, c=c, d=0.0 * c)


def measure(paths: Paths, degree: int, arm: Arm) -> dict[str, float]:
    """Return maxima against limits, and what jumps where pieces meet.

    The speed's jump is the greatest that could hide behind what positions and speeds at the end
    of a piece differ from those that the next one starts with.
    """
    pieces, dt = pieces_of(paths, degree, arm.dt), arm.dt
    q_end, v_end, a_end = pieces.at(dt)
    inside = [pieces.at(dt * k / PARTS) for k in range(PARTS + 1)]
    margins = [np.fmin(q - arm.limits.q_min, arm.limits.q_max - q) for q, _, _ in inside]
    gap = np.nanmax(np.abs(q_end - paths.q[1:]))
    change = np.abs(np.diff(paths.qdd, axis=0)) / dt
    found = {
        "position_margin_rad": min(np.nanmin(margin) for margin in margins),
        "speed_rad_s": max(np.nanmax(np.abs(v)) for _, v, _ in inside),
        "speed_limit_rad_s": arm.limits.qd_max.max(),
        "acceleration_rad_s2": max(np.nanmax(np.abs(a)) for _, _, a in (inside[0], inside[-1])),
        "acceleration_limit_rad_s2": arm.limits.qdd_max.max(),
        "position_jump_rad": gap,
        "speed_jump_rad_s": max(2.0 * gap / dt, np.nanmax(np.abs(v_end - paths.qd[1:]))),
        "acceleration_jump_rad_s2": np.nanmax(np.abs(inside[0][2][1:] - a_end[:-1])),
        "mean_jerk_rad_s3": np.nanmean(change),
        "rms_acceleration_rad_s2": np.sqrt(np.nanmean(np.square(paths.qdd[1:]))),
    }
    if degree == 3:
        jerk = {
            "jerk_rad_s3": np.nanmax(change),
            "jerk_limit_rad_s3": arm.limits.jerk_max.max(),
        }
        found |= jerk
    return {name: float(value) for name, value in found.items()}


def shown_episode(paths: Paths, dt: float) -> dict[str, Any] | None:
    """Return the longest of the first successes, for the plot; None without a success."""
    won = np.flatnonzero(paths.outcome == kernel.SUCCESS)[:SHOWN_OF]
    if not len(won):
        return None
    lengths = np.isfinite(paths.distance[:, won]).sum(axis=0)
    e = int(won[lengths.argmax()])
    n = int(lengths.max())
    kept = {
        "q_rad": paths.q[:n, e],
        "qd_rad_s": paths.qd[:n, e],
        "qdd_rad_s2": paths.qdd[:n, e],
        "clearance_m": paths.clearance[:n, e],
        "distance_m": paths.distance[:n, e],
    }
    rounded = {name: np.round(part, DIGITS).tolist() for name, part in kept.items()}
    return {"episode": e, "dt_s": dt, **rounded}


def run_smoothness(
    checkpoint: Checkpoint, *, episodes: int | None, seed: int, on_row: OnRow = ignore_row
) -> dict[str, Any]:
    """Measure how smoothly a policy moves.

    Args:
        checkpoint: What acts, of degree 2 or 3.
        episodes: Number of episodes, by default 1000.
        seed: Seed of the episodes.
        on_row: Told of the row once it is known.
    """
    bench = ReachBench(checkpoint, seed, on_row)
    settings, n = bench.usual, episodes or DEFAULT_EPISODES
    batch = ReachBatch(bench.cell, n, seed, settings)
    paths = drive(batch, controller_of(bench.actor, "direct"), bench.target_goals(n))
    row = {
        "name": f"degree-{settings.action.degree}",
        "n": n,
        "success": wilson(int((paths.outcome == kernel.SUCCESS).sum()), n),
        **measure(paths, settings.action.degree, batch.arm),
    }
    bench.add(row, settings, "grid")
    limits = {name: getattr(batch.arm.limits, name).tolist() for name in ("q_min", "q_max")}
    return {**bench.result(limits=limits), "example": shown_episode(paths, batch.arm.dt)}
