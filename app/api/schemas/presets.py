"""Presets as the service shows them: what a form needs to ask for their fields."""

from typing import Any, Self

from pydantic import Field

from app.api.schemas.numbers import Answer
from app.policies.presets import PRESETS, fields


class PresetField(Answer):
    """One number of a preset that an override may change."""

    name: str
    type: str
    default: Any
    minimum: float | None
    maximum: float | None
    unit: str | None
    help: str


class PresetPublic(Answer):
    """One preset."""

    name: str
    title: str = Field(description="what it is, for people")
    fields: list[PresetField]

    @classmethod
    def from_name(cls, name: str) -> Self:
        """Describe a preset by its name."""
        listed = [
            PresetField(**{key: getattr(one, key) for key in PresetField.model_fields})
            for one in fields(name)
        ]
        return cls(name=name, title=PRESETS[name].title, fields=listed)


class PresetList(Answer):
    """All presets."""

    items: list[PresetPublic]
