"""Checkpoints as they are shown."""

from datetime import datetime
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from app.api.schemas.examples import shows
from app.api.schemas.numbers import Answer, Body
from app.errors import InvalidInput
from app.policies.checkpoints import pretrained
from app.policies.checkpoints.checkpoint import purpose_of
from app.policies.inference.recalibration import MIN_OUTCOMES, with_timeout
from app.policies.networks.outcome import OUTCOMES
from app.store.records import CheckpointRecord

ROUNDING = 0.01
"""Excess over 1 of a sum of probabilities that is accepted."""


class CheckpointPublic(Answer):
    """A stored checkpoint, without its tensors."""

    sha256: str
    number: int = Field(description="running number")
    aliases: list[str] = Field(description="its aliases")
    job_id: str | None = Field(
        description="job that made it; null for one that was shipped, uploaded or recalibrated"
    )
    step: int | None = Field(description="environment steps of that job")
    preset: str | None
    purpose: str = Field(
        description="`choosing tasks`, `reaching goals`, `sorting`, or `unreadable` if damaged"
    )
    size: int = Field(description="length of the tensors [bytes]")
    created_at: datetime
    tensors: str = Field(description="path of its safetensors bytes")
    manifest: dict[str, Any]

    @classmethod
    def from_domain(cls, record: CheckpointRecord) -> Self:
        """Return the schema of a record."""
        preset = record.manifest.get("preset", {})
        return cls.from_object(
            record,
            preset=preset.get("name") if isinstance(preset, dict) else None,
            purpose=purpose_of(record.manifest) if record.manifest else "unreadable",
            tensors=f"/v1/checkpoints/{record.sha256}/tensors",
        )


class CheckpointList(Answer):
    """One page of checkpoints, newest first."""

    items: list[CheckpointPublic]
    next_cursor: str | None = Field(description="`cursor` of the next page")


class ObservedOutcome(Body):
    """A pick that was carried out after a task selection: its prediction and outcome."""

    success: float = Field(ge=0.0, le=1.0, description="`success.mean` of the answer")
    contact: float = Field(
        ge=0.0, le=1.0, description="`contact.mean` of the answer; with `success` at most 1"
    )
    outcome: Literal["success", "contact", "timeout"]


class Recalibration(Body):
    """Outcomes observed in one cell."""

    model_config = shows(
        {
            "outcomes": [
                {"success": 0.8, "contact": 0.05, "outcome": "success"},
                {"success": 0.6, "contact": 0.1, "outcome": "timeout"},
            ]
            * (MIN_OUTCOMES // 2)
        }
    )

    outcomes: list[ObservedOutcome] = Field(
        min_length=MIN_OUTCOMES,
        max_length=10_000,
        description="predictions of this checkpoint whose pick has ended, in any order",
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        """Check that predictions are probabilities of outcomes that exclude each other.

        Raises:
            InvalidInput: Success and contact of a prediction exceed 1 together.
        """
        for k, one in enumerate(self.outcomes):
            if one.success + one.contact > 1.0 + ROUNDING:
                rule = f"must be at most 1 together with success = {one.success!r}"
                raise InvalidInput(f"outcomes[{k}].contact", one.contact, rule)
        return self

    def to_domain(self) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return predicted probabilities, shape (n, 3), and indices of outcomes, (n,)."""
        predicted = np.array([(one.success, one.contact) for one in self.outcomes])
        observed = np.array([OUTCOMES.index(one.outcome) for one in self.outcomes])
        return with_timeout(predicted[:, 0], predicted[:, 1]), observed


class AliasTarget(Body):
    """The checkpoint of an alias."""

    model_config = shows({"checkpoint": "reach"})

    checkpoint: str = Field(description="SHA-256 or another alias", min_length=1, max_length=64)


class Alias(Answer):
    """A name that points to a checkpoint."""

    name: str
    checkpoint: str = Field(description="SHA-256 of the checkpoint")
    shipped: bool = Field(description="whether it belongs to a shipped checkpoint")

    @classmethod
    def of(cls, name: str, sha256: str) -> Self:
        """Return the schema of an alias."""
        return cls(name=name, checkpoint=sha256, shipped=name in pretrained.ALIASES)


class AliasList(Answer):
    """All aliases."""

    items: list[Alias]
