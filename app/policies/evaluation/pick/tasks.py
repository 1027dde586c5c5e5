"""Protocols ``pick-single``, ``pick-choice`` and ``pick-choice-hard`` (docs/method.md 3.6).

The time limit is 12 s for picks; 10 s and 20 s where a target is only reached (rows ``20 s
...``). The start clearance is 0.05 m, starts are drawn uniformly from home, cubes and docks,
and the person has postures that do not occur in training. The result states the hand speeds.
FCL checks the poses of the first 200 episodes on the raw meshes for missed contacts.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, replace

import numpy as np

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.checkpoints.trained_cell import cell_of
from app.policies.evaluation.contact_recheck import recheck
from app.policies.evaluation.pick import selection_rules
from app.policies.evaluation.pick.episodes import (
    CANDIDATES,
    Episodes,
    Evaluator,
    Rule,
    settings_for,
    time_limits,
)
from app.policies.evaluation.rows import EvaluationRequest, Json
from app.policies.evaluation.statistics import mcnemar
from app.policies.inference.task_selection import HYSTERESIS
from app.policies.inference.value_networks import ValueNetworks, pick_preset_of
from app.sim.collision.fcl_recheck import Trajectory
from app.sim.pick.batch import OUTCOMES
from app.sim.pick.hand_speeds import hand_speeds
from app.sim.scenario.kernels import episode as kernel
from app.sim.scene.scene import HumanKind, kinds_of

DEFAULT_EPISODES = 1000
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


def evaluators_of(
    checkpoint: Checkpoint, n_candidates: tuple[int, int], episodes: int | None, seed: int
) -> dict[str, Evaluator]:
    """Return the evaluators of a checkpoint, by the first word of their rows, the usual first.

    By default they have 1000 episodes each.
    """
    preset, n = pick_preset_of(checkpoint), episodes or DEFAULT_EPISODES
    settings, limits = settings_for(n_candidates, preset), time_limits(preset)
    networks, cell = ValueNetworks(checkpoint), cell_of(checkpoint.manifest)
    return {
        "" if limit == limits[0] else f"{limit:.0f} s": Evaluator(
            networks, cell, n, seed, replace(settings, time_limit_s=limit)
        )
        for limit in limits
    }


def settings_of(evaluator: Evaluator) -> dict[str, object]:
    """Return the settings stated with a result."""
    settings, state = evaluator.batch.settings, evaluator.batch.state
    return {
        "time_limit_s": settings.time_limit_s,
        "people": list(kinds_of(evaluator.batch.cell)),
        "start": settings.start,
        "start_clearance_m": settings.start_clearance_m,
        "action": asdict(settings.action),
        "grasp": settings.grasp._asdict() if settings.grasp.depth else "reach only",
        "starts_redrawn_share": float((state.n_redrawn > 0).mean()),
        "candidates": list(settings.n_candidates),
        **hand_speeds(evaluator.batch),
    }


def run_single(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate one random target per episode."""
    evaluators = evaluators_of(checkpoint, (1, 1), request.episodes, request.seed)
    rows = request.rows(len(evaluators))
    trajectories: tuple[Trajectory, ...] = ()
    for name, evaluator in evaluators.items():
        n_recorded = 0 if trajectories else min(N_RECHECKED, evaluator.batch.n_envs)
        outcome = evaluator.run(selection_rules.fixed(0), n_recorded)
        trajectories = trajectories or outcome.trajectories
        rows.append(outcome.row(f"{name} policy".lstrip()))
    usual = evaluators[""]
    return {
        "settings": settings_of(usual),
        "results": rows,
        "fcl_recheck": recheck(usual.batch.cell, trajectories),
    }


