"""Every term of the reach reward, and their sum, against hand results."""

import numpy as np
import pytest

from app.sim.reach.batch import THESIS_WEIGHTS
from app.sim.reach.kernels import reward as kernel
from app.sim.reach.kernels.reward import ReachWeights
from app.sim.scenario.kernels.episode import progress

C = np.array([3.0, 0.0, 0.0, -4.0, 0.0, 0.0])
PROGRESS = ReachWeights(c_d=0.0, c_p=1.0, gamma=1.0, c_a=0.0, c_step=0.004, c_c=4.0, c_s=4.0)


def test_progress_is_positive_when_coming_closer() -> None:
    assert progress(0.5, 0.4, 2.0, 1.0) == pytest.approx(0.2)
    assert progress(0.4, 0.5, 2.0, 1.0) == pytest.approx(-0.2)
    assert progress(0.5, 0.4, 1.0, 0.9) == pytest.approx(0.14)


def test_accelerating_costs_by_the_norm_of_the_coefficients() -> None:
    assert kernel.action_cost(C, 0.1) == pytest.approx(-0.5)
    assert kernel.action_cost(C, 0.0) == 0.0


def test_thesis_reward_is_that_of_method_2_3() -> None:
    assert kernel.reward(0.5, 0.4, C, True, False, THESIS_WEIGHTS) == pytest.approx(-5.9)
    assert kernel.reward(0.5, 0.09, C, False, True, THESIS_WEIGHTS) == pytest.approx(19.41)


def test_progress_reward_has_no_cost_of_distance() -> None:
    assert kernel.reward(0.5, 0.4, C, False, False, PROGRESS) == pytest.approx(0.096)
    assert kernel.reward(0.5, 0.5, C, True, False, PROGRESS) == pytest.approx(-4.004)


def test_every_coefficient_matters() -> None:
    zero = ReachWeights(*([0.0] * 7))._replace(gamma=1.0)
    terms = {"c_d": -0.4, "c_p": 0.1, "c_a": -5.0, "c_step": -1.0, "c_c": -1.0, "c_s": 1.0}
    for name, expected in terms.items():
        weights = zero._replace(**{name: 1.0})
        got = kernel.reward(0.5, 0.4, C, name == "c_c", name == "c_s", weights)
        assert got == pytest.approx(expected), name
