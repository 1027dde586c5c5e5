"""Results of jobs as they are shown: evaluations, comparison of fields and curves."""

from datetime import datetime
from typing import Any, Self

from pydantic import ConfigDict, Field, ValidationError

from app.api.schemas.numbers import Answer, Body, Counts, Finite, Sparse
from app.store.records import JobRecord
from jobs.comparison import JobComparison

_OWN = ("protocol", "checkpoint", "seed", "episodes", "results", "cpu_seconds")


class EvaluationRow(Body):
    """A row of the result of an evaluation, with rates and quantities of any name."""

    model_config = ConfigDict(extra="allow")

    name: str
    n: int


class EvaluationResult(Body):
    """What the result of an evaluation contains at least."""

    model_config = ConfigDict(extra="allow")

    protocol: str
    checkpoint: str | None = None
    seed: int
    episodes: int
    results: list[EvaluationRow] = Field(min_length=1)
    cpu_seconds: Finite


class EvaluationPublic(Answer):
    """The result of an evaluation."""

    id: str = Field(description="id of its job")
    number: int = Field(description="running number of its job")
    name: str | None = Field(description="name of its job")
    protocol: str
    checkpoint: str | None = Field(description="SHA-256; null for a protocol without policy")
    seed: int = Field(description="seed of the episodes")
    episodes: int = Field(description="episodes of the first row")
    results: list[dict[str, Any]] = Field(
        description="rows: name, n, rates with mean and 95 % interval (`low`, `high`), and "
        "quantities with their unit as suffix"
    )
    conditions: dict[str, Any] = Field(description="assumptions, commit and machine")
    cpu_seconds: float = Field(description="CPU time [s]")
    finished_at: datetime | None

    @classmethod
    def from_domain(cls, job: JobRecord) -> Self | None:
        """Return the schema of a succeeded evaluation; None: its result cannot be read."""
        result = dict(job.result or {})
        own = {name: result.pop(name, None) for name in _OWN}
        try:
            return cls.from_object(job, **own, conditions=result)
        except ValidationError:
            return None


class EvaluationList(Answer):
    """One page of evaluations, newest first."""

    items: list[EvaluationPublic]
    next_cursor: str | None = Field(description="`cursor` of the next page")


class ComparedJob(Answer):
    """One job of a comparison."""

    id: str
    number: int
    name: str | None
    kind: str
    preset: str | None
    seed: int
    state: str
    step: int = Field(description="environment steps done")


class Difference(Answer):
    """A field that has not the same value in all jobs."""

    field: str = Field(description="dotted name, `learning.gamma`")
    values: list[Any] = Field(description="value of each job, in their order; null if absent")


class CurveGroup(Answer):
    """Curve of the jobs that differ in nothing but the seed."""

    label: str = Field(
        description="values of the fields that differ; the preset if it differs or none does; "
        "where several groups have the same, with the numbers of their jobs"
    )
    jobs: list[str] = Field(description="their ids")
    mean: Sparse = Field(description="mean over the jobs at each of `steps`")
    low: Sparse = Field(description="least value of a job")
    high: Sparse = Field(description="greatest value of a job")
    n: Counts = Field(description="number of jobs that have reached the step")


class ComparisonPublic(Answer):
    """Several jobs side by side."""

    jobs: list[ComparedJob]
    differences: list[Difference] = Field(description="only fields that differ")
    quantities: list[str] = Field(description="quantities that the curves have")
    quantity: str | None = Field(description="the compared one; null without points")
    steps: list[int] = Field(
        description="environment steps of the curves; at most 10,000, more are thinned evenly"
    )
    groups: list[CurveGroup] = Field(description="trainings, by their values but the seed")

    @classmethod
    def from_domain(cls, found: JobComparison) -> Self:
        """Return the schema of a comparison."""
        differences = [
            {"field": field, "values": values} for field, values in found.differences.items()
        ]
        return cls.from_object(found, differences=differences)
