"""Presets with the declarations of their fields, as the training form needs them."""

from collections.abc import Sequence
from typing import Self

from pydantic import Field

from app.api.schemas.numbers import Answer
from app.policies.configs.fields import PresetEntry, bounds_of, choices_of, entries, unit_of
from app.policies.configs.presets import PRESETS, TITLES
from jobs.spec import OBJECTIVES, QUANTITIES


class PresetField(Answer):
    """One field of a preset that an override may change."""

    name: str = Field(description="group and field, `learning.gamma`; `cell` has no group")
    type: str = Field(description="int, float or choice")
    default: int | float | str
    minimum: int | float | None = Field(description="null for a choice")
    maximum: int | float | None = Field(description="null for a choice")
    unit: str = Field(description="empty for a dimensionless number")
    title: str = Field(description="label, with the symbol where there is one")
    help: str = Field(description="what the field does; may be empty")
    choices: Sequence[str] | None = Field(description="allowed values; null for a number")

    @classmethod
    def from_entry(cls, entry: PresetEntry) -> Self:
        """Describe one field."""
        title, _, text = (entry.info.description or "").partition(": ")
        low, high = bounds_of(entry.info) or (None, None)
        choices = choices_of(entry.info) or None
        number = "int" if isinstance(entry.value, int) else "float"
        return cls(
            name=entry.path,
            type="choice" if choices else number,
            default=entry.value,
            minimum=low,
            maximum=high,
            unit=unit_of(entry.info),
            title=title,
            help=text,
            choices=choices,
        )


class PresetPublic(Answer):
    """One preset."""

    name: str
    title: str = Field(description="what it trains, and the algorithm")
    cell: str = Field(description="work cell of the training")
    fields: list[PresetField]
    objectives: Sequence[str] = Field(description="protocols that a sweep can use")
    quantities: Sequence[str] = Field(description="rates that these protocols state")

    @classmethod
    def from_name(cls, name: str, cells: Sequence[str]) -> Self:
        """Describe a preset by its name.

        Args:
            cells: Work cells that it can be trained in; a field where there are several.
        """
        own = PRESETS[name].cell
        listed = [PresetField.from_entry(one) for one in entries(PRESETS[name])]
        if len(cells) > 1:
            choice = PresetField(
                name="cell",
                type="choice",
                default=own,
                minimum=None,
                maximum=None,
                unit="",
                title="Work cell",
                help="",
                choices=list(cells),
            )
            listed.insert(0, choice)
        scenario = name.partition("-")[0]
        return cls(
            name=name,
            title=TITLES[name],
            cell=own,
            fields=listed,
            objectives=OBJECTIVES.get(scenario, ()),
            quantities=QUANTITIES.get(scenario, ()),
        )


class PresetList(Answer):
    """All presets."""

    items: list[PresetPublic]
