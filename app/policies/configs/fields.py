"""Base of the training configurations: groups of fields with bounds, units and help texts.

A configuration is a pydantic model of groups, one per concern; each group is a model of plain
fields. Bounds and choices are part of the field declarations, so that the HTTP interface and
the training form read them from the model. No learning library is imported here.
"""

from collections.abc import Iterator
from typing import Annotated, Any, NamedTuple, Self, TypeVar, get_args

from annotated_types import Ge, Le
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    model_validator,
)
from pydantic.fields import FieldInfo

from app.errors import InvalidInput, interval
from app.sim.cells.parts import CELL_NAME


def _integral(value: object) -> object:
    """Return whole floats such as 1e6 as integers, other values unchanged."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


Whole = Annotated[int, BeforeValidator(_integral)]
"""An integer; whole floats are accepted."""


CellName = Annotated[str, Field(pattern=CELL_NAME)]
"""Name of a work cell; whether it exists is checked elsewhere."""


def number(default: float, low: float, high: float, unit: str, text: str) -> Any:
    """Declare a number.

    Args:
        default: Default value.
        low: Smallest allowed value.
        high: Largest allowed value.
        unit: Unit; empty for a dimensionless number.
        text: Label, and after a colon what the field does.
    """
    extra: dict[str, Any] = {"unit": unit}
    return Field(default, ge=low, le=high, description=text, json_schema_extra=extra)


def choice(default: str, text: str) -> Any:
    """Declare a field of a ``Literal`` type, with its label and what it does."""
    return Field(default, description=text)


class FieldGroup(BaseModel):
    """Fields of one concern. Unknown fields, other types and non-finite numbers are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class Learning(FieldGroup):
    """Fields of every learning algorithm."""

    total_steps: Whole = number(1_280_000, 1_000, 100_000_000, "env steps", "Total steps")
    n_envs: Whole = number(128, 1, 4096, "", "Parallel envs: stepped together")
    buffer_size: Whole = number(400_000, 2_000, 2_000_000, "transitions", "Replay buffer size")
    batch_size: Whole = number(256, 16, 4096, "transitions", "Minibatch size")
    learning_starts: Whole = number(
        25_600, 0, 1_000_000, "env steps", "Learning starts: steps before the first update"
    )
    lr_start: float = number(5e-4, 1e-6, 1e-2, "", "Initial learning rate")
    lr_end: float = number(2e-5, 1e-7, 1e-2, "", "Final learning rate")
    gamma: float = number(0.99, 0.5, 0.9999, "per step", "Discount factor γ")
    n_steps: Whole = number(5, 1, 20, "steps", "Length n of n-step returns")
    alpha: float = number(
        0.0, 0.0, 1.0, "", "Priority exponent α: of replay; 0 samples uniformly"
    )
    beta: float = number(
        0.4, 0.0, 1.0, "", "Importance exponent β: at the start; it grows to 1"
    )
    progress_steps: Whole = number(
        51_200, 1, 10_000_000, "env steps", "Curve interval: steps between two points"
    )
    checkpoint_steps: Whole = number(
        512_000, 1, 10_000_000, "env steps", "Checkpoint interval: steps between two of them"
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        """Check that intervals are whole multiples and that learning takes place."""
        rounds = (
            ("total_steps", "n_envs"),
            ("progress_steps", "n_envs"),
            ("checkpoint_steps", "progress_steps"),
        )
        for name, of in rounds:
            value, unit = getattr(self, name), getattr(self, of)
            if value % unit:
                near = max(unit, round(value / unit) * unit)
                rule = f"must be a multiple of {of} = {unit}, say {near}"
                raise InvalidInput(f"learning.{name}", value, rule)
        if self.buffer_size < 16 * self.n_envs:
            rule = f"must be at least 16 n_envs = {16 * self.n_envs}"
            raise InvalidInput("learning.buffer_size", self.buffer_size, rule)
        if self.learning_starts >= self.total_steps:
            rule = f"must be below total_steps = {self.total_steps}"
            raise InvalidInput("learning.learning_starts", self.learning_starts, rule)
        return self


class TrainingConfig(FieldGroup):
    """Every number of a training except its seed; scenarios add their groups."""

    name: str
    """Name of the preset in requests."""
    cell: CellName


Config = TypeVar("Config", bound=TrainingConfig)


class PresetEntry(NamedTuple):
    """One field of a configuration."""

    path: str
    """Group and name: ``"learning.gamma"``."""
    value: float | str
    """Its value."""
    info: FieldInfo
    """Its declaration."""


def choices_of(info: FieldInfo) -> tuple[str, ...]:
    """Return the allowed names of a choice; none for other fields."""
    return get_args(info.annotation)


def bounds_of(info: FieldInfo) -> tuple[Any, Any] | None:
    """Return the smallest and the largest value of a number; None for other fields."""
    low = [one.ge for one in info.metadata if isinstance(one, Ge)]
    high = [one.le for one in info.metadata if isinstance(one, Le)]
    return (low[0], high[0]) if low and high else None


def unit_of(info: FieldInfo) -> str:
    """Return the unit of a field; empty where it has none."""
    extra = info.json_schema_extra
    return str(extra.get("unit", "")) if isinstance(extra, dict) else ""


def entries(config: TrainingConfig) -> Iterator[PresetEntry]:
    """Return the fields of all groups of a configuration, in order."""
    for name in type(config).model_fields:
        group = getattr(config, name)
        if isinstance(group, FieldGroup):
            for field, info in type(group).model_fields.items():
                yield PresetEntry(f"{name}.{field}", getattr(group, field), info)


def read_config(kind: type[Config], data: object, prefix: str) -> Config:
    """Return a configuration of plain data.

    Args:
        kind: Its class.
        data: Groups by name; fields that are left out have their defaults.
        prefix: Start of the field names in messages: ``"overrides"``.

    Raises:
        InvalidInput: A field is unknown, breaks its rule or contradicts another one.
    """
    try:
        return kind.model_validate(data)
    except ValidationError as error:
        raise _invalid_input(error, kind, prefix) from None
    except InvalidInput as error:
        field = f"{prefix}.{error.field}"
        raise InvalidInput(field, error.value, error.rule, error.choices) from None


def _invalid_input(
    error: ValidationError, kind: type[TrainingConfig], prefix: str
) -> InvalidInput:
    """Return the first fault that pydantic found, with the rule of its field."""
    fault = error.errors()[0]
    path = [str(part) for part in fault["loc"]]
    field, value = ".".join([prefix, *path]), fault["input"]
    if fault["type"] == "missing":
        return InvalidInput(field, None, "must be given")
    groups = _groups_of(kind)
    owner = kind if len(path) == 1 else groups[path[0]]
    info = owner.model_fields.get(path[-1])
    if info is None:
        return _unknown_field(field, value, path, kind)
    if path == ["cell"]:
        return InvalidInput(field, value, "must be the name of a work cell")
    if path == ["name"]:
        return InvalidInput(field, value, "must be text")
    if (bounds := bounds_of(info)) is not None:
        return InvalidInput(field, value, _rule_of_number(fault["type"], bounds, unit_of(info)))
    if choices := choices_of(info):
        return InvalidInput(field, value, "must be one of the choices", choices)
    return InvalidInput(field, value, "must be an object of fields")


def _rule_of_number(fault: str, bounds: tuple[Any, Any], unit: str) -> str:
    """Return the rule that a number breaks, by pydantic's type of the fault."""
    rules = {
        "finite_number": "must be finite",
        "float_type": "must be a number",
        "int_type": "must be a whole number",
    }
    return rules.get(fault) or f"must lie in {interval(*bounds)} {unit}".rstrip()


def _unknown_field(
    field: str, value: object, path: list[str], kind: type[TrainingConfig]
) -> InvalidInput:
    """Return the error of an unknown field, with the known ones as choices."""
    groups = _groups_of(kind)
    if len(path) > 1:
        return InvalidInput(field, value, "is not a field", tuple(groups[path[0]].model_fields))
    meant = [f"{name}.{path[0]}" for name, one in groups.items() if path[0] in one.model_fields]
    return InvalidInput(field, value, "is not a field", tuple(meant) or ("cell", *groups))


def _groups_of(kind: type[TrainingConfig]) -> dict[str, type[FieldGroup]]:
    """Return the groups of a configuration by name."""
    return {
        name: info.annotation
        for name, info in kind.model_fields.items()
        if isinstance(info.annotation, type) and issubclass(info.annotation, FieldGroup)
    }
