"""Presets as the service shows them: what a form needs to ask for their fields."""

from typing import Self

from pydantic import Field

from app.api.schemas.numbers import Answer
from app.policies.presets import PRESETS, fields


class PresetField(Answer):
    """One field of a preset that an override may change."""

    name: str
    type: str = Field(description="int, float or choice")
    default: int | float | str
    minimum: int | float | None = Field(description="null for a choice")
    maximum: int | float | None = Field(description="null for a choice")
    choices: list[str] | None = Field(description="allowed names; null for a number")
    unit: str = Field(description="empty for a plain number")
    help: str = Field(description="what it does, for people")


class PresetPublic(Answer):
    """One preset."""

    name: str
    cell: str = Field(description="work cell trained in")
    fields: list[PresetField]

    @classmethod
    def from_name(cls, name: str) -> Self:
        """Describe a preset by its name."""
        listed = [
            PresetField(**{key: getattr(one, key) for key in PresetField.model_fields})
            for one in fields(name)
        ]
        return cls(name=name, cell=PRESETS[name].cell, fields=listed)


class PresetList(Answer):
    """All presets."""

    items: list[PresetPublic]
