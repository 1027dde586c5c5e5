"""Body sizes: lengths of the segments of the 18-DoF model.

The compiled person takes its lengths as an array, its *size* (``human/kernels/kinematics.py``);
this file gives them names and makes people of any stature. The median person is 1.72 m tall.

A person is described by three percentiles of adults: stature; length of the arms and width of
the shoulders, both relative to stature. With ``z`` the normal quantile of a percentile, stature
is ``1.72 m (1 + 0.054 z)``, the arms ``1 + 0.04 z`` and the shoulders ``1 + 0.05 z`` of what
goes with it, so the 5th to 95th percentile of stature spans 1.57 to 1.87 m.

Source: docs/method.md 4 (a human model whose dimensions are part of the state). Spreads: women
and men pooled, from the means and standard deviations of stature, radiale-stylion plus
acromion-radiale length and biacromial breadth of ANSUR II (Gordon et al., *2012 Anthropometric
Survey of U.S. Army Personnel*, 2014), rounded. Deviates: the three are drawn independently of
one another.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import lru_cache
from statistics import NormalDist

import numpy as np

from app.errors import InvalidInput, interval
from app.sim.core.arrays import Vec
from app.sim.human.kernels import kinematics as body

STATURE = 1.72
"""Lengths of the median person [m]."""
SPREADS = {"stature": 0.054, "arms": 0.04, "shoulders": 0.05}
"""Standard deviations, relative; arms and shoulders at given stature."""
PERCENTILES = (1.0, 99.0)
"""Range of percentiles."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BodySize:
    """Lengths of the segments of the 18-DoF model [m]; the defaults are the median person."""

    pelvis: float = 0.95
    """Pelvis above the floor, standing."""
    trunk: float = body.MEDIAN_TRUNK
    """Pelvis to the base of the neck."""
    clavicle_r: float = 0.18
    """Base of the neck to the right shoulder."""
    clavicle_l: float = 0.18
    """Base of the neck to the left shoulder."""
    upper_arm_r: float = 0.29
    """Right shoulder to elbow."""
    upper_arm_l: float = 0.29
    """Left shoulder to elbow."""
    forearm_r: float = 0.26
    """Right elbow to wrist."""
    forearm_l: float = 0.26
    """Left elbow to wrist."""
    hand: float = body.MEDIAN_HAND
    """Wrist to the middle of the palm."""
    head: float = body.MEDIAN_HEAD
    """Base of the neck to the centre of the head."""
    hip: float = 0.09
    """Half the distance of the hips."""
    girth: float = 1.0
    """Thickness of all parts, relative to the median person's."""

    def lengths(self) -> dict[str, float]:
        """Return the lengths by name [m]."""
        return {name: getattr(self, name) for name in NAMES}

    @property
    def stature(self) -> float:
        """Height from the floor to the top of the head [m]."""
        crown = self.head * 0.22 / body.MEDIAN_HEAD
        return self.pelvis + self.trunk + crown + 0.11 * self.girth

    def arm(self, hand: str) -> float:
        """Return the length of a straight arm [m]: shoulder to palm, hand ``r`` or ``l``."""
        named = self.lengths()
        return named[f"upper_arm_{hand}"] + named[f"forearm_{hand}"] + self.hand

    def vector(self, floor_z: float) -> Vec:
        """Return the size as kernels take it, shape (N_SIZE,).

        Args:
            floor_z: Height of the floor in the cell's frame [m].
        """
        values = list(self.lengths().values())
        values[body.PELVIS_Z] += floor_z
        return np.array(values, dtype=np.float64)


MEDIAN = BodySize()
"""The person of the 50th percentiles."""
NAMES = tuple(entry.name for entry in fields(BodySize))
"""Names of the lengths, in the kernels' order."""


@lru_cache(maxsize=256)
def percentile_body(
    stature: float = 50.0, arms: float = 50.0, shoulders: float = 50.0, pelvis: float = 0.95
) -> BodySize:
    """Return the person of given percentiles of adults.

    Args:
        stature: Percentile of the stature, in PERCENTILES.
        arms: Percentile of the arms' length at that stature.
        shoulders: Percentile of the shoulders' width at that stature.
        pelvis: Pelvis of the median person above the floor [m].

    Raises:
        InvalidInput: A percentile lies outside PERCENTILES or is not finite.
    """
    tall = _factor("stature", stature)
    arm, wide = tall * _factor("arms", arms), tall * _factor("shoulders", shoulders)
    scale: Mapping[str, float] = {
        **dict.fromkeys(("upper_arm_r", "upper_arm_l", "forearm_r", "forearm_l", "hand"), arm),
        **dict.fromkeys(("clavicle_r", "clavicle_l"), wide),
    }
    lengths = BodySize(pelvis=pelvis).lengths()
    return BodySize(**{name: scale.get(name, tall) * value for name, value in lengths.items()})


def _factor(name: str, percentile: float) -> float:
    """Return the ratio of a measure at a percentile to the median."""
    low, high = PERCENTILES
    if not low <= percentile <= high:
        raise InvalidInput(name, percentile, f"must be a percentile in {interval(low, high)}")
    return 1.0 + SPREADS[name] * NormalDist().inv_cdf(percentile / 100.0)
