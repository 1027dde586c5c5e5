"""Job specs: the body of ``POST /v1/jobs``, stored unchanged with the job.

{"kind": "train", "preset": "pick-td3", "seed": 1,
 "overrides": {"learning": {"total_steps": 102400}}}
{"kind": "evaluate", "protocol": "pick-single", "episodes": 1000, "seed": 11,
 "checkpoint": "pick"}
{"kind": "evaluate", "protocol": "pick-mocap", "recordings": ["wave", "walk"]}
"""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Field, TypeAdapter

from app.errors import InvalidInput
from app.policies.configs import presets
from app.policies.configs.fields import entries
from app.policies.evaluation.registry import (
    MAX_EPISODES,
    PROTOCOLS,
    check_motions,
    default_checkpoint,
    most_episodes,
    require_use,
)
from app.policies.report.page import evaluations
from app.store.records import JobRecord, NewJob
from jobs.job_changes import Budget, JobChanges, JobLabels, StrictModel

MAX_SEED = 2**31 - 1
"""Greatest seed; every random stream accepts it."""
MAX_RECORDINGS = 32
"""Most recordings of one evaluation."""
MAX_RANGES = 8
"""Most fields that a sweep draws."""
MAX_TRIALS = 200
"""Most trials of a sweep."""
MAX_PARALLEL = 8
"""Most trials of a sweep at once."""
OBJECTIVES: Mapping[str, tuple[str, ...]] = {
    "pick": ("pick-single", "pick-choice"),
    "reach": ("reach-random", "reach-targets"),
    "sorting": ("sorting-grid", "sorting-tests"),
}
"""Evaluations that a sweep can use, by scenario: each states rates in its first row."""
QUANTITIES: Mapping[str, tuple[str, ...]] = {
    "pick": ("success", "collision", "timeout"),
    "reach": ("success", "collision", "timeout"),
    "sorting": ("success", "timeout"),
}
"""Rates that these evaluations state, by scenario."""


Seed = Annotated[int, Field(ge=0, le=MAX_SEED)]
Name = Annotated[str, Field(min_length=1, max_length=64)]


class _Spec(JobLabels):
    """Base of the specs of all kinds."""

    def _body(self) -> dict[str, Any]:
        """Return the spec to store: the given fields, without labels and budgets."""
        left_out = set(JobChanges.model_fields)
        return self.model_dump(mode="json", exclude_unset=True, exclude=left_out)


class TrainSpec(_Spec, Budget):
    """Train a policy: a preset, a seed, and fields that differ from the preset."""

    kind: Literal["train"]
    preset: Name = Field(description="name of GET /v1/presets")
    seed: Seed = Field(0, description="seed of every random stream")
    overrides: dict[str, Any] = Field(
        default_factory=dict, description="fields that differ from the preset, by group"
    )

    def new_job(self) -> NewJob:
        """Return the job to queue.

        Raises:
            InvalidInput: An unknown preset or override, or a value outside its bounds.
        """
        if self.preset not in presets.PRESETS:
            raise InvalidInput("preset", self.preset, "is not a preset", tuple(presets.PRESETS))
        return NewJob(
            kind=self.kind,
            spec=self._body(),
            preset=self.preset,
            seed=self.seed,
            overrides=self.overrides,
            total_steps=presets.resolve(self.preset, self.overrides).learning.total_steps,
            step_budget=self.step_budget,
            time_budget_s=self.time_budget_s,
            **self.labels(),
        )


class EvaluateSpec(_Spec):
    """Evaluate a checkpoint by a protocol."""

    kind: Literal["evaluate"]
    protocol: Name = Field(description="name of the protocol")
    checkpoint: Name | None = Field(
        None,
        description="SHA-256 or alias, of which the present checkpoint is evaluated; the "
        "protocol's own if null",
    )
    episodes: int | None = Field(None, ge=1, description="episodes; the protocol's own if null")
    seed: Seed = Field(0, description="seed of the episodes")
    recordings: list[Name] = Field(
        default_factory=list,
        max_length=MAX_RECORDINGS,
        description="names of GET /v1/recordings: needed by pick-mocap, optional for "
        "reach-ssm and risk-calibration",
    )

    def new_job(self) -> NewJob:
        """Return the job to queue, with the checkpoint in its spec.

        Raises:
            InvalidInput: An unknown protocol, too many episodes, or recordings that the
                protocol does not take; a checkpoint where it has no policy.
        """
        if self.protocol not in PROTOCOLS:
            raise InvalidInput("protocol", self.protocol, "is not a protocol", tuple(PROTOCOLS))
        most = most_episodes(self.protocol)
        if self.episodes is not None and self.episodes > most:
            raise InvalidInput("episodes", self.episodes, f"must lie in [1, {most}]")
        for place, name in enumerate(self.recordings):
            if name in self.recordings[:place]:
                raise InvalidInput(f"recordings[{place}]", name, "must be named once")
        check_motions(self.protocol, self.recordings, "recordings")
        require_use(self.protocol, self.checkpoint)
        checkpoint = self.checkpoint or default_checkpoint(self.protocol)
        spec = {**self._body(), "checkpoint": checkpoint}
        return NewJob(kind=self.kind, spec=spec, seed=self.seed, **self.labels())


