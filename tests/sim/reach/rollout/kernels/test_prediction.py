"""Prediction of walkers: rest, radius limits and the edge of the walking area."""

import numpy as np
import pytest

from app.sim.cells.cell import load_cell
from app.sim.core.arrays import Vec
from app.sim.people.kernels.pedestrian import (
    N_STATE,
    R_MAX,
    R_MIN,
    VX,
    VY,
    X_MAX,
    X_MIN,
    Y_MAX,
    Y_MIN,
    R,
    X,
    Y,
    remember_as_now,
)
from app.sim.prediction.kernels.networks import STEP_S
from app.sim.prediction.weights import new_motion_predictor
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.reach.kernels.observation import NO_PERSON
from app.sim.reach.kernels.observation_workspace import (
    ReachObservationWorkspace,
    new_observation_workspace,
)
from app.sim.reach.rollout.kernels.prediction import (
    N_MOMENTS,
    new_predicted_motion,
    predict_people,
)
from app.sim.scene.scene import HumanKind

N_ENVS = 200
HELD = np.zeros((N_ENVS, 6), dtype=np.float32)


def batch_of(seed: int, people: tuple[HumanKind, ...] = ("walker",)) -> ReachBatch:
    settings = ReachSettings(people=people, observation="forecast", time_limit_s=60.0)
    batch = ReachBatch(load_cell("shared-workspace"), N_ENVS, seed, settings)
    batch.reset()
    return batch


def workspace(batch: ReachBatch) -> ReachObservationWorkspace:
    people, state = batch.world.people, batch.state.people
    return new_observation_workspace(batch.arm, people, state, new_motion_predictor())


def watched(batch: ReachBatch, cycles: int) -> tuple[Vec, Vec]:
    """Predict in every control period; return predictions and pedestrians.

    Returns:
        Places, shape (cycles, n_envs, N_MOMENTS, 3), and rows, (cycles, n_envs, N_STATE).
    """
    work, motion = workspace(batch), new_predicted_motion()
    predicted, rows = [], []
    for _ in range(cycles):
        now = np.empty((N_ENVS, N_MOMENTS, 3))
        for e in range(N_ENVS):
            predict_people(batch.world, batch.state, e, N_MOMENTS, work, motion)
            assert motion.n[0] == 1
            now[e] = motion.places[:N_MOMENTS, 0]
        predicted.append(now)
        rows.append(batch.state.people.walkers.rows[:, :1].copy())
        batch.state.outcome[:] = 0  # people walk on after the end of an episode
        batch.step(HELD, auto_reset=False)
    return np.array(predicted), np.array(rows).reshape(cycles, -1, N_STATE)


def test_empty_cell_is_predicted_as_the_absent_person() -> None:
    batch = batch_of(4, people=())
    predicted, _ = watched(batch, 2)
    assert (predicted == (NO_PERSON[0], NO_PERSON[1], NO_PERSON[4])).all()


def test_person_at_rest_is_predicted_to_stay_at_rest() -> None:
    batch = batch_of(6)
    predicted, rows = watched(batch, 60)
    still = (rows[..., [VX, VY]] == 0.0).all(axis=2)
    assert still.sum() > 100
    places = predicted[still][..., :2]
    np.testing.assert_array_equal(places, np.broadcast_to(places[:, :1], places.shape))


def test_predicted_radii_stay_within_their_limits() -> None:
    batch = batch_of(7)
    rule = batch.world.people.walkers.rows[0]
    predicted, _ = watched(batch, 5)
    assert predicted[..., 2].min() >= rule[R_MIN] and predicted[..., 2].max() <= rule[R_MAX]


@pytest.mark.parametrize("times", [0.5, 1.1])
def test_radius_outside_its_limits_is_predicted_to_stay(times: float) -> None:
    batch = batch_of(7)
    rule, rows = batch.world.people.walkers.rows[0], batch.state.people.walkers.rows
    rows[:, 0, R] = r = times * rule[R_MIN if times < 1.0 else R_MAX]
    work, motion = workspace(batch), new_predicted_motion()
    for e in range(N_ENVS):
        remember_as_now(rows, e, 0)
        predict_people(batch.world, batch.state, e, N_MOMENTS, work, motion)
        np.testing.assert_array_equal(motion.places[:N_MOMENTS, 0, 2], r)


def test_people_are_predicted_to_stay_in_the_walking_area() -> None:
    batch = batch_of(5)
    predicted, rows = watched(batch, 40)
    rule = batch.world.people.walkers.rows[0]
    low, high = rule[[X_MIN, Y_MIN]], rule[[X_MAX, Y_MAX]]
    assert ((predicted[..., :2] >= low - 1e-9) & (predicted[..., :2] <= high + 1e-9)).all()
    speed = rows[..., [VX, VY]] * STEP_S * N_MOMENTS
    assert (rows[..., [X, Y]] + speed > high).any(), "at constant velocity some would leave it"
