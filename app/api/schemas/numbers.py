"""Base classes and number types of the schemas."""

from collections.abc import Iterable
from math import isfinite
from typing import Annotated, Any, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

Finite = Annotated[float, Field(allow_inf_nan=False)]
Time = Annotated[float, Field(ge=-1e10, le=1e10)]
"""Time on a clock of the caller [s], from any origin."""
Word = Annotated[str, Field(min_length=1, max_length=64)]
"""A name in a request: of a colour or place, or SHA-256 or alias of a checkpoint."""
Vector3 = Annotated[list[Finite], Field(min_length=3, max_length=3)]
Vector6 = Annotated[list[Finite], Field(min_length=6, max_length=6)]
Vector18 = Annotated[list[Finite], Field(min_length=18, max_length=18)]


def _listed(values: Iterable[float | None]) -> list[float | None]:
    """Return the numbers of an array or list, None in place of NaN and infinity."""
    known = (None if value is None else float(value) for value in values)
    return [value if value is not None and isfinite(value) else None for value in known]


Listed = Annotated[list[float], BeforeValidator(_listed)]
"""Numbers of an array, all finite."""
Counts = Annotated[list[int], BeforeValidator(_listed)]
"""Whole numbers of an array."""
Data = dict[str, Any]
"""Content of an answer, or of a part of it, as the members of its model: data that is made by
this program and need not be validated before it is written as JSON."""
Sparse = Annotated[list[float | None], BeforeValidator(_listed)]
"""Numbers of an array that are null where they are not finite."""


class Body(BaseModel):
    """Base of requests.

    Errors are unknown fields, non-finite numbers, and values of another JSON type, such as
    ``true`` or ``"1"`` for a number; an integer is a number.
    """

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, frozen=True, strict=True)


class Answer(BaseModel):
    """Base of answers."""

    model_config = ConfigDict(frozen=True, from_attributes=True)

    @classmethod
    def from_object(cls, source: object, **more: Any) -> Self:
        """Return the answer whose fields are ``more`` and the attributes of an object."""
        names = [name for name in cls.model_fields if name not in more]
        known = {name: getattr(source, name) for name in names if hasattr(source, name)}
        return cls.model_validate({**known, **more})
