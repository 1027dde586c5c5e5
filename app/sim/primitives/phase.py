"""Phase of a motion: how far it is, 0 at its start and 1 at its end, as a function of time.

A movement primitive is a function of the phase z; the time law z(t) says how fast it is gone
through (temporal modulation, Paraschos et al. 2013, section 2.1). Here are the laws and the
reading of a sampled motion between its samples. A law never goes backward.

Source: METHOD 3.4. Minimum jerk: Flash and Hogan 1985, ``z = 10 x^3 - 15 x^4 + 6 x^5``.
Monotone interpolation: Fritsch and Carlson 1980 (PCHIP), which stays between its neighbours.
"""

import numpy as np
from scipy.interpolate import PchipInterpolator

from app.errors import InvalidInput
from app.sim.core.arrays import Vec


def min_jerk(x: Vec) -> Vec:
    """Return the minimum-jerk law from 0 to 1, at rest at both ends.

    Args:
        x: Share of the duration, any shape; taken as 0 before the start, 1 after the end.
    """
    x = np.clip(x, 0.0, 1.0)
    return np.asarray(x**3 * (10.0 + x * (-15.0 + 6.0 * x)))


def min_jerk_rate(x: Vec) -> Vec:
    """Return the derivative of :func:`min_jerk`, ``30 x^2 (1 - x)^2``."""
    x = np.clip(x, 0.0, 1.0)
    return np.asarray(30.0 * x**2 * (1.0 - x) ** 2)


def monotone(x: Vec, knots: Vec, phases: Vec) -> Vec:
    """Return a phase law through given knots, increasing wherever they are.

    Args:
        x: Shares of the duration, any shape.
        knots: Shares of the duration, increasing, the first 0, the last 1, shape (n,).
        phases: Phase at each knot, never decreasing, the first 0, the last 1, shape (n,).
    """
    knots, phases = np.asarray(knots, dtype=np.float64), np.asarray(phases, dtype=np.float64)
    if knots.shape != phases.shape or knots.ndim != 1 or len(knots) < 2:
        raise InvalidInput("phases", phases, "must be one per knot, at least two")
    for name, values, least in (("knots", knots, 1e-9), ("phases", phases, 0.0)):
        if not (np.diff(values) >= least).all() or values[0] != 0.0 or values[-1] != 1.0:
            raise InvalidInput(name, values, "must go from 0 to 1 without turning back")
    law = PchipInterpolator(knots, phases)
    return np.asarray(np.clip(law(np.clip(x, 0.0, 1.0)), 0.0, 1.0))


def random_phase_profile(
    x: Vec, rng: np.random.Generator, spread: float = 0.25, n_parts: int = 4
) -> Vec:
    """Return a random phase law: every part of the motion at a pace of its own.

    The durations of ``n_parts`` equal parts of the phase are each multiplied by
    ``exp(N(0, spread))`` and scaled back to the whole.

    Args:
        x: Shares of the duration, any shape.
        rng: Source of chance.
        spread: Standard deviation of a part's log duration; 0 is the linear law.
        n_parts: Number of parts.
    """
    lengths = np.exp(rng.normal(0.0, spread, n_parts))
    knots = np.concatenate([[0.0], np.cumsum(lengths) / lengths.sum()])
    knots[-1] = 1.0
    return monotone(x, knots, np.linspace(0.0, 1.0, n_parts + 1))


def read(q: Vec, phase: Vec) -> Vec:
    """Return a sampled motion at given phases, between the samples' least and greatest.

    Args:
        q: Positions at equal steps of the phase, shape (T, n), T >= 2.
        phase: Phases in [0, 1], shape (m,).

    Returns:
        Positions, shape (m, n). Where a phase is a sample's, that sample; between samples no
        position leaves the interval of its two neighbours, so joint limits stay kept.
    """
    at = np.linspace(0.0, 1.0, len(q))
    return np.asarray(PchipInterpolator(at, q)(np.clip(phase, 0.0, 1.0)))
