"""Presets as the service shows them: what a form needs to ask for their fields."""

from collections.abc import Sequence
from typing import Self

from pydantic import Field

from app.api.schemas.numbers import Answer
from app.policies.configs.presets import PRESETS, fields


class PresetField(Answer):
    """One value of a preset that an override may change."""

    name: str
    type: str = Field(description="int, float or choice")
    default: int | float | str
    minimum: int | float | None = Field(description="null for a choice")
    maximum: int | float | None = Field(description="null for a choice")
    unit: str = Field(description="empty for a plain number")
    help: str = Field(description="what it does, for people")
    choices: Sequence[str] | None = Field(description="what may be chosen; null for a number")


class PresetPublic(Answer):
    """One preset."""

    name: str
    cell: str = Field(description="work cell trained in")
    fields: list[PresetField]

    @classmethod
    def from_name(cls, name: str, cells: Sequence[str]) -> Self:
        """Describe a preset by its name.

        Args:
            name: Name of the preset.
            cells: Work cells it can be trained in; a field where there is a choice.
        """
        own = PRESETS[name].cell
        keys = PresetField.model_fields
        listed = [
            PresetField.model_validate({key: getattr(one, key) for key in keys})
            for one in fields(name)
        ]
        if len(cells) > 1:
            choice = PresetField(
                name="cell",
                type="choice",
                default=own,
                minimum=None,
                maximum=None,
                unit="",
                help="Work cell trained in.",
                choices=list(cells),
            )
            listed.insert(0, choice)
        return cls(name=name, cell=own, fields=listed)


class PresetList(Answer):
    """All presets."""

    items: list[PresetPublic]
