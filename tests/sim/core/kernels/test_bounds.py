"""Comparison with bounds, against numpy's."""

import numpy as np
import pytest

from app.sim.core.kernels.bounds import are_inside


@pytest.mark.parametrize("sets", [0, 1, 3])
def test_comparison_is_that_of_numpy(sets: int) -> None:
    rng, found = np.random.default_rng(5), set()
    low, high = np.array([-1.0, 0.0, -np.inf, 0.5]), np.array([1.0, 0.9, np.inf, 0.9])
    for _ in range(200):
        values = rng.choice(
            [0.5, 0.9, np.nan, -1.0, 1e9], (sets, 4), p=[0.6, 0.2, 0.05, 0.1, 0.05]
        )
        expected = bool(((low <= values) & (values <= high)).all())
        assert are_inside(values.ravel(), low, high) is expected
        found.add(expected)
    assert found == ({True} if sets == 0 else {True, False})
