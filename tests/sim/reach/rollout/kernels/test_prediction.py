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
from app.sim.reach.kernels.episode import new_work
from app.sim.reach.kernels.observation import NOBODY
from app.sim.reach.rollout.kernels.prediction import MOMENTS, foretell, new_foretold
from app.sim.scene.scene import HumanKind

N_ENVS = 200
HELD = np.zeros((N_ENVS, 6), dtype=np.float32)


def batch_of(seed: int, people: tuple[HumanKind, ...] = ("walker",)) -> ReachBatch:
    settings = ReachSettings(people=people, observation="forecast", time_limit_s=60.0)
    batch = ReachBatch(load_cell("shared-workspace"), N_ENVS, seed, settings)
    batch.reset()
    return batch


def watched(batch: ReachBatch, periods: int) -> tuple[Vec, Vec]:
    """Foretell at every period, as a policy does; return what was told of all, and the rows.

    Returns:
        Places, shape (periods, n_envs, MOMENTS, 3), and walkers, (periods, n_envs, N_STATE).
    """
    work, foretold = new_work(batch.world, batch.state, new_motion_predictor()), new_foretold()
    told, rows = [], []
    for _ in range(periods):
        now = np.empty((N_ENVS, MOMENTS, 3))
        for e in range(N_ENVS):
            assert foretell(batch.world, batch.state, e, MOMENTS, work, foretold) == 1
            now[e] = foretold.places[:MOMENTS, 0]
        told.append(now)
        rows.append(batch.state.people.walkers.rows[:, :1].copy())
        batch.state.outcome[:] = 0  # people go on, whatever becomes of the robot
        batch.step(HELD, auto_reset=False)
    return np.array(told), np.array(rows).reshape(periods, -1, N_STATE)


def test_nobody_stands_where_policies_see_nobody() -> None:
    batch = batch_of(4, people=())
    told, _ = watched(batch, 2)
    assert (told == (NOBODY[0], NOBODY[1], NOBODY[4])).all()


def test_person_at_rest_is_predicted_to_stay_at_rest() -> None:
    batch = batch_of(6)
    told, rows = watched(batch, 60)
    still = (rows[..., [VX, VY]] == 0.0).all(axis=2)
    assert still.sum() > 100
    places = told[still][..., :2]
    np.testing.assert_array_equal(places, np.broadcast_to(places[:, :1], places.shape))


def test_no_radius_is_foretold_beyond_its_limits() -> None:
    batch = batch_of(7)
    rule = batch.world.people.walkers.rows[0]
    told, _ = watched(batch, 5)
    assert told[..., 2].min() >= rule[R_MIN] and told[..., 2].max() <= rule[R_MAX]


@pytest.mark.parametrize("times", [0.5, 1.1])
def test_who_is_smaller_or_larger_than_walkers_are_is_foretold_to_stay_so(times: float) -> None:
    batch = batch_of(7)
    rule, rows = batch.world.people.walkers.rows[0], batch.state.people.walkers.rows
    rows[:, 0, R] = r = times * rule[R_MIN if times < 1.0 else R_MAX]
    work, foretold = new_work(batch.world, batch.state, new_motion_predictor()), new_foretold()
    for e in range(N_ENVS):
        remember_as_now(rows, e, 0)
        foretell(batch.world, batch.state, e, MOMENTS, work, foretold)
        np.testing.assert_array_equal(foretold.places[:MOMENTS, 0, 2], r)


def test_nobody_is_foretold_to_leave_the_walking_area() -> None:
    batch = batch_of(5)
    told, rows = watched(batch, 40)
    rule = batch.world.people.walkers.rows[0]
    low, high = rule[[X_MIN, Y_MIN]], rule[[X_MAX, Y_MAX]]
    assert ((told[..., :2] >= low - 1e-9) & (told[..., :2] <= high + 1e-9)).all()
    speed = rows[..., [VX, VY]] * STEP_S * MOMENTS
    assert (rows[..., [X, Y]] + speed > high).any(), "going on as now some would leave it"
