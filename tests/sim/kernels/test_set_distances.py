"""Distances of robot and person in 20,000 random configurations of the cell.

All 144 pairs are compared with plain numpy. python-fcl checks all of them in the first 300
configurations and the nearest one in each; the slow test checks all of them everywhere. FCL's
search for distances ends early on round bodies; ``fcl_capsules.py`` says what is asked instead
there.
"""

from itertools import islice

import numpy as np
import pytest

from app.sim.collision.fcl_reference import make_capsule
from app.sim.human import model as human
from tests.sim.configurations import RADII, Case, N, configurations
from tests.sim.fcl_capsules import check_against_fcl

EXACT = 1e-6


def ask_fcl(case: Case, i: int, j: int) -> None:
    """Hold the distance of one pair against FCL: value where apart, verdict where not."""
    radius = float(human.CAPSULE_RADII[j])
    body = make_capsule(radius, *case.person[j])
    check_against_fcl(case.robot[i], float(RADII[i]), body, float(case.d[i, j]))


def test_all_pairs_are_as_far_apart_as_plain_numpy_says_and_the_least_is_reported() -> None:
    worst, n_overlap = 0.0, 0
    for case in configurations():
        worst = max(worst, np.abs(case.d - case.expected).max())
        assert case.clearance == pytest.approx(case.d.min(), abs=1e-12)
        n_overlap += case.clearance < 0.0
    assert worst < EXACT
    assert 0.1 * N < n_overlap < 0.5 * N


def test_all_pairs_of_the_first_configurations_are_as_fcl_says() -> None:
    for case in islice(configurations(), 300):
        for i, j in np.ndindex(case.d.shape):
            ask_fcl(case, i, j)


@pytest.mark.slow
def test_all_pairs_of_all_configurations_are_as_fcl_says() -> None:
    for case in configurations():
        for i, j in np.ndindex(case.d.shape):
            ask_fcl(case, i, j)


def test_nearest_pair_of_every_configuration_is_as_fcl_says() -> None:
    for case in configurations():
        i, j = np.unravel_index(case.d.argmin(), case.d.shape)
        ask_fcl(case, int(i), int(j))