class Range(StrictModel):
    """Values of one field of a sweep: from ``low`` to ``high``, or some ``choices``."""

    low: float | None = Field(None, description="least value")
    high: float | None = Field(None, description="greatest value")
    log: bool = Field(False, description="draw the logarithm uniformly; `low` must be above 0")
    choices: Annotated[list[int | float | str], Field(min_length=2, max_length=16)] | None = (
        Field(None, description="2 to 16 values instead of `low` and `high`")
    )

    def values(self, field: str) -> dict[str, float | str]:
        """Return the values to check, by the name of their member.

        Raises:
            InvalidInput: Members are missing, or contradict each other.
        """
        if self.choices is not None:
            if self.low is not None or self.high is not None:
                raise InvalidInput(f"{field}.choices", self.choices, "stands without low, high")
            for place, one in enumerate(self.choices):
                if one in self.choices[:place]:
                    raise InvalidInput(f"{field}.choices[{place}]", one, "must be given once")
            return {f"choices[{place}]": one for place, one in enumerate(self.choices)}
        if self.low is None or self.high is None:
            name = "low" if self.low is None else "high"
            raise InvalidInput(f"{field}.{name}", None, "must be given, or choices instead")
        if self.low >= self.high:
            raise InvalidInput(f"{field}.high", self.high, f"must be above low = {self.low}")
        if self.log and self.low <= 0:
            raise InvalidInput(f"{field}.low", self.low, "must be above 0 with log")
        return {"low": self.low, "high": self.high}


class Objective(StrictModel):
    """What the trials of a sweep are compared by: a rate of an evaluation."""

    protocol: Name = Field(description="an evaluation of the preset's scenario")
    quantity: Literal["success", "collision", "timeout"] = Field(
        "success",
        description="a rate of `quantities` of the preset; success is maximised, the others "
        "are minimised",
    )
    row: Name | None = Field(None, description="row of the result; the first if null")
    episodes: int | None = Field(None, ge=1, description="the protocol's own if null")
    seed: Seed = Field(11, description="seed of the episodes, the same for all trials")

    @property
    def maximised(self) -> bool:
        """Whether a greater value is better."""
        return self.quantity == "success"


class SweepSpec(_Spec):
    """Train a preset with drawn fields, several times, and evaluate each."""

    kind: Literal["sweep"]
    preset: Name = Field(description="name of GET /v1/presets")
    seed: Seed = Field(0, description="seed of the drawing and of every training")
    overrides: dict[str, Any] = Field(
        default_factory=dict, description="fields that differ from the preset in all trials"
    )
    ranges: Annotated[dict[Name, Range], Field(min_length=1, max_length=MAX_RANGES)] = Field(
        description="range of each drawn field, by its name such as `learning.gamma`"
    )
    trials: Annotated[int, Field(ge=2, le=MAX_TRIALS)] = Field(description="number of trials")
    parallel: Annotated[int, Field(ge=1, le=MAX_PARALLEL)] = Field(
        1, description="trials that are queued or run at once"
    )
    prune: bool = Field(
        True, description="stop trainings that are below the median of those before"
    )
    objective: Objective

    def new_job(self) -> NewJob:
        """Return the job to queue.

        Raises:
            InvalidInput: An unknown preset, field or protocol, or a value outside its bounds.
        """
        if self.preset not in presets.PRESETS:
            raise InvalidInput("preset", self.preset, "is not a preset", tuple(presets.PRESETS))
        presets.resolve(self.preset, self.overrides)
        self._check_ranges()
        self._check_objective()
        return NewJob(
            kind=self.kind,
            spec=self._body(),
            preset=self.preset,
            seed=self.seed,
            overrides=self.overrides,
            total_steps=self.trials,
            **self.labels(),
        )

    def with_fields(self, fields: Mapping[str, object]) -> dict[str, Any]:
        """Return the overrides of a trial, whose drawn fields have dotted names."""
        return merge(self.overrides, presets.nested(fields))

    def _check_ranges(self) -> None:
        known = [one.path for one in entries(presets.get(self.preset))]
        for path, drawn in self.ranges.items():
            field = f"ranges.{path}"
            if path not in known:
                raise InvalidInput(field, path, "is not a field of the preset", known)
            for name, value in drawn.values(field).items():
                try:
                    presets.resolve(self.preset, self.with_fields({path: value}))
                except InvalidInput as error:
                    rule, choices = error.rule, error.choices
                    raise InvalidInput(f"{field}.{name}", value, rule, choices) from None

    def _check_objective(self) -> None:
        scenario = self.preset.partition("-")[0]
        fitting, protocol = OBJECTIVES.get(scenario, ()), self.objective.protocol
        if protocol not in fitting:
            rule = f"must be an evaluation that sweeps of {scenario} presets can use"
            raise InvalidInput("objective.protocol", protocol, rule, fitting)
        stated, quantity = QUANTITIES[scenario], self.objective.quantity
        if quantity not in stated:
            rule = f"must be a rate that evaluations of {scenario} policies state"
            raise InvalidInput("objective.quantity", quantity, rule, stated)
        most = most_episodes(protocol)
        if self.objective.episodes is not None and self.objective.episodes > most:
            rule = f"must lie in [1, {most}]"
            raise InvalidInput("objective.episodes", self.objective.episodes, rule)


