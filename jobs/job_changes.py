"""What can be changed of a posted job: labels and budgets."""

from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field
from pydantic_core import PydanticCustomError

from app.errors import interval
from app.one_line import ONE_LINE

MAX_STEPS = 1_000_000_000
"""Greatest step budget."""
MAX_TIME_S = 366 * 86_400.0
"""Greatest time budget [s]."""


def _run_time(value: float) -> float:
    """Return a time budget [s] that is neither too short nor too long."""
    if not 1.0 <= value <= MAX_TIME_S:
        raise PydanticCustomError("run_time", f"must lie in {interval(1, int(MAX_TIME_S))} s")
    return value


RunTime = Annotated[
    float,
    AfterValidator(_run_time),
    Field(json_schema_extra={"minimum": 1, "maximum": MAX_TIME_S}),
]
"""Time budget [s]; its rule states the unit, since people give it in minutes."""


class StrictModel(BaseModel):
    """Model without unknown fields, non-finite numbers and values of another JSON type."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, frozen=True, strict=True)


class JobLabels(StrictModel):
    """What people write on a job; it changes nothing of what the job computes."""

    name: Annotated[str, Field(pattern=ONE_LINE, max_length=80)] | None = Field(
        None, description="a name for people, one line"
    )
    notes: Annotated[str, Field(max_length=4000)] | None = Field(
        None, description="text for people"
    )
    priority: Annotated[int, Field(ge=-100, le=100)] = Field(
        0, description="queued jobs of a higher priority start first"
    )

    def labels(self) -> dict[str, Any]:
        """Return the labels; an empty text counts as none."""
        return {
            "name": (self.name or "").strip() or None,
            "notes": (self.notes or "").strip() or None,
            "priority": self.priority,
        }


class Budget(StrictModel):
    """What a job may use before it ends and keeps its state; part of no spec."""

    step_budget: Annotated[int, Field(ge=1, le=MAX_STEPS)] | None = Field(
        None,
        description="environment steps: the job ends at the first point of its curve at or "
        "beyond it, and can be resumed with a larger one; null for none",
    )
    time_budget_s: RunTime | None = Field(
        None,
        description="run time of all attempts, without waiting in the queue [s]: the job ends "
        "after the step in which it is reached; null for none",
    )


class JobChanges(JobLabels, Budget):
    """What can be changed of a posted job."""

    def given(self) -> dict[str, Any]:
        """Return the given members; an empty text counts as none."""
        members = {**self.labels(), **self.model_dump(include=set(Budget.model_fields))}
        return {name: members[name] for name in members if name in self.model_fields_set}
