"""The motion predictor of workers: what it learns from, how well the shipped one does."""

from dataclasses import replace

import numpy as np
import pytest

from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.human.kernels import kinematics as body
from app.sim.prediction.kernels.worker import N_JOINTS, TIMES, predict_worker
from app.sim.prediction.weights import new_worker_predictor, worker_predictor
from tools.train_worker_predictor import (
    PostureMoments,
    fitted,
    hand_errors,
    hands,
    other_people,
    training_people,
    watched,
    write_worker_predictor,
)


def others(kind: str) -> PostureMoments:
    """Return motion that the shipped predictor was not trained on."""
    return watched(replace(training_people(), work=other_people()[kind]), 24, 80, 99)


def test_a_moment_is_a_posture_and_its_changes() -> None:
    moments = others("library")
    n = len(moments.now)
    assert moments.now.shape == (n, 2 * N_JOINTS)
    assert moments.change.shape == (n, len(TIMES), N_JOINTS)
    assert moments.size.shape == (n, body.N_SIZE)
    growing = np.linalg.norm(moments.change, axis=2).mean(axis=0)
    assert (np.diff(growing) > 0).all()


@pytest.mark.parametrize("kind", ["library", "faster", "off-task"])
def test_the_shipped_predictor_is_better_than_constant_speed(kind: str) -> None:
    ours, constant = hand_errors(new_worker_predictor(), others(kind))
    assert (ours[1:] < 0.8 * constant[1:]).all()
    assert ours[2] < 0.6 * constant[2]


def test_learning_makes_the_errors_small() -> None:
    moments = watched(training_people(), 24, 80, 5)
    few, more = (hand_errors(fitted(moments, n, 0), moments)[0] for n in (3, 400))
    assert (more < 0.8 * few).all()


def test_people_outside_the_training_move_on_at_constant_speed() -> None:
    predictor, q, qd = new_worker_predictor(), np.zeros(N_JOINTS), np.full(N_JOINTS, 0.1)
    q[0] = 6.0  # six metres away
    ahead: Vec = np.empty((len(TIMES), N_JOINTS))
    predict_worker(predictor, q, qd, ahead)
    np.testing.assert_allclose(ahead, q + np.outer(TIMES, qd))


def test_a_written_predictor_is_the_same_when_read(tmp_path, monkeypatch) -> None:
    moments = watched(training_people(), 8, 40, 5)
    made, file = fitted(moments, 3, 0), tmp_path / "worker.npz"
    write_worker_predictor(made, file)
    monkeypatch.setattr("app.sim.prediction.weights.WORKER_FILE", file)
    read = new_worker_predictor()
    ahead: Vec = np.empty((2, len(TIMES), N_JOINTS))
    for predictor, out in zip((made, read), ahead, strict=True):
        predict_worker(predictor, moments.now[0, :18], moments.now[0, 18:], out)
    np.testing.assert_allclose(ahead[0], ahead[1], atol=1e-5)


def test_hands_are_those_of_the_body_model() -> None:
    moments = others("library")
    q, sizes = moments.now[:5, :N_JOINTS], moments.size[:5]
    palms = [human.palms(joints, size) for joints, size in zip(q, sizes, strict=True)]
    np.testing.assert_allclose(hands(q, sizes), palms, rtol=0.0, atol=1e-12)


def test_predictors_share_no_work_space() -> None:
    one, other = new_worker_predictor(), new_worker_predictor()
    assert not np.shares_memory(one.y, other.y)
    same = worker_predictor(one.network, one.mean, one.scale)
    assert np.shares_memory(same.network.w1, one.network.w1)
