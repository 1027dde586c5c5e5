"""Comparison of jobs as it is shown."""

from typing import Any, Self

import numpy as np
from pydantic import Field

from app.api.schemas.numbers import Answer
from app.sim.core.arrays import Vec
from jobs.comparison import Group, JobComparison


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

    label: str = Field(description="values of the fields that differ; the preset if none does")
    jobs: list[str] = Field(description="their ids")
    mean: list[float | None] = Field(description="mean over the jobs at each of `steps`")
    low: list[float | None] = Field(description="least value of a job")
    high: list[float | None] = Field(description="greatest value of a job")
    n: list[int] = Field(description="number of jobs that have reached the step")

    @classmethod
    def from_domain(cls, group: Group) -> Self:
        """Return the schema of a group."""
        return cls(
            label=group.label,
            jobs=list(group.jobs),
            mean=_finite(group.mean),
            low=_finite(group.low),
            high=_finite(group.high),
            n=[int(k) for k in group.n],
        )


class ComparisonPublic(Answer):
    """Several jobs side by side."""

    jobs: list[ComparedJob]
    differences: list[Difference] = Field(description="only fields that differ")
    quantities: list[str] = Field(description="quantities that the curves have")
    quantity: str | None = Field(description="the compared one; null without points")
    steps: list[int] = Field(description="environment steps of the curves")
    groups: list[CurveGroup] = Field(description="trainings, by their values but the seed")

    @classmethod
    def from_domain(cls, found: JobComparison) -> Self:
        """Return the schema of a comparison."""
        names = ComparedJob.model_fields
        return cls(
            jobs=[ComparedJob(**{n: getattr(job, n) for n in names}) for job in found.jobs],
            differences=[
                Difference(field=field, values=list(values))
                for field, values in found.differences.items()
            ],
            quantities=list(found.quantities),
            quantity=found.quantity,
            steps=list(found.steps),
            groups=[CurveGroup.from_domain(group) for group in found.groups],
        )


def _finite(values: Vec) -> list[float | None]:
    return [float(value) if np.isfinite(value) else None for value in values]
