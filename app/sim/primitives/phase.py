"""Minimum-jerk phase of a motion.

Source: docs/method.md 3.4; Flash and Hogan (1985), ``z = 10 x^3 - 15 x^4 + 6 x^5``.
"""

import numpy as np

from app.sim.core.arrays import Vec


def min_jerk(x: Vec) -> Vec:
    """Return the minimum-jerk phase from 0 to 1, at rest at both ends.

    Args:
        x: Fraction of the duration, any shape; clipped to [0, 1].
    """
    x = np.clip(x, 0.0, 1.0)
    return np.asarray(x**3 * (10.0 + x * (-15.0 + 6.0 * x)))
