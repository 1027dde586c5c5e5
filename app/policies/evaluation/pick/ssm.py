"""Protocol ``pick-ssm``: picks under speed and separation monitoring (docs/method.md 2.7).

The policy picks beside a person as in ``pick-single`` and ``pick-choice``, for at most 20 s,
with the safety layer between policy and robot.

``ssm``
    One target; assumptions for work among hands (``AMONG_HANDS``): no protective distance.
``ssm-distance``
    ``ssm`` with the default protective distance of 0.3 m.
``pfl``
    ``ssm`` with power and force limiting: contacts at admissible speeds are permitted.
``no-ssm``
    The same episodes without the safety layer.
``choice-ssm``, ``choice-no-ssm``
    Two or three targets, chosen by the critic.
``ssm-short-reaction``, ``choice-ssm-short-reaction``
    The layer with a reaction time of 0.05 s (T_r = 0.1 s with the control period) and hands of
    up to 2 m/s, the speed of ISO 13855 for hands over less than 0.5 m.
``choice-ssm-fast-hands``
    The same reaction time and hands of up to 2.8 m/s.

Rows with a choice are left out in a cell of fewer than three stations.

Contact with a moving link ends an episode, also at a speed that power and force limiting
admits (``contact_admissible``). A person may touch a robot at standstill: the episode continues
and counts in ``contact_at_rest``. ``stopped`` is the share of control periods with override 0,
``time_lost_s`` the time to success less that of the same episode without the layer, where both
succeed.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.evaluation.pick import selection_rules
from app.policies.evaluation.pick.episodes import CANDIDATES, Evaluator, PickBench
from app.policies.evaluation.pick.tasks import settings_of
from app.policies.evaluation.rows import EvaluationRequest, Json
from app.policies.evaluation.statistics import mean_of, paired, rate_of
from app.policies.inference.task_selection import HYSTERESIS
from app.sim.pick.monitored_batch import AMONG_HANDS, MonitoredPickBatch
from app.sim.safety.layer import SafetySettings
from app.sim.scenario.monitoring import MonitoredEpisodes, MonitoringSettings, joined

DEFAULT_EPISODES = 20_000
TIME_LIMIT_S = 20.0
"""Time limit of an episode [s]."""
SHORT_REACTION = replace(AMONG_HANDS, human_speed=2.0, reaction_time=0.05)
"""Assumptions for a short reaction time; an episode has no delay but the control period."""
FAST_HANDS = replace(SHORT_REACTION, human_speed=2.8)
"""The same for faster hands."""
CHUNK = 5_000
"""Number of episodes that run together."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """Condition of a row."""

    safety: SafetySettings = AMONG_HANDS
    """Assumptions of the safety layer."""
    active: bool = True
    """Whether the safety layer acts."""
    choice: bool = False
    """Whether the critic chooses among 2 or 3 targets."""


CONDITIONS: Mapping[str, Condition] = {
    "no-ssm": Condition(active=False),
    "ssm": Condition(),
    "ssm-short-reaction": Condition(safety=SHORT_REACTION),
    "ssm-distance": Condition(safety=SafetySettings()),
    "pfl": Condition(safety=replace(AMONG_HANDS, pfl=True)),
    "choice-no-ssm": Condition(active=False, choice=True),
    "choice-ssm": Condition(choice=True),
    "choice-ssm-short-reaction": Condition(safety=SHORT_REACTION, choice=True),
    "choice-ssm-fast-hands": Condition(safety=FAST_HANDS, choice=True),
}
"""Conditions by row; ``no-ssm`` and ``choice-no-ssm`` come before those compared with them."""


def batch_of(bench: PickBench, condition: Condition, first: int) -> MonitoredPickBatch:
    """Return up to CHUNK episodes from number ``first`` on."""
    monitoring = MonitoringSettings(active=condition.active, rest_ends=False)
    candidates = CANDIDATES if condition.choice else (1, 1)
    settings = replace(bench.usual, n_candidates=candidates, time_limit_s=TIME_LIMIT_S)
    shared = bench.request.seed, settings, condition.safety, monitoring, first
    return MonitoredPickBatch(bench.cell, min(CHUNK, bench.n - first), *shared)


def run_condition(bench: PickBench, condition: Condition) -> MonitoredEpisodes:
    """Run all episodes under a condition."""
    rule = selection_rules.critic(HYSTERESIS) if condition.choice else selection_rules.fixed(0)
    parts = []
    for first in range(0, bench.n, CHUNK):
        batch = batch_of(bench, condition, first)
        Evaluator(bench.networks, batch).run(rule)
        parts.append(batch.runs())
    return joined(parts)


def row_of(name: str, runs: MonitoredEpisodes, without: MonitoredEpisodes | None) -> Json:
    """Return the result row of a condition.

    Args:
        without: The same episodes without the layer; None for those themselves.
    """
    won = runs.arrived
    admissible = runs.touched_moving & (runs.link_speed <= runs.allowed_speed)
    moving = runs.touched_moving & ~admissible
    ended = won | runs.touched_moving | runs.touched_cell
    rates = {
        "success": won,
        "contact_moving": moving,
        "contact_admissible": admissible,
        "contact_at_rest": runs.touched_at_rest,
        "contact_cell": runs.touched_cell,
        "timeout": ~ended,
    }
    both = won if without is None else won & without.arrived
    lost = None if without is None else mean_of((runs.seconds - without.seconds)[both])
    periods = float(runs.seconds.sum())
    return {
        "name": name,
        "n": len(won),
        **{key: rate_of(which) for key, which in rates.items()},
        "contacts_moving": int(moving.sum()),
        "time_to_success_s": mean_of(runs.seconds[won]),
        "time_lost_s": lost,
        "stopped": float(runs.stopped_s.sum()) / periods,
        "override": float(runs.override @ runs.seconds) / periods,
        "fastest_link_m_s": float(runs.link_speed[moving].max(initial=0.0)),
        "fastest_person_m_s": float(runs.person_speed.max(initial=0.0)),
    }


def run_ssm(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate picks under the safety layer, and the same episodes without it."""
    bench = PickBench(checkpoint, request, default=DEFAULT_EPISODES)
    runs: dict[str, MonitoredEpisodes] = {}
    can_choose = len(bench.cell.pick_stations) >= CANDIDATES[1]
    conditions = {name: c for name, c in CONDITIONS.items() if can_choose or not c.choice}
    rows, differences = request.rows(len(conditions)), list[Json]()
    for name, condition in conditions.items():
        runs[name] = run_condition(bench, condition)
        other = "choice-no-ssm" if condition.choice else "no-ssm"
        without = runs[other]
        rows.append(row_of(name, runs[name], without if condition.active else None))
        if condition.active:
            won = runs[name].arrived, without.arrived
            differences.append(paired(f"{name} - {other}", *won))
    stated = {name: one.safety.describe() for name, one in conditions.items() if one.active}
    started = batch_of(bench, CONDITIONS["ssm"], 0)
    started.reset()  # the first states of at most CHUNK episodes are stated
    return {
        "settings": {**settings_of(started), "hysteresis": HYSTERESIS, "safety": stated},
        "results": rows,
        "paired": differences,
    }
