"""Sweeps: trainings of a preset with drawn fields, each evaluated, run by the supervisor.

A trial is a training and the evaluation of its checkpoint, two jobs of the sweep. The database
has the complete state: the study is rebuilt from these jobs whenever fields are drawn, so that
a killed server continues. Fields are drawn by the tree-structured Parzen estimator, trainings
pruned by the median rule.

Source: Bergstra et al. (2011), Golovin et al. (2017); Optuna (Akiba et al. 2019).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import optuna
from optuna.distributions import (
    BaseDistribution,
    CategoricalDistribution,
    FloatDistribution,
    IntDistribution,
)
from optuna.trial import FrozenTrial, TrialState, create_trial

from app.errors import InvalidInput, NotFound
from app.policies.configs import presets
from app.policies.configs.fields import entries
from app.store import composed_jobs, metrics
from app.store.engine import Store
from app.store.records import JobRecord, MetricRow
from jobs.composed.composer import Composer
from jobs.composed.parts import queue_part
from jobs.spec import SweepSpec, parse_spec

optuna.logging.set_verbosity(optuna.logging.ERROR)

STARTUP_TRIALS = 4
"""Number of complete trials before any is pruned."""
WARM_UP = 0.2
"""Share of a training in which it is not pruned."""
MAX_DRAWS = 50
"""Number of draws after which fields that contradict each other end the sweep."""
TrialPhase = Literal[
    "queued", "running", "evaluating", "succeeded", "pruned", "failed", "cancelled"
]
ENDED = ("succeeded", "pruned", "failed", "cancelled")


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepTrial:
    """One trial of a sweep."""

    number: int
    """Its number, from 1."""
    training: JobRecord
    """Its training."""
    evaluation: JobRecord | None
    """The evaluation of the trained policy."""
    parameters: Mapping[str, float | str]
    """Drawn fields by their dotted names."""
    state: TrialPhase
    """Its state; a cancelled trial is replaced by another one."""
    value: Mapping[str, float] | None
    """Objective with its 95 % interval: mean, low, high."""
    error: str | None
    """Reason of a failure."""


def spec_of(job: JobRecord) -> SweepSpec:
    """Return the spec of a sweep.

    Raises:
        NotFound: The job is no sweep.
    """
    if job.kind != "sweep":
        raise NotFound("sweep", job.id)
    spec = parse_spec(job.spec)
    assert isinstance(spec, SweepSpec)
    return spec


def trials_of(store: Store, job: JobRecord) -> tuple[SweepTrial, ...]:
    """Return the trials of a sweep, in their order.

    Raises:
        NotFound: The job is no sweep.
    """
    spec, made = spec_of(job), composed_jobs.parts_of(store, job.id)
    evaluations = {one.trial: one for one in made if one.kind == "evaluate"}
    return tuple(
        _trial(spec, one, evaluations.get(one.trial)) for one in made if one.kind == "train"
    )


def best_of(spec: SweepSpec, trials: Sequence[SweepTrial]) -> SweepTrial | None:
    """Return the trial with the best value; the first of equal ones, None before one has it."""
    sign = 1.0 if spec.objective.maximised else -1.0
    return max(
        (one for one in trials if one.value is not None),
        key=lambda one: sign * (one.value or {})["mean"],
        default=None,
    )


def _trial(spec: SweepSpec, training: JobRecord, evaluation: JobRecord | None) -> SweepTrial:
    """Return the trial of its jobs."""
    state, value, error = _outcome(spec, training, evaluation)
    groups = [path.partition(".") for path in spec.ranges]
    return SweepTrial(
        number=training.trial or 0,
        training=training,
        evaluation=evaluation,
        parameters={
            f"{group}.{name}": training.overrides[group][name] for group, _, name in groups
        },
        state=state,
        value=value,
        error=error,
    )


def _outcome(
    spec: SweepSpec, training: JobRecord, evaluation: JobRecord | None
) -> tuple[TrialPhase, Mapping[str, float] | None, str | None]:
    if training.state == "failed":
        return "failed", None, training.error
    if training.state == "cancelled":
        return "pruned" if training.ended_by == "pruned" else "cancelled", None, None
    if training.state != "succeeded":
        return ("queued" if training.state == "queued" else "running"), None, None
    if evaluation is None or not evaluation.is_final:
        return "evaluating", None, None
    if evaluation.state != "succeeded":
        state: TrialPhase = "failed" if evaluation.state == "failed" else "cancelled"
        return state, None, evaluation.error
    rows: list[dict[str, Any]] = (evaluation.result or {}).get("results", [])
    named = [one for one in rows if spec.objective.row in (None, one["name"])]
    value = named[0].get(spec.objective.quantity) if named else None
    if isinstance(value, Mapping):
        return "succeeded", value, None
    names = ", ".join(str(one["name"]) for one in rows)
    wanted = f"no {spec.objective.quantity} in row {spec.objective.row or 'first'!r}"
    return "failed", None, f"{wanted} of the evaluation, which has the rows {names}"


def _lack_of_objective(trial: SweepTrial) -> str | None:
    """Return why no trial of the sweep can have a value; None: this one has no such fault."""
    evaluation = trial.evaluation
    if trial.value is not None or evaluation is None or evaluation.state != "succeeded":
        return None
    if not (evaluation.result or {}).get("results"):
        return None  # damaged; those of other trials may be read
    return f"no trial can have a value; trial {trial.number}: {trial.error}"


class Sweeps(Composer):
    """Starts, prunes and ends the trials of the open sweeps."""

    kind = "sweep"

    def __init__(self) -> None:
        super().__init__()
        self._judged: dict[str, int] = {}

    def _advance(self, store: Store, job: JobRecord) -> None:
        spec, trials = spec_of(job), trials_of(store, job)
        if job.state == "cancelling":
            made = [part for one in trials for part in (one.training, one.evaluation) if part]
            composed_jobs.cancel(store, job, made)
            return
        if job.state == "queued":
            composed_jobs.start(store, job.id)
        lack = next(filter(None, map(_lack_of_objective, trials)), None)
        if lack is not None:
            composed_jobs.end(store, job.id, "failed", error=lack)
            return
        for one in trials:
            if one.state == "evaluating" and one.evaluation is None:
                _evaluate(store, job, spec, one)
        if spec.prune:
            self._prune(store, spec, trials)
        counted = [one for one in trials if one.state != "cancelled"]
        ended = [one for one in counted if one.state in ENDED]
        best = best_of(spec, trials)
        mean = best.value["mean"] if best is not None and best.value is not None else None
        done = min(len(ended), spec.trials)
        composed_jobs.record(store, job.id, done, {"best": mean})
        room = min(spec.trials - len(counted), spec.parallel - len(counted) + len(ended))
        if room > 0:
            _start(store, job, spec, trials)
        elif len(ended) == len(counted):  # one that was resumed may be beyond the number
            _end(store, job, best, trials)

    def _prune(self, store: Store, spec: SweepSpec, trials: Sequence[SweepTrial]) -> None:
        """Cancel the running trainings that the median rule ends."""
        running = [one for one in trials if one.state == "running"]
        fresh = [
            one for one in running if self._judged.get(one.training.id) != one.training.step
        ]
        complete = [one for one in trials if one.state == "succeeded"]
        if not fresh or len(complete) < STARTUP_TRIALS:
            return
        for one in fresh:
            self._judged[one.training.id] = one.training.step
            curve = _values(spec, metrics.thinned_curve(store, one.training.id))
            before = max(curve, default=0) - 1
            study = _study(spec, 0)
            for other in complete:  # its value at the last step of the curve is compared
                point = metrics.list_metrics(
                    store, other.training.id, after_step=before, limit=1
                )
                study.add_trial(_frozen(spec, other, _values(spec, point)))
            warm_up = int(WARM_UP * (one.training.total_steps or 0))
            pruner = optuna.pruners.MedianPruner(STARTUP_TRIALS, warm_up)
            if pruner.prune(study, _frozen(spec, one, curve)):
                composed_jobs.mark_pruned(store, one.training.id)
                composed_jobs.request_cancel(store, one.training)


def _start(store: Store, job: JobRecord, spec: SweepSpec, trials: Sequence[SweepTrial]) -> None:
    """Draw the fields of the next trial and queue its training."""
    parts = composed_jobs.parts_of(store, job.id)  # evaluations of deleted trainings, too
    number = max((one.trial or 0 for one in parts), default=0) + 1
    overrides = _drawn(spec, trials, number)
    body = {"kind": "train", "preset": spec.preset, "seed": spec.seed, "overrides": overrides}
    _queue(store, job, number, body)


def _evaluate(store: Store, job: JobRecord, spec: SweepSpec, trial: SweepTrial) -> None:
    """Queue the evaluation of a trained policy."""
    objective = spec.objective
    body = {
        "kind": "evaluate",
        "protocol": objective.protocol,
        "checkpoint": (trial.training.result or {}).get("checkpoint"),
        "episodes": objective.episodes,
        "seed": objective.seed,
    }
    _queue(store, job, trial.number, body)


def _queue(store: Store, job: JobRecord, number: int, body: Mapping[str, Any]) -> None:
    name, key = f"sweep {job.number}, trial {number}", f"{job.id}-{number}-{body['kind']}"
    queue_part(store, job, number, name, key, body)


def _drawn(spec: SweepSpec, trials: Sequence[SweepTrial], number: int) -> dict[str, Any]:
    """Return the overrides of a new trial; refuse fields that contradict in every draw."""
    study = _study(spec, spec.seed + number)
    for one in trials:
        study.add_trial(_frozen(spec, one, {}))
    for draw in range(MAX_DRAWS):
        found = study.ask(_distributions(spec))
        overrides = spec.with_fields(found.params)
        try:
            presets.resolve(spec.preset, overrides)
        except InvalidInput:
            if draw == MAX_DRAWS - 1:
                raise
            study.tell(found, state=TrialState.FAIL)
        else:
            break
    return overrides


def _study(spec: SweepSpec, seed: int) -> optuna.Study:
    sampler = optuna.samplers.TPESampler(seed=seed % 2**31)
    return optuna.create_study(
        direction="maximize" if spec.objective.maximised else "minimize", sampler=sampler
    )


def _distributions(spec: SweepSpec) -> dict[str, BaseDistribution]:
    defaults = {one.path: one.value for one in entries(presets.get(spec.preset))}
    found: dict[str, BaseDistribution] = {}
    for path, drawn in spec.ranges.items():
        if drawn.choices is not None:
            found[path] = CategoricalDistribution(tuple(drawn.choices))
        elif isinstance(defaults[path], int):
            low, high = int(drawn.low or 0), int(drawn.high or 0)
            found[path] = IntDistribution(low, high, log=drawn.log)
        else:
            found[path] = FloatDistribution(drawn.low or 0.0, drawn.high or 0.0, log=drawn.log)
    return found


_STATES: Mapping[TrialPhase, TrialState] = {
    "succeeded": TrialState.COMPLETE,
    "pruned": TrialState.PRUNED,
    "failed": TrialState.FAIL,
    "cancelled": TrialState.FAIL,
}


def _frozen(spec: SweepSpec, trial: SweepTrial, curve: Mapping[int, float]) -> FrozenTrial:
    """Return a trial in Optuna's form."""
    return create_trial(
        state=_STATES.get(trial.state, TrialState.RUNNING),
        value=None if trial.value is None else trial.value["mean"],
        params=dict(trial.parameters),
        distributions=_distributions(spec),
        intermediate_values=dict(curve),
    )


def _values(spec: SweepSpec, rows: Sequence[MetricRow]) -> dict[int, float]:
    """Return the objective's quantity at points of a learning curve, by step."""
    values = {row.step: row.values.get(spec.objective.quantity) for row in rows}
    return {step: value for step, value in values.items() if value is not None}


def _end(
    store: Store, job: JobRecord, best: SweepTrial | None, trials: Sequence[SweepTrial]
) -> None:
    """End a sweep; without any value it has failed, with the reason of its last failure."""
    if best is None:
        errors = [f"trial {one.number}: {one.error}" for one in trials if one.error]
        text = f"no trial has a value; {errors[-1] if errors else 'all were pruned'}"
        composed_jobs.end(store, job.id, "failed", error=text)
        return
    result = {
        "trial": best.number,
        "parameters": dict(best.parameters),
        "value": dict(best.value or {}),
        "job": best.training.id,
        "checkpoint": (best.training.result or {}).get("checkpoint"),
    }
    composed_jobs.end(store, job.id, "succeeded", result=result)
