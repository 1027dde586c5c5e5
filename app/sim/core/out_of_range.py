"""An input outside the training range or the joint limits."""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True, kw_only=True)
class OutOfRangeValue:
    """One input outside what the checkpoint was trained on, or a joint outside its limits."""

    field: str
    """Name of the input, such as ``"people[0].q.pelvis_y"``."""
    value: float
    """Its value, in the input's unit."""
    low: float
    """Least value met in training, or lower limit of the joint."""
    high: float
    """Greatest value met in training, or upper limit of the joint."""
    of: Literal["training", "limits"] = "training"
    """Meaning of ``low`` and ``high``: training range or joint limits."""
