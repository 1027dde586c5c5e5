import math

import numpy as np

from app.sim.core.kernels.trig import sines

LIMIT = 4e-16


def error(angle: np.ndarray) -> float:
    """Greatest error of sine and cosine."""
    sine, cosine = np.empty_like(angle), np.empty_like(angle)
    sines(angle, sine, cosine)
    exact = np.array([(math.sin(a), math.cos(a)) for a in angle.tolist()])
    return float(np.abs(np.column_stack([sine, cosine]) - exact).max())


def test_sines_are_exact_to_the_last_digits_up_to_a_hundred_radians() -> None:
    rng = np.random.default_rng(31)
    assert error(rng.uniform(-100.0, 100.0, 200_000)) <= LIMIT
    assert error(rng.uniform(-math.pi, math.pi, 200_000)) <= LIMIT


def test_sines_are_exact_at_and_around_the_ends_of_quarters() -> None:
    ends = np.arange(-127, 128) * (math.pi / 4.0)
    near = [ends + step for step in (0.0, 1e-16, -1e-16, 1e-9, -1e-9, 1e-4, -1e-4)]
    assert error(np.concatenate(near)) <= LIMIT
    assert error(np.array([0.0, -0.0, 5e-324, 1e-300])) <= LIMIT
