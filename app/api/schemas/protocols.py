"""Evaluation protocols, with the inputs that each takes."""

import inspect
from typing import Literal, Self

from pydantic import Field

from app.api.schemas.numbers import Answer
from app.policies.evaluation.registry import (
    PROTOCOLS,
    WITH_MOTIONS,
    WITH_OR_WITHOUT_MOTIONS,
    WITHOUT_CHECKPOINT,
    default_checkpoint,
    most_episodes,
    task_measured,
)

Recordings = Literal["none", "optional", "required"]


class ProtocolPublic(Answer):
    """A protocol and the inputs that it takes."""

    name: str
    title: str = Field(description="what it evaluates")
    purpose: str | None = Field(
        description="`purpose` of the checkpoints that it takes; null for one without policy"
    )
    checkpoint: str | None = Field(description="alias of its default checkpoint")
    max_episodes: int = Field(
        description="greatest number of episodes; of each pair or target if there are several"
    )
    recordings: Recordings = Field(
        description="whether recordings of people can or must be named"
    )

    @classmethod
    def from_name(cls, name: str) -> Self:
        """Describe a protocol by its name."""
        has_policy = name not in WITHOUT_CHECKPOINT
        recordings: Recordings = "optional" if name in WITH_OR_WITHOUT_MOTIONS else "none"
        if name in WITH_MOTIONS:
            recordings = "required"
        return cls(
            name=name,
            title=(inspect.getdoc(PROTOCOLS[name]) or name).partition("\n")[0].replace("`", ""),
            purpose=task_measured(name) if has_policy else None,
            checkpoint=default_checkpoint(name),
            max_episodes=most_episodes(name),
            recordings=recordings,
        )


class ProtocolList(Answer):
    """All protocols."""

    items: list[ProtocolPublic]
