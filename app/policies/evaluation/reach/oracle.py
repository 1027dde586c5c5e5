"""Protocol ``reach-oracle``: episodes that a search with a known future solves.

The episodes are those of ``reach-targets`` (54 targets x 100, start clearance 0.05 m, 5 s) with
the same people. Episodes that the policy does not solve are resimulated with other robot
motions (``app/sim/reach/oracle_search.py``) until one reaches the goal or the search ends.
``solvable`` is a lower bound on the share of solvable episodes; a causal policy cannot be
expected to reach it, because a resimulation knows the future motion of people. ``never`` is the
share of episodes that are presumed unsolvable; the rest is ``undecided``. ``doomed`` is the
share of episodes in which every resimulation, including retreats, ended in a collision: an
upper bound on the share of unavoidable collisions.

==============  ==============================================================================
stage           resimulations of each unsolved episode
==============  ==============================================================================
``policy``      the policy by itself
``scripted``    to a random configuration, later straight to the goal: 64, then 256
``disturbed``   to a random configuration, later the policy with noise: 32; the policy at once
                where its actions are no joint speeds
``long``        scripted again: 2048
==============  ==============================================================================

Source: ours, on the episodes of docs/method.md 2.6.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.evaluation.reach.bench import ReachBench
from app.policies.evaluation.reach.episodes import N_ENVS
from app.policies.evaluation.rows import EvaluationRequest, Json
from app.policies.evaluation.statistics import Index, rate_of
from app.policies.inference.controllers import Controller, controller_of
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.reach.oracle_search import (
    OracleSearch,
    copy_rows,
    future_cylinders,
    presumably_unsolvable,
)
from app.sim.robot.capsules import load_robot_capsules

PER_TARGET = 100
"""Episodes of each target (docs/method.md 2.6)."""
SCRIPTED = (64, 256)
"""Scripted resimulations of each episode in the first two rounds."""
DISTURBED = 32
"""Resimulations of the policy."""
LONG = 2048
"""Scripted resimulations in the last round."""
SOONEST_TRIES = 256
"""Resimulations in an empty cell, for the shortest time to a target."""


def started(cell: Cell, settings: ReachSettings, goals: Vec, seed: int) -> ReachBatch:
    """Return a batch with the first states of the episodes of ``run_episodes``.

    Args:
        goals: Goal of each episode [m], shape (n, 3).
    """
    found = ReachBatch(cell, len(goals), seed, settings)
    source = ReachBatch(cell, N_ENVS, seed, settings)
    for number, first in enumerate(range(0, len(goals), N_ENVS)):
        some = goals[first : first + N_ENVS]
        rows = np.arange(len(some))
        source.state.episode[:] = number
        source.restart()
        source.set_goals(rows, some)
        copy_rows(source.state, rows, found.state, first)
    return found


def soonest_arrivals(cell: Cell, settings: ReachSettings, goals: Vec, seed: int) -> Vec:
    """Return the earliest time of the TCP at each goal without people [s], shape (n,).

    Args:
        settings: Rules; people and goals are replaced.
        goals: Goal of each episode [m], shape (n, 3).
    """
    different, which = np.unique(goals, axis=0, return_inverse=True)
    rules = ReachSettings(
        people=(),
        action=settings.action,
        limits=settings.limits,
        time_limit_s=settings.time_limit_s,
    )
    alone = ReachBatch(cell, len(different), seed, rules)
    alone.reset()
    alone.set_goals(np.arange(len(different)), different)
    search = OracleSearch(alone, seed)
    search.scripted(np.arange(len(different)), SOONEST_TRIES, at_once=True)
    return np.asarray(search.resimulations.soonest[which])


def search_in_stages(
    batch: ReachBatch, controller: Controller, seed: int, rows: list[Json]
) -> OracleSearch:
    """Run all stages over one set of episodes; return the search.

    Args:
        batch: From :func:`started`.
        rows: Receives a row of each stage, with the episodes solved so far.
    """
    search, acts = OracleSearch(batch, seed), controller.acts
    stages: list[tuple[str, Callable[[Index], None]]] = [
        ("policy", lambda _: search.simulate_policy(acts)),
        *((f"scripted-{n}", partial(search.scripted, n_each=n)) for n in SCRIPTED),
        ("disturbed", partial(search.disturbed, n_each=DISTURBED, acts=acts)),
        ("long", partial(search.scripted, n_each=LONG)),
    ]
    for name, resimulate in stages:
        resimulate(search.unsolved())
        solved = rate_of(search.resimulations.reached > 0)
        rows.append({"name": name, "n": search.n, "solved": solved, **_counts(search)})
    return search


def _counts(search: OracleSearch) -> Json:
    """Return the share of doomed episodes, and the number of resimulations."""
    found = search.resimulations
    return {"doomed": rate_of(found.untouched == 0), "resimulations": int(found.n.sum())}


def verdict(search: OracleSearch, never: Any, targets: Vec, goals: Vec) -> Json:
    """Return the shares of solvable, unsolvable and undecided episodes with intervals.

    Args:
        search: The search after all stages.
        never: Whether each episode is presumed unsolvable, shape (n,).
        targets: All targets [m], shape (k, 3).
        goals: Goal of each episode, one of the targets [m], shape (n, 3).
    """
    solved = search.resimulations.reached > 0
    by_target = [(target, solved[(goals == target).all(axis=1)]) for target in targets]
    shares = [
        {"goal": target.tolist(), "solvable": float(won.mean())}
        for target, won in by_target
        if won.size
    ]
    return {
        "name": "oracle",
        "n": search.n,
        "solvable": rate_of(solved),
        "never": rate_of(never & ~solved),
        "undecided": rate_of(~solved & ~never),
        **_counts(search),
        "worst_targets": sorted(shares, key=lambda one: one["solvable"])[:5],
    }


def run_oracle(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Search for solutions of the episodes of ``reach-targets``."""
    bench = ReachBench(checkpoint, request.seed)
    per_target = request.episodes or PER_TARGET
    goals = bench.target_goals(per_target * len(bench.targets))
    cell, settings = bench.cell, bench.usual
    batch = started(cell, settings, goals, request.seed)
    stages = request.rows(len(SCRIPTED) + 4)
    search = search_in_stages(batch, controller_of(bench.actor, "direct"), request.seed, stages)
    arm = batch.arm
    soonest = soonest_arrivals(cell, settings, goals, request.seed)
    base = load_robot_capsules(cell.robot.tool_length, cell.robot.tool_radius).radius[0]
    walks = future_cylinders(batch, round(settings.time_limit_s / arm.dt))
    never = presumably_unsolvable(
        walks, goals, soonest, arm.dt, cell.robot.tool_radius, float(base)
    )
    row = verdict(search, never, bench.targets, goals)
    stages.append(row)
    variant = replace(bench.variant("oracle", goals), goal_set="training targets in turn")
    bench.add(row, variant)
    result = bench.result(search_seed=request.seed, soonest_tries=SOONEST_TRIES)
    return {"episodes": per_target, **result, "stages": stages[:-1]}
