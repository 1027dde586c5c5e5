"""Prediction of people for the rollout: position and radius of each person per step (compiled).

Workers are predicted to move at constant velocity, walkers as the networks of ``forecast.py``
say: those see the last 1.5 s of radius and speed. A person at rest stays at rest. Changes of
direction are not predicted, except that a walker stops at the edge of its walking area.
"""

from typing import NamedTuple

import numpy as np

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.people.kernels.pedestrian import R_MAX, R_MIN, X_MAX, X_MIN, Y_MAX, Y_MIN
from app.sim.people.kernels.people import MAX_PEOPLE, place_people
from app.sim.prediction.kernels.networks import N_TIMES, STEP_S
from app.sim.reach.kernels.episode import ReachState, ReachWorld, Work
from app.sim.reach.kernels.observation import EVERYBODY, N_SEEN, show_person
from app.sim.reach.kernels.option_features import foresee

N_PLAYED = 32
"""Steps of the forecast that are played."""
LONG_PLAYED = 150
"""Steps that are played where somebody may have to pass first."""
MOMENTS, LONG_MOMENTS = N_PLAYED + N_TIMES + 1, LONG_PLAYED + N_TIMES + 1
"""Moments at which it is known where people will be: now, and from each step played as far as
the features of ``reach_ways.py`` look."""


class Foretold(NamedTuple):
    """Everybody at every moment, and work space."""

    places: Vec
    """x, y and radius of everybody, now and at each step [m], (LONG_MOMENTS, MAX_PEOPLE, 3).
    """
    person: Vec
    """One person: x, y [m], vx, vy [m/s], r [m], growth [m/s], shape (6,)."""


def new_foretold() -> Foretold:
    """Return zeroed work space."""
    return Foretold(
        places=np.zeros((LONG_MOMENTS, MAX_PEOPLE, 3)),
        person=np.zeros(N_SEEN),
    )


@kernel()
def foretell(
    world: ReachWorld, state: ReachState, e: int, moments: int, work: Work, foretold: Foretold
) -> int:
    """Fill ``foretold.places`` with the people of environment ``e``; return how many they are.

    Where nobody is there it is one, NOBODY, whom the policy sees too.

    Args:
        world: Shared data.
        state: Rows.
        e: Environment.
        moments: How many are filled: MOMENTS or LONG_MOMENTS.
        work: Work space.
        foretold: Filled.
    """
    place_people(world.people, state.people, e, work.crowd)
    foresee(state.people, e, EVERYBODY, -1, work.crowd, work.ways)
    places, person, ahead = foretold.places, foretold.person, work.ways.ahead
    n, n_workers = int(work.ways.number[0]), state.people.q.shape[1]
    anybody = n_workers + state.people.walkers.rows.shape[1] > 0
    for p in range(n):
        who = p if anybody else -1
        show_person(state.people, e, who, work.crowd, person)
        places[0, p, 0], places[0, p, 1], places[0, p, 2] = person[0], person[1], person[4]
        for i in range(N_TIMES):
            for m in range(3):
                places[i + 1, p, m] = ahead[i, p, m]
        for i in range(N_TIMES + 1, moments):
            for m in range(2):
                places[i, p, m] = 2.0 * places[i - 1, p, m] - places[i - 2, p, m]
            places[i, p, 2] = places[i - 1, p, 2]
        if who >= n_workers:
            rule = world.people.walkers.rows[p - n_workers]
            _limit_radius(rule, p, places, moments)
            _stay_inside(rule, p, places, moments)
    return n


@kernel()
def _limit_radius(rule: Vec, p: int, places: Vec, moments: int) -> None:
    """Clip a walker's predicted radius to the range of its kind.

    A radius outside this range already (a measured person) is predicted to stay as it is.
    """
    r, low, high = places[0, p, 2], rule[R_MIN], rule[R_MAX]
    beyond = r < low or r > high
    for i in range(1, moments):
        places[i, p, 2] = r if beyond else min(high, max(low, places[i, p, 2]))


@kernel()
def _inside(rule: Vec, place: Vec) -> bool:
    """Tell whether a place, x and y, is in a walking area."""
    return bool(
        rule[X_MIN] <= place[0] <= rule[X_MAX] and rule[Y_MIN] <= place[1] <= rule[Y_MAX]
    )


@kernel()
def _stay_inside(rule: Vec, p: int, places: Vec, moments: int) -> None:
    """Let a walker that is in its area stand where its way would leave it."""
    if not _inside(rule, places[0, p]):
        return
    for i in range(1, moments):
        if not _inside(rule, places[i, p]):
            places[i, p, 0], places[i, p, 1] = places[i - 1, p, 0], places[i - 1, p, 1]
