"""Calling a kernel directly, without numba's look at the types."""

import numpy as np

from app.sim.core.jit import direct
from app.sim.geometry.capsules import least


def test_direct_call_gives_what_the_ordinary_one_gives() -> None:
    values = np.array([3.0, -2.0, 5.0])
    call = direct(least, (values,))
    assert call(values) == least(values) == (-2.0, 1)
    assert call(np.array([7.0, 1.0])) == (1.0, 1)


def test_direct_call_compiles_a_signature_once() -> None:
    values = np.array([3.0, -2.0, 5.0])
    assert direct(least, (values,)) is direct(least, (values[:2],))
