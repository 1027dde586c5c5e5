"""Number types of the schemas: finite always, so that NaN and infinity name their field."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Finite = Annotated[float, Field(allow_inf_nan=False)]
Time = Annotated[float, Field(ge=-1e10, le=1e10)]
Vector3 = Annotated[list[Finite], Field(min_length=3, max_length=3)]
Vector6 = Annotated[list[Finite], Field(min_length=6, max_length=6)]
Vector18 = Annotated[list[Finite], Field(min_length=18, max_length=18)]


class Body(BaseModel):
    """Root of what comes in: unknown fields and non-finite numbers are errors."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, frozen=True)


class Answer(BaseModel):
    """Root of what goes out."""

    model_config = ConfigDict(frozen=True)
