"""Prediction of people for the rollout: position and radius of each person per step (compiled).

Workers are predicted to move at constant velocity, pedestrians as the motion predictor
(``app/sim/prediction``) says. A person at rest stays at rest. Changes of direction are not
predicted, except that a pedestrian stops at the edge of its walking area.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.people.kernels.pedestrian import R_MAX, R_MIN, X_MAX, X_MIN, Y_MAX, Y_MIN
from app.sim.people.kernels.people import MAX_PEOPLE, place_people
from app.sim.prediction.kernels.networks import N_TIMES
from app.sim.reach.kernels.episode import ReachCell
from app.sim.reach.kernels.observation import ALL_PEOPLE
from app.sim.reach.kernels.observation_workspace import ReachObservationWorkspace
from app.sim.reach.kernels.option_features import predict_motion
from app.sim.scenario.kernels.episode import EpisodeState

HORIZON_STEPS = 32
"""Steps of a rollout."""
LONG_HORIZON_STEPS = 150
"""Steps of a rollout in which a person may have to pass first."""
N_MOMENTS, N_LONG_MOMENTS = HORIZON_STEPS + N_TIMES + 1, LONG_HORIZON_STEPS + N_TIMES + 1
"""Moments at which people are predicted: now, and as far ahead of the last step as the option
features look."""


class PredictedMotion(NamedTuple):
    """Predicted motion of the people of one environment."""

    places: Vec
    """x, y and radius of each person, now and at each step [m], shape (N_LONG_MOMENTS,
    MAX_PEOPLE, 3)."""
    n: NDArray[np.int64]
    """Number of people, shape (1,)."""


def new_predicted_motion() -> PredictedMotion:
    """Return arrays for one environment."""
    places = np.zeros((N_LONG_MOMENTS, MAX_PEOPLE, 3))
    return PredictedMotion(places, np.zeros(1, dtype=np.int64))


@kernel()
def predict_people(
    world: ReachCell,
    state: EpisodeState,
    e: int,
    moments: int,
    work: ReachObservationWorkspace,
    out: PredictedMotion,
) -> None:
    """Predict the people of environment ``e``; in an empty cell this is NO_PERSON.

    Args:
        e: Environment.
        moments: Number of moments: N_MOMENTS or N_LONG_MOMENTS.
        out: Filled.
    """
    place_people(world.people, state.people, e, work.geometry)
    predict_motion(state.people, e, ALL_PEOPLE, -1, work)
    places, n, n_workers = out.places, int(work.n[0]), state.people.q.shape[1]
    n_pedestrians = state.people.walkers.rows.shape[1]
    out.n[0] = n
    for p in range(n):
        person = work.people[p]
        places[0, p, 0], places[0, p, 1], places[0, p, 2] = person[0], person[1], person[4]
        for i in range(N_TIMES):
            for m in range(3):
                places[i + 1, p, m] = work.predicted[i, p, m]
        for i in range(N_TIMES + 1, moments):
            for m in range(2):
                places[i, p, m] = 2.0 * places[i - 1, p, m] - places[i - 2, p, m]
            places[i, p, 2] = places[i - 1, p, 2]
        if n_workers <= p < n_workers + n_pedestrians:
            rule = world.people.walkers.rows[p - n_workers]
            _limit_radius(rule, p, places, moments)
            _stop_at_edge(rule, p, places, moments)


@kernel()
def _limit_radius(rule: Vec, p: int, places: Vec, moments: int) -> None:
    """Clip a pedestrian's predicted radius to the range of its kind.

    A radius outside this range already (a measured person) is predicted to stay as it is.
    """
    r, low, high = places[0, p, 2], rule[R_MIN], rule[R_MAX]
    beyond = r < low or r > high
    for i in range(1, moments):
        places[i, p, 2] = r if beyond else min(high, max(low, places[i, p, 2]))


@kernel()
def _inside(rule: Vec, place: Vec) -> bool:
    """Return whether a position (x, y) is in a walking area."""
    return bool(
        rule[X_MIN] <= place[0] <= rule[X_MAX] and rule[Y_MIN] <= place[1] <= rule[Y_MAX]
    )


@kernel()
def _stop_at_edge(rule: Vec, p: int, places: Vec, moments: int) -> None:
    """Stop a pedestrian at the edge of its walking area, unless it is outside already."""
    if not _inside(rule, places[0, p]):
        return
    for i in range(1, moments):
        if not _inside(rule, places[i, p]):
            places[i, p, 0], places[i, p, 1] = places[i - 1, p, 0], places[i - 1, p, 1]
