"""Protocols ``pick-single``, ``pick-choice`` and ``pick-choice-hard`` (docs/method.md 3.6).

The time limit is 12 s for picks; 10 s and 20 s where a target is only reached (rows ``20 s
...``). The start clearance is 0.05 m, starts are drawn uniformly from home, cubes and docks,
and the person has postures that do not occur in training. The result states the hand speeds.
FCL checks the poses of the first 200 episodes on the raw meshes for missed contacts.
"""

from collections.abc import Callable, Mapping
from dataclasses import asdict, replace

import numpy as np

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.evaluation.contact_recheck import recheck
from app.policies.evaluation.pick import selection_rules
from app.policies.evaluation.pick.episodes import (
    Episodes,
    Evaluator,
    PickBench,
    Rule,
    time_limits,
)
from app.policies.evaluation.rows import EvaluationRequest, Json
from app.policies.evaluation.statistics import paired
from app.policies.inference.task_selection import HYSTERESIS
from app.sim.collision.fcl_recheck import Trajectory
from app.sim.pick.batch import OUTCOMES, PickBatch
from app.sim.pick.hand_speeds import hand_speeds
from app.sim.scenario.kernels import episode as kernel
from app.sim.scene.scene import HumanKind, kinds_of

N_RECHECKED = 200
"""Number of episodes checked again with FCL."""
CRITIC = "critic"
OTHER_RULES: Mapping[str, Callable[[int, int], Rule]] = {
    "critic-each-step": lambda _seed, _n: selection_rules.critic(0.0),
    "critic-once": lambda _seed, _n: selection_rules.critic_once,
    "nearest": lambda _seed, _n: selection_rules.nearest,
    "clearest": lambda _seed, _n: selection_rules.clearest,
    "random": selection_rules.at_random,
}
"""Rules compared with the critic's, made from seed and number of episodes."""
ORACLE = "oracle"
PAIR: tuple[HumanKind, ...] = ("worker", "worker")
FASTER = 1.4
"""Speed of faster people, relative to the library's."""
MANY_TARGETS = (4, 6)
"""Fewest and most targets of a table with more objects."""
LONGER_S = (14.0, 20.0)
"""Longer time limits beside two people [s]; 20 s is that of thesis table 5.2."""


def evaluators_of(bench: PickBench) -> dict[str, Evaluator]:
    """Return the episodes of a bench under each time limit, the usual one first.

    The keys are the first words of the names of their rows.
    """
    limits = time_limits(bench.preset)
    return {
        "" if limit == limits[0] else f"{limit:.0f} s": bench.evaluator(
            replace(bench.usual, time_limit_s=limit)
        )
        for limit in limits
    }


def settings_of(batch: PickBatch) -> Json:
    """Return the settings stated with a result."""
    settings = batch.settings
    return {
        "time_limit_s": settings.time_limit_s,
        "people": list(kinds_of(batch.cell)),
        "start": settings.start,
        "start_clearance_m": settings.start_clearance_m,
        "action": asdict(settings.action),
        "grasp": settings.grasp._asdict() if settings.grasp.depth else "reach only",
        "starts_redrawn_share": float((batch.state.n_redrawn > 0).mean()),
        "candidates": list(settings.n_candidates),
        **hand_speeds(batch),
    }


