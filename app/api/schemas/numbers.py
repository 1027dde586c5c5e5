"""Base classes and number types of the schemas."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Finite = Annotated[float, Field(allow_inf_nan=False)]
Time = Annotated[float, Field(ge=-1e10, le=1e10)]
Vector3 = Annotated[list[Finite], Field(min_length=3, max_length=3)]
Vector6 = Annotated[list[Finite], Field(min_length=6, max_length=6)]
Vector18 = Annotated[list[Finite], Field(min_length=18, max_length=18)]


class Body(BaseModel):
    """Base of requests.

    Errors are unknown fields, non-finite numbers, and values of another JSON type, such as
    ``true`` or ``"1"`` for a number; an integer is a number.
    """

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, frozen=True, strict=True)


class Answer(BaseModel):
    """Base of answers."""

    model_config = ConfigDict(frozen=True)
