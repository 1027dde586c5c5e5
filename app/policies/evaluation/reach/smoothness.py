"""Protocol ``reach-smoothness``: joint trajectories of whole episodes.

Each control period is one polynomial segment of degree 2 or 3 per joint. The row states the
extremes of positions, speeds, accelerations and jerks inside the segments beside their limits,
and the steps at segment boundaries: the speed has none, which is checked against the executed
positions; the acceleration has steps with degree 2, which limits no jerk, and none with degree
3.

``mean_jerk`` is the change of the acceleration between periods, comparable between degrees;
``rms_acceleration`` is over time and joints. The plot shows one episode: the longest of the
first hundred successes.

Source: thesis 4.4.3 (joint positions and velocities over an episode, "no discontinuity").
Deviates: accelerations and jerk are ours.
"""

from typing import NamedTuple

import numpy as np

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.evaluation.reach.bench import ReachBench
from app.policies.evaluation.reach.episodes import run_to_end
from app.policies.evaluation.rows import EvaluationRequest, Json
from app.policies.evaluation.statistics import Index, rate_of
from app.policies.inference.controllers import Controller, controller_of
from app.sim.core.arrays import Vec
from app.sim.reach.batch import ReachBatch
from app.sim.reach.blocked_batch import new_reach_batch
from app.sim.robot.kernels.arm import Arm
from app.sim.robot.trajectory_segment import executed_coefficients
from app.sim.scenario.kernels import episode as kernel

DEFAULT_EPISODES = 1000
PARTS = 10
"""Intervals per period at whose ends positions and speeds are evaluated."""
SHOWN_OF = 100
"""Number of successes from which the episode of the plot is selected."""
DIGITS = 5
"""Decimals stored of that episode."""


class Paths(NamedTuple):
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
    outcome: Index
    """Index into OUTCOMES, shape (n,)."""


def record_paths(batch: ReachBatch, controller: Controller, goals: Vec) -> Paths:
    """Run one episode in every environment and record its trajectory.

    Args:
        batch: Environments, not reset.
        goals: Goal of each environment [m], shape (n_envs, 3).
    """
    batch.reset()
    batch.set_goals(np.arange(batch.n_envs), goals)
    state = batch.state
    running, kept = np.ones(batch.n_envs, dtype=np.bool_), []

    def record() -> None:
        parts = (state.q, state.qd, state.qdd, state.clear[:, 0], state.distance)
        now = [part.copy() for part in parts]
        for part in now:
            part[~running] = np.nan
        kept.append(now)
        running[:] = state.outcome == kernel.RUNNING

    record()
    run_to_end(batch, controller.acts, after=record)
    q, qd, qdd, clearance, distance = map(np.array, zip(*kept, strict=True))
    return Paths(q, qd, qdd, clearance, distance, state.outcome.copy())


def measure(paths: Paths, degree: int, arm: Arm) -> dict[str, float]:
    """Return extremes beside their limits, and steps at segment boundaries.

    The step of the speed is the largest one consistent with the differences of positions and
    speeds between the end of a segment and the start of the next one.
    """
    q0, v0, dt = paths.q[:-1], paths.qd[:-1], arm.dt
    c, d = executed_coefficients(
        degree, dt, (v0, paths.qd[1:]), (paths.qdd[:-1], paths.qdd[1:])
    )

    def at(x: float) -> tuple[Vec, Vec, Vec]:
        """Return positions, speeds and accelerations at local time ``x`` [s]."""
        q, v = q0 + x * (v0 + x * (c + x * d)), v0 + x * (2.0 * c + 3.0 * x * d)
        return q, v, 2.0 * c + 6.0 * x * d

    q_end, v_end, a_end = at(dt)
    inside = [at(dt * k / PARTS) for k in range(PARTS + 1)]
    margins = [np.fmin(q - arm.limits.q_min, arm.limits.q_max - q) for q, _, _ in inside]
    q_step = np.nanmax(np.abs(q_end - paths.q[1:]))
    change = np.abs(np.diff(paths.qdd, axis=0)) / dt
    found = {
        "position_margin_rad": min(np.nanmin(margin) for margin in margins),
        "speed_rad_s": max(np.nanmax(np.abs(v)) for _, v, _ in inside),
        "speed_limit_rad_s": arm.limits.qd_max.max(),
        "acceleration_rad_s2": max(np.nanmax(np.abs(a)) for _, _, a in (inside[0], inside[-1])),
        "acceleration_limit_rad_s2": arm.limits.qdd_max.max(),
        "position_jump_rad": q_step,
        "speed_jump_rad_s": max(2.0 * q_step / dt, np.nanmax(np.abs(v_end - paths.qd[1:]))),
        "acceleration_jump_rad_s2": np.nanmax(np.abs(inside[0][2][1:] - a_end[:-1])),
        "mean_jerk_rad_s3": np.nanmean(change),
        "rms_acceleration_rad_s2": np.sqrt(np.nanmean(np.square(paths.qdd[1:]))),
    }
    if degree == 3:
        found["jerk_rad_s3"] = np.nanmax(change)
        found["jerk_limit_rad_s3"] = arm.limits.jerk_max.max()
    return {name: float(value) for name, value in found.items()}


def shown_episode(paths: Paths, dt: float) -> Json | None:
    """Return the longest of the first successes for the plot; None without a success."""
    won = np.flatnonzero(paths.outcome == kernel.SUCCESS)[:SHOWN_OF]
    if not len(won):
        return None
    lengths = np.isfinite(paths.distance[:, won]).sum(axis=0)
    e = int(won[lengths.argmax()])
    n = int(lengths.max())
    shown = {
        "q_rad": paths.q,
        "qd_rad_s": paths.qd,
        "qdd_rad_s2": paths.qdd,
        "clearance_m": paths.clearance,
        "distance_m": paths.distance,
    }
    rounded = {key: np.round(part[:n, e], DIGITS).tolist() for key, part in shown.items()}
    return {"episode": e, "dt_s": dt, **rounded}


def run_smoothness(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Measure the smoothness of a policy's joint trajectories."""
    bench = ReachBench(checkpoint, request.seed, request.on_row)
    settings, n = bench.usual, request.episodes or DEFAULT_EPISODES
    batch = new_reach_batch(bench.cell, n, request.seed, settings)
    goals = bench.target_goals(n)
    paths = record_paths(batch, controller_of(bench.actor, "direct"), goals)
    row = {
        "name": f"degree-{settings.action.degree}",
        "n": n,
        "success": rate_of(paths.outcome == kernel.SUCCESS),
        **measure(paths, settings.action.degree, batch.arm),
    }
    bench.add(row, bench.variant("", goals))
    limits = {name: getattr(batch.arm.limits, name).tolist() for name in ("q_min", "q_max")}
    return {**bench.result(limits=limits), "example": shown_episode(paths, batch.arm.dt)}
