"""Where people will be at every step of a second and a half, as well as can be told, compiled.

A worker goes on at constant velocity, a walker as the networks of ``forecast.py`` say; where
the functions behind a walker's radius and speed can be found (``harmonic.py``), as they say.
Who stands still stays; but a walker whose function says that the speed is too low to walk with
for now goes on the way he came. Where people turn nobody knows, only that they do before they
leave the walking area: on its edge they are taken to stand.
"""

import math
from typing import NamedTuple

import numpy as np

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.people.kernels.pedestrian import (
    AGE,
    F_RADIUS_MAX,
    F_SPEED_MAX,
    N_PAST,
    PAST_RADIUS,
    PAST_SPEED,
    R_MAX,
    R_MIN,
    V_MAX,
    V_MIN,
    X_MAX,
    X_MIN,
    Y_MAX,
    Y_MIN,
)
from app.sim.people.kernels.people import MAX_PEOPLE, place_people
from app.sim.prediction.kernels.networks import N_TIMES, STEP_S
from app.sim.prediction.kernels.sinusoid_fit import (
    N_CONSTANTS,
    Fit,
    Limits,
    find_function,
    new_fit,
    value_at,
)
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
    fit: Fit
    """Finds the functions behind what is remembered of walkers."""
    found: Vec
    """Those found last, of radius and speed, (n_envs, MAX_PEOPLE, 2, N_CONSTANTS)."""
    since: Vec
    """Time since then [s], shape (n_envs,)."""
    course: Vec
    """Directions in which walkers went last, or zeros, (n_envs, MAX_PEOPLE, 2)."""


def new_foretold(n_envs: int) -> Foretold:
    """Return work space for so many environments."""
    return Foretold(
        places=np.zeros((LONG_MOMENTS, MAX_PEOPLE, 3)),
        person=np.zeros(N_SEEN),
        fit=new_fit(),
        found=np.zeros((n_envs, MAX_PEOPLE, 2, N_CONSTANTS)),
        since=np.zeros(n_envs),
        course=np.zeros((n_envs, MAX_PEOPLE, 2)),
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
    since = foretold.since[e]
    foretold.since[e] = 0.0
    if state.elapsed[e] == 0.0:
        foretold.course[e] = 0.0
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
            row = state.people.walkers.rows[e, p - n_workers]
            rule = world.people.walkers.rows[p - n_workers]
            found = foretold.found[e, p, 0]
            _tell_radius(row, rule, since, p, moments, found, foretold)
            _tell_way(row, rule, since, world.arm.dt, e, p, moments, foretold)
            _stay_inside(rule, p, places, moments)
    return n


@kernel()
def _tell_radius(
    row: Vec, rule: Vec, since: float, p: int, moments: int, found: Vec, foretold: Foretold
) -> None:
    """Put the function behind a walker's radius in place of its forecast, if it is found.

    Neither leads beyond the walker's limits. Who is beyond them already stays as he is: neither
    was made for him.
    """
    limits = Limits(rule[R_MIN], rule[R_MAX], rule[F_RADIUS_MAX])
    past = row[PAST_RADIUS : PAST_RADIUS + N_PAST]
    r, places = foretold.person[4], foretold.places
    known = find_function(foretold.fit, r, row[AGE], past, limits, False, since, found)
    middle, beyond = 0.5 * (limits.low + limits.high), r < limits.low or r > limits.high
    for i in range(1, moments):
        value = value_at(found, middle, STEP_S * i) if known else places[i, p, 2]
        places[i, p, 2] = r if beyond else min(limits.high, max(limits.low, value))


@kernel()
def _stand(p: int, places: Vec, moments: int) -> None:
    """Foretell a walker where he is now."""
    for i in range(1, moments):
        places[i, p, 0], places[i, p, 1] = places[0, p, 0], places[0, p, 1]


@kernel()
def _tell_way(
    row: Vec,
    rule: Vec,
    since: float,
    dt: float,
    e: int,
    p: int,
    moments: int,
    foretold: Foretold,
) -> None:
    """Put the function behind a walker's speed in place of its forecast, if it is found.

    Who stands goes on standing if that function says he should walk, or if he has stood for as
    long as is remembered.
    """
    limits = Limits(rule[V_MIN], rule[V_MAX], rule[F_SPEED_MAX])
    past = row[PAST_SPEED : PAST_SPEED + N_PAST]
    person, places, course = foretold.person, foretold.places, foretold.course[e, p]
    found, middle = foretold.found[e, p, 1], 0.5 * (limits.low + limits.high)
    speed = math.hypot(person[2], person[3])
    if speed > 0.0:
        course[0], course[1] = person[2] / speed, person[3] / speed
    if speed == 0.0 and not past.any():
        _stand(p, places, moments)
        return
    if course[0] == 0.0 and course[1] == 0.0:
        return
    if not find_function(foretold.fit, speed, row[AGE], past, limits, True, since, found):
        return
    if speed == 0.0 and value_at(found, middle, 0.0) >= limits.low:
        _stand(p, places, moments)  # It is not for its function that this one stands.
        return
    x, y, t = person[0], person[1], 0.0
    for i in range(1, moments):
        while t < STEP_S * i - 0.5 * dt:
            v = value_at(found, middle, t)
            v = 0.0 if v < limits.low else min(limits.high, v)
            x += dt * v * course[0]
            y += dt * v * course[1]
            t += dt
        places[i, p, 0], places[i, p, 1] = x, y


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