class ChoiceRun:
    """Episodes of one setting under all selection rules.

    Args:
        evaluator: Episodes with several candidates.
        name: Name of the setting, first in the names of the rows; may be empty.
    """

    def __init__(self, evaluator: Evaluator, seed: int, name: str = "") -> None:
        self._evaluator, self._seed = evaluator, seed
        self._prefix = f"{name} " if name else ""
        self._runs: dict[str, Episodes] = {}

    def rows(self, n_recorded: int = 0) -> Iterator[dict[str, object]]:
        """Run the rules and yield their rows, the oracle's last."""
        n = self._evaluator.batch.n_envs
        rules = {CRITIC: selection_rules.critic(HYSTERESIS)}
        rules |= {name: rule(self._seed, n) for name, rule in OTHER_RULES.items()}
        for name, rule in rules.items():
            recorded = n_recorded if name == CRITIC else 0
            self._runs[name] = self._evaluator.run(rule, recorded)
            yield self._runs[name].row(self._prefix + name)
        most = self._evaluator.batch.settings.n_candidates[1]
        runs = [self._evaluator.run(selection_rules.fixed(k)) for k in range(most)]
        self._runs[ORACLE] = _oracle(runs)
        yield self._runs[ORACLE].row(self._prefix + ORACLE)

    @property
    def critic(self) -> Episodes:
        """The episodes under the critic's choice."""
        return self._runs[CRITIC]

    def paired(self) -> list[dict[str, object]]:
        """Return the critic's choice against each other rule on the same episodes."""
        gain = self._runs[ORACLE].succeeded.mean() - self._runs["nearest"].succeeded.mean()
        others = [name for name in self._runs if name != CRITIC]
        return [
            {
                "name": f"{self._prefix}{CRITIC} - {name}",
                "difference": float(
                    self.critic.succeeded.mean() - self._runs[name].succeeded.mean()
                ),
                **mcnemar(self.critic.succeeded, self._runs[name].succeeded),
            }
            | ({"oracle_gain": float(gain)} if name == "nearest" else {})
            for name in others
        ]


def run_choice(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate selection among 2 or 3 random targets, and other rules on the same episodes."""
    evaluators = evaluators_of(checkpoint, CANDIDATES, request.episodes, request.seed)
    rows = request.rows(len(evaluators) * (len(OTHER_RULES) + 2))
    runs = {name: ChoiceRun(one, request.seed, name) for name, one in evaluators.items()}
    for name, run in runs.items():
        n_recorded = 0 if name else min(N_RECHECKED, evaluators[name].batch.n_envs)
        for row in run.rows(n_recorded):
            rows.append(row)
    usual = evaluators[""]
    return {
        "settings": {**settings_of(usual), "hysteresis": HYSTERESIS},
        "results": rows,
        "paired": [row for run in runs.values() for row in run.paired()],
        "fcl_recheck": recheck(usual.batch.cell, runs[""].critic.trajectories),
    }


def run_choice_hard(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate the selection beside two people, faster people, both, and among more targets.

    The last setting is left out in a cell with fewer stations than it offers.
    """
    usual = settings_for(CANDIDATES, pick_preset_of(checkpoint))
    fast = replace(usual, work=replace(usual.work, pace=FASTER))
    settings = {
        "two-people": replace(usual, people=PAIR),
        "faster": fast,
        "two-people-faster": replace(fast, people=PAIR),
    }
    networks, cell = ValueNetworks(checkpoint), cell_of(checkpoint.manifest)
    if len(cell.pick_stations) >= MANY_TARGETS[1]:
        more = replace(usual, people=PAIR, n_candidates=MANY_TARGETS)
        settings["two-people-4-to-6-targets"] = more
    rows = request.rows(len(settings) * (len(OTHER_RULES) + 2))
    paired: list[dict[str, object]] = []
    stated: dict[str, object] = {"hysteresis": HYSTERESIS}
    n = request.episodes or DEFAULT_EPISODES
    for name, one in settings.items():
        evaluator = Evaluator(networks, cell, n, request.seed, one)
        run = ChoiceRun(evaluator, request.seed, name)
        for row in run.rows():
            rows.append(row)
        paired += run.paired()
        stated[name] = {**settings_of(evaluator), "pace": one.work.pace}
    return {"settings": stated, "results": rows, "paired": paired}


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
