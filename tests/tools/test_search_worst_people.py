"""The search for people beside the shipped pick policy that lower its success."""

import numpy as np

from app.policies.checkpoints import pretrained
from tools.search_worst_people import N_NUMBERS, hand_motion, search, success_beside


def test_a_search_returns_motions_from_the_worst_on() -> None:
    found = search(pretrained.load("pick"), [], n_motions=5, n_generations=1, n_kept=3)
    rates = [rate for _, rate in found]
    assert len(found) == 3 and rates == sorted(rates)
    assert all(0.0 < rate < 1.0 for rate in rates)


def test_rates_are_those_of_each_motion() -> None:
    aside, between = np.full(N_NUMBERS, 0.5), np.full(N_NUMBERS, 0.5)
    aside[1:13] = np.tile([0.0, 1.0, 0.0], 4)  # a hand that rests at the far edge
    between[1:13] = np.tile([0.5, 0.5, 0.3], 4)  # a hand that rests between robot and cubes
    motions = [hand_motion(one) for one in (aside, between)]
    rates = success_beside(pretrained.load("pick"), motions, per_motion=40, seed=3)
    assert rates[0] > rates[1]
