"""The networks that say how walkers go on: what they learn from, how well the shipped do."""

import numpy as np
import pytest
import torch

from app.sim.prediction.kernels.networks import N_PAST, N_TIMES, RADIUS_MIDDLE, RADIUS_SCALE
from app.sim.prediction.weights import new_motion_predictor
from tools import train_motion_predictor as predictor
from tools.train_motion_predictor import (
    constant_motion_errors,
    disturbed,
    errors,
    fitted,
    watched,
)

OTHERS = watched(4000, 99)
"""People the shipped networks were not made from."""


def test_a_moment_is_what_it_says() -> None:
    assert OTHERS.radius_seen.shape == (4000, 3 + N_PAST)
    assert OTHERS.radius.shape == OTHERS.path.shape == (4000, N_TIMES)
    r = RADIUS_MIDDLE + RADIUS_SCALE * OTHERS.radius_seen[:, [0]]
    later = r + RADIUS_SCALE * OTHERS.radius
    assert later.min() > 0.2 - 1e-6 and later.max() < 0.5 + 1e-6
    age = OTHERS.radius_seen[:, 2]
    np.testing.assert_allclose(np.unique(age.round(3)), [0.0, 0.2, 0.4, 0.6, 0.8], atol=1e-6)
    newest = OTHERS.radius_seen[age == 0.0]
    np.testing.assert_array_equal(newest[:, 0], newest[:, 3])


def test_the_shipped_networks_do_much_better_than_constant_motion_errors() -> None:
    net = new_motion_predictor()
    radius = errors(net.radius, OTHERS.radius_seen, OTHERS.radius)
    path_error = errors(net.path, OTHERS.path_seen, OTHERS.path)
    linear, constant = constant_motion_errors(OTHERS)
    assert (radius[5:] < 0.5 * linear[5:]).all()
    assert (path_error[5:] < 0.6 * constant[5:]).all()


def test_learning_makes_the_errors_small() -> None:
    torch.manual_seed(0)
    few = predictor.network_of(fitted(OTHERS.radius_seen, OTHERS.radius, 0.0, 0.0, n_updates=3))
    more = predictor.network_of(
        fitted(OTHERS.radius_seen, OTHERS.radius, 0.0, 0.0, n_updates=300)
    )
    before = errors(few, OTHERS.radius_seen, OTHERS.radius)
    assert (errors(more, OTHERS.radius_seen, OTHERS.radius)[8:] < 0.8 * before[8:]).all()


def test_disturbed_moments_are_shorter_or_noisy_and_still_right() -> None:
    torch.manual_seed(1)
    seen, said = torch.as_tensor(OTHERS.radius_seen), torch.as_tensor(OTHERS.radius)
    clean = disturbed(seen, said, 0.0, 0.0)
    assert torch.equal(clean[0][:, :3], seen[:, :3]) and torch.equal(clean[1], said)
    shorter = (clean[0] != seen).any(dim=1)
    assert 0.05 < shorter.float().mean() < 0.15
    held = clean[0][shorter]
    assert (held[:, -1] == held[:, -2]).float().mean() > 0.9
    noisy = disturbed(seen, said, 0.2, 0.5)
    # What will be is what it was, whatever is seen of now.
    torch.testing.assert_close(noisy[0][:, :1] + noisy[1], seen[:, :1] + said)
    changed = (noisy[0][:, 0] != seen[:, 0]).float().mean()
    assert changed == pytest.approx(predictor.NOISY_SHARE, abs=0.05)
