"""The replay memory: chances by priorities, n-step sums, and where they are cut."""

import numpy as np
import pytest
from gymnasium import spaces

from app.policies.algorithms.prioritized_replay import PrioritisedReplay

N_ENVS = 2
SPACE = spaces.Box(0, 255, (1,), np.uint8)


def memory(n_steps: int = 1, alpha: float = 1.0, rows: int = 8) -> PrioritisedReplay:
    return PrioritisedReplay(
        rows * N_ENVS,
        SPACE,
        spaces.Discrete(4),
        n_envs=N_ENVS,
        n_steps=n_steps,
        gamma=0.5,
        alpha=alpha,
        seed=3,
    )


def add(buffer: PrioritisedReplay, t: int, done: bool = False, cut_off: bool = False) -> None:
    """Add the transition t -> t + 1 with reward t + 1 in both environments."""
    infos = [{"TimeLimit.truncated": cut_off}] * N_ENVS
    here, there = np.full((N_ENVS, 1), t), np.full((N_ENVS, 1), t + 1)
    reward, ended = np.full(N_ENVS, t + 1.0), np.full(N_ENVS, done)
    buffer.add(here, there, np.zeros(N_ENVS), reward, ended, infos)


def filled(n: int, **settings: float) -> PrioritisedReplay:
    """Return a memory of the transitions from 0 to n - 1."""
    buffer = memory(**settings)
    for t in range(n):
        add(buffer, t)
    return buffer


def drawn_from(buffer: PrioritisedReplay, t: int):
    """Return one drawn transition that begins at t, as numbers."""
    sample = buffer.draw(256, 0.4)
    place = int(np.flatnonzero(sample.observations[:, 0].numpy() == t)[0])
    following = int(sample.next_observations[place, 0])
    return float(sample.rewards[place]), following, float(sample.discounts[place])


@pytest.mark.parametrize(
    ("third", "expected"),
    [
        pytest.param({}, (2.0 + 0.5 * 3.0 + 0.25 * 4.0, 4, 0.125), id="over n steps"),
        pytest.param({"done": True}, (2.0 + 0.5 * 3.0, 3, 0.0), id="to the end"),
        pytest.param(
            {"done": True, "cut_off": True},
            (2.0 + 0.5 * 3.0, 3, 0.25),
            id="by value if cut off",
        ),
    ],
)
def test_a_return_sums_discounted_rewards(third, expected):
    buffer = memory(n_steps=3)
    for t in range(6):
        add(buffer, t, **(third if t == 2 else {}))
    assert drawn_from(buffer, 1) == expected


@pytest.mark.parametrize("n_added", [6, 8, 11])
def test_a_return_does_not_run_over_the_head_of_the_buffer(n_added):
    buffer, newest = filled(n_added, n_steps=3), n_added - 1
    assert drawn_from(buffer, newest) == (newest + 1.0, newest + 1, 0.5)
    assert drawn_from(buffer, newest - 1)[1:] == (newest + 1, 0.25)


def test_transitions_are_drawn_in_proportion_to_their_priorities():
    buffer = filled(8)
    buffer.update(np.arange(16), np.arange(16) / 10.0)
    counts = np.zeros(16)
    for _ in range(400):
        counts += np.bincount(buffer.draw(64, 0.4).indices, minlength=16)
    wanted = np.arange(16) + 1e-3
    assert counts / counts.sum() == pytest.approx(wanted / wanted.sum(), abs=0.005)


def test_importance_weights_undo_the_chances():
    buffer = filled(8)
    errors = np.linspace(0.1, 1.6, 16)
    buffer.update(np.arange(16), errors)
    sample = buffer.draw(64, 1.0)
    weights = sample.weights.numpy()
    product = weights * (errors[sample.indices] + 1e-4)
    assert product == pytest.approx(np.full(64, product[0]), rel=1e-5)
    assert weights.max() == 1.0


def test_without_alpha_all_are_drawn_evenly():
    buffer = filled(8, alpha=0.0)
    buffer.update(np.arange(16), np.arange(16) * 5.0)
    counts = np.bincount(buffer.draw(1600, 0.4).indices, minlength=16)
    assert (np.abs(counts - 100) <= 1).all()
