"""Option features, compared with distances computed one by one."""

import numpy as np
import pytest

from app.sim.collision import contact
from app.sim.people.kernels.pedestrian import (
    AGE,
    COURSE_X,
    COURSE_Y,
    GROWTH,
    PAST_RADIUS,
    PAST_SPEED,
    VX,
    VY,
    R,
    X,
    Y,
)
from app.sim.prediction.kernels.networks import N_TIMES, STEP_S, predict_pedestrian
from app.sim.prediction.weights import new_motion_predictor
from app.sim.reach.batch import ReachBatch
from app.sim.reach.kernels import observation_workspace, option_features
from app.sim.reach.kernels.observation import N_FEATURES
from tests.sim.reach.kernels.test_observation import batch_of, observed

LAYOUT = option_features.LAYOUT
LOOKS = np.array(observation_workspace.LOOKS)
RETREAT_PAN = observation_workspace.RETREAT_PAN
TIMES = STEP_S * LOOKS
"""Times of the clearances [s]."""


def features(batch: ReachBatch) -> np.ndarray:
    return observed(batch)[:, N_FEATURES:].astype(np.float64)


def ahead(batch: ReachBatch, e: int) -> np.ndarray:
    """Where the walkers of a cell will be, (len(LOOKS), W, 3), by the shipped forecasts."""
    found = []
    for row in batch.state.people.walkers.rows[e]:
        out = np.zeros((N_TIMES, 2))
        speed = np.hypot(row[VX], row[VY])
        past = row[PAST_RADIUS:PAST_SPEED].copy(), row[PAST_SPEED:].copy()
        predict_pedestrian(
            new_motion_predictor(), row[R], row[GROWTH], speed, row[AGE], *past, out
        )
        course = row[[COURSE_X, COURSE_Y]] * (speed > 0.0)
        found.append(np.c_[row[[X, Y]] + out[:, 1:] * course, out[:, 0]])
    return np.array(found).swapaxes(0, 1)[LOOKS - 1]


def clearance(batch: ReachBatch, q: np.ndarray, walkers: np.ndarray) -> float:
    found = contact.clearance(batch.arm, batch.world.people, q, np.zeros((0, 18)), walkers)
    return max(-1.0, min(2.0, found.people_m / option_features.NEAR))


def rolled(batch: ReachBatch, e: int, t: float) -> np.ndarray:
    state = batch.state
    return state.q[e] + 0.5 * state.qd[e] * min(t, option_features.ROLL_S)


@pytest.mark.parametrize("people", [("walker",), ("constant", "fixed-speed", "walker")])
def test_clearances_of_staying_and_drawing_back(people: tuple[str, ...]) -> None:
    batch = batch_of(*people, observation="forecast")
    found = features(batch)[:, LAYOUT["aside_clearance"]].reshape(-1, 4, len(LOOKS) + 1)
    home = batch.arm.home
    for e in range(batch.n_envs):
        walkers, q = ahead(batch, e), batch.state.q[e]
        for i, t in enumerate(TIMES):
            stay = rolled(batch, e, t)
            assert found[e, 0, i] == pytest.approx(clearance(batch, stay, walkers[i]), abs=1e-5)
            for option, turn in ((1, 0.0), (2, RETREAT_PAN), (3, -RETREAT_PAN)):
                refuge = home + [turn, 0, 0, 0, 0, 0]
                longest = np.abs(refuge - q).max()
                share = min(1.0, max(0.0, t - option_features.LAG_S) / longest)
                expected = clearance(batch, stay + share * (refuge - q), walkers[i])
                assert found[e, option, i] == pytest.approx(expected, abs=1e-5)
    np.testing.assert_allclose(found[:, :, -1], found[:, :, :-1].min(axis=2), atol=1e-6)


def test_base_motion_ends_at_the_goal() -> None:
    batch = batch_of("walker", observation="forecast")
    found = features(batch)
    arrival = found[:, 0]
    assert (arrival > 0.3).all()
    straight = found[:, LAYOUT["base_clearance"]]
    for e in range(batch.n_envs):
        counted = [i for i, t in enumerate(TIMES) if t <= arrival[e] + option_features.AFTER_S]
        assert straight[e, -1] == pytest.approx(straight[e, counted].min(), abs=1e-6)


def test_the_person_seen_is_followed_to_the_goal() -> None:
    batch = batch_of("walker", observation="forecast")
    found = features(batch)
    for e in range(batch.n_envs):
        walkers = ahead(batch, e)[:, 0]
        away = np.linalg.norm(walkers[:, :2] - batch.state.goal[e, :2], axis=1)
        gap = np.minimum(3.0, (away - walkers[:, 2]) / option_features.SCALE)
        np.testing.assert_allclose(found[e, LAYOUT["goal_gap_ahead"]], gap, atol=1e-5)
        wider = (
            walkers[:, 2] - batch.state.people.walkers.rows[e, 0, R]
        ) / option_features.GROWN
        np.testing.assert_allclose(found[e, LAYOUT["radius_ahead"]], wider, atol=1e-5)


@pytest.mark.parametrize("people", [("walker", "walker"), ("worker", "walker", "constant")])
def test_the_nearest_person_counts_for_each_option(people: tuple[str, ...]) -> None:
    batch = batch_of(*people, observation="forecast")
    observed(batch)
    rows, goals = np.arange(batch.n_envs), batch.state.goal[:, None]
    groups = [LAYOUT["base_clearance"], LAYOUT["aside_clearance"]]
    all_of = batch.observe_goals(rows, goals)[:, 0, N_FEATURES:]
    alone = [
        batch.observe_goals(rows, goals, who)[:, 0, N_FEATURES:] for who in range(len(people))
    ]
    for group in groups:
        least = np.min([one[:, group] for one in alone], axis=0)
        np.testing.assert_allclose(all_of[:, group], least, atol=1e-6)


def test_clearances_in_an_empty_cell() -> None:
    found = features(batch_of(observation="forecast"))
    assert (found[:, LAYOUT["base_clearance"]] == 2.0).all()
    assert (found[:, LAYOUT["radius_ahead"]] == 0.0).all()