class ReportSpec(_Spec):
    """Write the report that compares Tandem with the thesis."""

    kind: Literal["report"]
    measure: bool = Field(
        False, description="measure again by evaluations; otherwise from stored results"
    )
    episodes: int | None = Field(
        None,
        ge=1,
        le=MAX_EPISODES,
        description="of each evaluation, where it admits so many; its own number if null",
    )
    seed: Seed = Field(11, description="seed of the evaluations")
    parallel: Annotated[int, Field(ge=1, le=MAX_PARALLEL)] = Field(
        1, description="evaluations that are queued or run at once"
    )

    def new_job(self) -> NewJob:
        """Return the job to queue.

        Raises:
            InvalidInput: A number of episodes is given without evaluations.
        """
        if self.episodes is not None and not self.measure:
            raise InvalidInput("episodes", self.episodes, "must be null without measure")
        return NewJob(
            kind=self.kind,
            spec=self._body(),
            seed=self.seed,
            total_steps=len(evaluations()) if self.measure else None,
            **self.labels(),
        )


AnySpec = TrainSpec | EvaluateSpec | SweepSpec | ReportSpec
JobSpec = Annotated[AnySpec, Field(discriminator="kind")]
_JOB_SPEC: TypeAdapter[AnySpec] = TypeAdapter(JobSpec)
SPEC_TYPES: Mapping[str, type[AnySpec]] = {
    "train": TrainSpec,
    "evaluate": EvaluateSpec,
    "sweep": SweepSpec,
    "report": ReportSpec,
}


def parse_spec(body: Mapping[str, Any]) -> AnySpec:
    """Return the spec of a stored or posted body.

    Raises:
        pydantic.ValidationError: A field is missing, unknown or breaks a rule.
    """
    return _JOB_SPEC.validate_python(body)


def budgets(job: JobRecord) -> dict[str, Any]:
    """Return the budgets of a job that has some."""
    values = {name: getattr(job, name) for name in Budget.model_fields}
    return {name: value for name, value in values.items() if value is not None}


def require_budgeted(job: JobRecord, changes: Mapping[str, Any]) -> None:
    """Check that budgets are given only to a job of a kind that has them.

    Raises:
        InvalidInput: One is given to an evaluation.
    """
    for name in Budget.model_fields:
        if name in changes and not issubclass(SPEC_TYPES[job.kind], Budget):
            rule = f"must not be given to job {job.number}: of kind {job.kind}, which has none"
            raise InvalidInput(name, changes[name], rule)


def merge(spec: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return a spec with changes: members of objects are merged, null removes one.

    Source: RFC 7396, JSON merge patch.
    """
    merged = {name: value for name, value in spec.items() if name not in changes}
    for name, value in changes.items():
        if isinstance(value, Mapping):
            inner = spec.get(name)
            merged[name] = merge(inner if isinstance(inner, Mapping) else {}, value)
        elif value is not None:
            merged[name] = value
    return merged