def run_single(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate one random target per episode."""
    evaluators = evaluators_of(PickBench(checkpoint, request, (1, 1)))
    rows, trajectories = request.rows(len(evaluators)), list[Trajectory]()
    for name, evaluator in evaluators.items():
        run = evaluator.run(selection_rules.fixed(0), 0 if name else N_RECHECKED)
        trajectories += run.trajectories
        rows.append(run.row(f"{name} policy".lstrip()))
    usual = evaluators[""].batch
    return {
        "settings": settings_of(usual),
        "results": rows,
        "fcl_recheck": recheck(usual.cell, trajectories),
    }


def compare_rules(
    evaluator: Evaluator, seed: int, rows: list[Json], name: str = "", n_recorded: int = 0
) -> tuple[Episodes, list[Json]]:
    """Run the same episodes under all selection rules; add their rows, the oracle's last.

    Args:
        evaluator: Episodes with several candidates.
        seed: Seed of random choices.
        name: Name of the setting, first in the names of the rows; may be empty.
        n_recorded: Number of the critic's episodes with recorded poses.

    Returns:
        The episodes under the critic's choice, and this choice against each other rule.
    """
    batch, prefix, runs = evaluator.batch, f"{name} " if name else "", dict[str, Episodes]()
    rules = {CRITIC: selection_rules.critic(HYSTERESIS)}
    rules |= {rule: new(seed, batch.n_envs) for rule, new in OTHER_RULES.items()}
    for rule, choose in rules.items():
        runs[rule] = evaluator.run(choose, n_recorded if rule == CRITIC else 0)
        rows.append(runs[rule].row(prefix + rule))
    each = range(batch.settings.n_candidates[1])
    runs[ORACLE] = _oracle([evaluator.run(selection_rules.fixed(k)) for k in each])
    rows.append(runs[ORACLE].row(prefix + ORACLE))
    won = {rule: run.succeeded for rule, run in runs.items()}
    critic, gain = won.pop(CRITIC), float(won[ORACLE].mean() - won["nearest"].mean())
    return runs[CRITIC], [
        {
            **paired(f"{prefix}{CRITIC} - {rule}", critic, other),
            **({"oracle_gain": gain} if rule == "nearest" else {}),
        }
        for rule, other in won.items()
    ]


def run_choice(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate selection among 2 or 3 random targets, and other rules on the same episodes."""
    evaluators = evaluators_of(PickBench(checkpoint, request))
    rows = request.rows(len(evaluators) * (len(OTHER_RULES) + 2))
    differences, trajectories = list[Json](), list[Trajectory]()
    for name, evaluator in evaluators.items():
        recorded = 0 if name else N_RECHECKED
        critic, compared = compare_rules(evaluator, request.seed, rows, name, recorded)
        differences += compared
        trajectories += critic.trajectories
    usual = evaluators[""].batch
    return {
        "settings": {**settings_of(usual), "hysteresis": HYSTERESIS},
        "results": rows,
        "paired": differences,
        "fcl_recheck": recheck(usual.cell, trajectories),
    }


def run_choice_hard(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate the selection beside two people, faster people, and both.

    Two people are also met with longer time limits and, in a cell with enough stations, with
    more targets under each time limit.
    """
    bench = PickBench(checkpoint, request)
    usual = bench.usual
    fast = replace(usual, work=replace(usual.work, pace=FASTER))
    pairs = {"two-people": replace(usual, people=PAIR)}
    if len(bench.cell.pick_stations) >= MANY_TARGETS[1]:
        more = replace(usual, people=PAIR, n_candidates=MANY_TARGETS)
        pairs["two-people-4-to-6-targets"] = more
    settings = {
        "two-people": pairs["two-people"],
        "faster": fast,
        "two-people-faster": replace(fast, people=PAIR),
        **pairs,
        **{
            f"{name}-{limit_s:.0f}-s": replace(one, time_limit_s=limit_s)
            for name, one in pairs.items()
            for limit_s in LONGER_S
        },
    }
    rows = request.rows(len(settings) * (len(OTHER_RULES) + 2))
    differences, stated = list[Json](), Json(hysteresis=HYSTERESIS)
    for name, one in settings.items():
        evaluator = bench.evaluator(one)
        differences += compare_rules(evaluator, request.seed, rows, name)[1]
        stated[name] = {**settings_of(evaluator.batch), "pace": one.work.pace}
    return {"settings": stated, "results": rows, "paired": differences}


def _oracle(runs: list[Episodes]) -> Episodes:
    """Return the episodes with the best fixed candidate each, known only afterwards."""
    rank = np.zeros(len(OUTCOMES))
    rank[[kernel.TIMEOUT, kernel.UNFEASIBLE, kernel.COLLISION]] = 1, 2, 3
    badness = np.stack([1e3 * rank[run.outcome] + run.duration_s for run in runs])
    best, rows = badness.argmin(axis=0), np.arange(badness.shape[1])
    return Episodes(
        outcome=np.stack([run.outcome for run in runs])[best, rows],
        duration_s=np.stack([run.duration_s for run in runs])[best, rows],
        switches=np.zeros(len(rows), dtype=np.int64),
        trajectories=(),
    )
