"""The minimum-jerk phase starts and ends at rest."""

import numpy as np

from app.sim.primitives.phase import min_jerk


def test_minimum_jerk_goes_from_rest_to_rest() -> None:
    np.testing.assert_allclose(
        min_jerk(np.array([-1.0, 0.0, 0.5, 1.0, 2.0])), [0, 0, 0.5, 1, 1]
    )
    step = 1e-4
    np.testing.assert_allclose(min_jerk(np.array([step, 1.0 - step])), [0.0, 1.0], atol=1e-11)
