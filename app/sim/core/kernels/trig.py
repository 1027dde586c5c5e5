"""Sines and cosines without branches, compiled to vector instructions.

The person has sixteen angles, the robot six; a call of the mathematical library per angle costs
several times as much. Reduction to +-pi/4 in two parts (Cody and Waite), then the polynomials
of Cephes (S. Moshier, 1989, ``sin.c``). Tests show errors below 4e-16 for angles up to 100 rad.
"""

import math

import numpy as np

from app.sim.core.arrays import Vec
from app.sim.core.jit import FAST, kernel

_QUARTER_HIGH = 1.5707963267341256
"""The leading bits of pi / 2, so that its multiples are exact."""
_QUARTER_LOW = 6.077100506506192e-11
"""Remainder of pi / 2."""


@kernel(inline="always", error_model="numpy", fastmath=FAST)
def sincos(angle: float) -> tuple[float, float]:
    """Return sine and cosine of one angle [rad]."""
    k = np.floor(angle * (2.0 / math.pi) + 0.5)
    r = (angle - k * _QUARTER_HIGH) - k * _QUARTER_LOW
    z = r * r
    s = r + r * z * (
        -1.66666666666666307295e-1
        + z * (8.33333333332211858878e-3
        + z * (-1.98412698295895385996e-4
        + z * (2.75573136212857245213e-6
        + z * (-2.50507477628578072866e-8
        + z * 1.58962301576546568060e-10))))
    )  # fmt: skip
    c = 1.0 - 0.5 * z + z * z * (
        4.16666666666665929218e-2
        + z * (-1.38888888888730564116e-3
        + z * (2.48015872888517045348e-5
        + z * (-2.75573141792967388112e-7
        + z * (2.08757008419747316778e-9
        + z * -1.13585365213876817300e-11))))
    )  # fmt: skip
    quarter = k - 4.0 * np.floor(k * 0.25)
    odd = (quarter == 1.0) | (quarter == 3.0)
    first = c if odd else s
    second = s if odd else c
    return (
        -first if quarter >= 2.0 else first,
        -second if (quarter == 1.0) | (quarter == 2.0) else second,
    )


@kernel(error_model="numpy", fastmath=FAST)
def sines(angle: Vec, sine: Vec, cosine: Vec) -> None:
    """Write sine and cosine of every angle [rad]; all of shape (n,)."""
    for j in range(angle.shape[0]):
        sine[j], cosine[j] = sincos(angle[j])
