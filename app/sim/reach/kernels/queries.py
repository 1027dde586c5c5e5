"""Observations of the reach scenario, for the goals of the episodes or others (compiled).

Policies that interpolate between training targets are queried for several goals of one state,
and beside several people once per person. Poses and people are evaluated once per state.
"""

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.geometry.capsules import capsule_clearances
from app.sim.people.kernels.people import (
    nearest_person,
    people_clearance,
    person_clearance,
    place_people,
)
from app.sim.reach.kernels.episode import ReachCell
from app.sim.reach.kernels.observation import (
    ALL_PEOPLE,
    N_FEATURES,
    extrapolate_clearances,
    write_features,
    write_person,
    write_raw_state,
)
from app.sim.reach.kernels.observation_workspace import ReachObservationWorkspace, ReachQuery
from app.sim.reach.kernels.option_features import (
    N_OPTION_FEATURES,
    predict_motion,
    predict_option_clearances,
    write_option_features,
)
from app.sim.reach.kernels.people_set import write_people_set
from app.sim.robot.kernels.arm import place_robot
from app.sim.scenario.kernels.episode import FORECAST, PEOPLE_SET, PLAIN, EpisodeState, Indices
from app.sim.scenario.kernels.person_observation import Obs


@kernel(inline="always")
def place(
    world: ReachCell, state: EpisodeState, e: int, work: ReachObservationWorkspace
) -> None:
    """Place robot and people of environment ``e``, and fill the distances of workers."""
    place_robot(world.arm, state.q[e], work.robot)
    place_people(world.people, state.people, e, work.geometry)
    if state.people.q.shape[1] > 0:
        capsule_clearances(work.robot.capsules, work.geometry.capsules, work.geometry.clearance)


@kernel(inline="always")
def _observe_people(
    world: ReachCell,
    state: EpisodeState,
    e: int,
    work: ReachObservationWorkspace,
    view: int,
    which: int,
) -> float:
    """Fill the people of environment ``e`` in ``work``; return their clearance [m]."""
    place(world, state, e, work)
    robot, geometry = work.robot, work.geometry
    observed, clearance = which, state.clear[e, 0]
    if which == ALL_PEOPLE:
        observed = nearest_person(world.people, robot.capsules, geometry)
    elif geometry.q.shape[0] + geometry.cylinders.shape[0] > 1:
        clearance = person_clearance(world.people, robot.capsules, geometry, which)
    write_person(state.people, e, observed, geometry, work.observed)
    if view != PLAIN:
        extrapolate_clearances(world.people, state.people, e, which, work)
    if view >= FORECAST:
        predict_motion(state.people, e, which, observed, work)
        top = world.people.top_z
        predict_option_clearances(world.arm, top, state.q[e], state.qd[e], work)
    return float(clearance)


@kernel(nogil=True)
def observe_envs(
    world: ReachCell,
    state: EpisodeState,
    envs: Indices,
    work: ReachObservationWorkspace,
    view: int,
    which: int,
    goals: Vec,
    out: Obs,
) -> None:
    """Write the observations of some environments, each for several goals.

    Args:
        envs: Numbers of the environments, shape (k,).
        view: PLAIN (4.30), FEATURES, FORECAST or PEOPLE_SET.
        which: ALL_PEOPLE (the nearest is observed and all count), or the number of the one
            person that is present.
        goals: Goals of the tcp [m], shape (k, n, 3).
        out: Filled, shape (k, n, F).
    """
    arm, top = world.arm, world.people.top_z
    for k in range(envs.shape[0]):
        e = envs[k]
        clearance = _observe_people(world, state, e, work, view, which)
        for i in range(goals.shape[1]):
            query, row = ReachQuery(state.q[e], state.qd[e], goals[k, i]), out[k, i]
            if view == PLAIN:
                write_raw_state(query, work.observed, row)
                continue
            write_features(arm, top, query, clearance, state.time_left[e], work, row)
            if view >= FORECAST:
                write_option_features(arm, top, query, work, N_FEATURES, row)
            if view == PEOPLE_SET:
                start = N_FEATURES + N_OPTION_FEATURES
                write_people_set(top, goals[k, i], work, start, row)


@kernel(nogil=True)
def measure_envs(
    world: ReachCell, state: EpisodeState, envs: Indices, work: ReachObservationWorkspace
) -> None:
    """Store the clearance of robot and people in some environments, shape (k,)."""
    for e in envs:
        place(world, state, e, work)
        state.clear[e, 0] = people_clearance(world.people, work.robot.capsules, work.geometry)


@kernel(nogil=True)
def distances_of_envs(
    world: ReachCell,
    state: EpisodeState,
    envs: Indices,
    work: ReachObservationWorkspace,
    out: Vec,
) -> None:
    """Write the distance of the robot to each person in some environments.

    Args:
        envs: Numbers of the environments, shape (k,).
        out: Filled [m], workers first, then pedestrians, shape (k, n_people).
    """
    for k in range(envs.shape[0]):
        place(world, state, envs[k], work)
        for p in range(out.shape[1]):
            out[k, p] = person_clearance(world.people, work.robot.capsules, work.geometry, p)
