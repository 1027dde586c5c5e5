"""Trials of a sweep as they are shown."""

from collections.abc import Sequence
from typing import Any, Self

from pydantic import Field

from app.api.schemas.numbers import Answer
from app.store.records import JobRecord
from jobs.composed.sweeps import SweepTrial, best_of, spec_of


class TrialPublic(Answer):
    """One trial of a sweep."""

    trial: int = Field(description="its number, from 1")
    parameters: dict[str, Any] = Field(description="drawn fields by their dotted names")
    state: str = Field(
        description="queued, running, evaluating, succeeded, pruned, failed or cancelled"
    )
    value: dict[str, float] | None = Field(
        description="objective with its 95 % interval: mean, low, high"
    )
    best: bool
    error: str | None
    step: int = Field(description="environment steps of its training")
    total_steps: int | None
    job: str = Field(description="id of its training")
    number: int = Field(description="running number of its training")
    evaluation: str | None = Field(description="id of the job that evaluates it")
    checkpoint: str | None = Field(description="SHA-256 of the trained policy")


class TrialList(Answer):
    """The trials of a sweep."""

    quantity: str = Field(description="quantity of the objective")
    maximised: bool = Field(description="whether a greater value is better")
    items: list[TrialPublic]

    @classmethod
    def from_domain(cls, job: JobRecord, trials: Sequence[SweepTrial]) -> Self:
        """Return the schema of the trials of a sweep."""
        spec = spec_of(job)
        best = best_of(spec, trials)
        return cls(
            quantity=spec.objective.quantity,
            maximised=spec.objective.maximised,
            items=[_public(one, one is best) for one in trials],
        )


def _public(trial: SweepTrial, best: bool) -> TrialPublic:
    training, evaluation = trial.training, trial.evaluation
    return TrialPublic.from_object(
        trial,
        trial=trial.number,
        best=best,
        step=training.step,
        total_steps=training.total_steps,
        job=training.id,
        number=training.number,
        evaluation=None if evaluation is None else evaluation.id,
        checkpoint=(training.result or {}).get("checkpoint"),
    )
