"""Base class and array types of snapshots, the JSON of the HTTP API."""

from typing import Annotated, ClassVar

import numpy as np
from pydantic import ConfigDict, Field, PlainSerializer, PlainValidator

from app.sim.core.arrays import Vec

Numbers = Annotated[
    Vec, PlainValidator(np.asarray), PlainSerializer(np.ndarray.tolist, return_type=list[float])
]
"""Read-only array, a list of numbers in JSON."""
Internal = Annotated[Numbers, Field(exclude=True)]
"""Read-only array for the viewer alone."""


def frozen(values: Vec) -> Vec:
    """Return a read-only copy."""
    copy = np.array(values, dtype=np.float64)
    copy.setflags(write=False)
    return copy


class ReadModel:
    """Base class of frozen dataclasses that are JSON objects, described by field docstrings."""

    __slots__ = ()
    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(use_attribute_docstrings=True)
