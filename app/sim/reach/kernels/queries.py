"""What policies see of the reach scenario, for its goals or others, compiled.

Several people are seen as they are, or one of them alone. A policy between training targets is
asked for several goals of one state, and beside several people once for each of them. What the
goal does not change, the poses and what is seen of the people, is worked out once per state.
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
from app.sim.reach.kernels.episode import Indices, ReachState, ReachWorld, Work
from app.sim.reach.kernels.observation import (
    EVERYBODY,
    N_FEATURES,
    Obs,
    clearances_ahead,
    describe,
    put_state,
    show_person,
)
from app.sim.reach.kernels.option_features import (
    N_OPTION_FEATURES,
    foresee,
    look_aside,
    put_ways,
)
from app.sim.reach.kernels.people_set import put_crowd
from app.sim.robot.kernels.arm import place_robot
from app.sim.scenario.kernels.episode import CROWD, FORECAST, PLAIN


@kernel(inline="always")
def _place(world: ReachWorld, state: ReachState, e: int, work: Work) -> None:
    """Place robot and people of environment ``e``, and fill the workers' distances."""
    place_robot(world.arm, state.q[e], work.robot)
    place_people(world.people, state.people, e, work.crowd)
    if state.people.q.shape[1] > 0:
        capsule_clearances(work.robot.columns, work.crowd.columns, work.crowd.gap)


@kernel(inline="always")
def _look(
    world: ReachWorld, state: ReachState, e: int, work: Work, view: int, who: int
) -> float:
    """Fill what is seen of the people of environment ``e``; return their distance [m]."""
    _place(world, state, e, work)
    robot, crowd, sight = work.robot, work.crowd, work.sight
    seen, clearance = who, state.clear[e, 0]
    if who == EVERYBODY:
        seen = nearest_person(world.people, robot.columns, crowd)
    elif crowd.q.shape[0] + crowd.cylinders.shape[0] > 1:
        clearance = person_clearance(world.people, robot.columns, crowd, who)
    show_person(state.people, e, seen, crowd, sight.seen)
    if view != PLAIN:
        clearances_ahead(world.people, state.people, e, who, robot.columns, sight)
    if view >= FORECAST:
        foresee(state.people, e, who, seen, crowd, work.ways)
        look_aside(world.arm, world.people.top_z, state.q[e], state.qd[e], work.ways)
    return float(clearance)


@kernel(inline="always")
def _write(
    world: ReachWorld,
    state: ReachState,
    e: int,
    work: Work,
    view: int,
    clearance: float,
    goal: Vec,
    out: Obs,
) -> None:
    """Write what was looked at as the observation for one goal [m], shape (3,)."""
    q, qd, sight = state.q[e], state.qd[e], work.sight
    if view == PLAIN:
        put_state(q, qd, sight.seen, goal, out)
        return
    time_left = state.time_left[e]
    top = world.people.top_z
    describe(world.arm, top, q, qd, goal, clearance, time_left, work.robot, sight, out)
    if view >= FORECAST:
        put_ways(
            world.arm, top, q, qd, sight.seen, goal, work.robot, sight.prospect, work.ways,
            N_FEATURES, out,
        )  # fmt: skip
    if view == CROWD:
        put_crowd(top, goal, work.robot, work.ways, N_FEATURES + N_OPTION_FEATURES, out)


@kernel(nogil=True)
def observe_rows(
    world: ReachWorld,
    state: ReachState,
    rows: Indices,
    work: Work,
    view: int,
    who: int,
    goals: Vec,
    out: Obs,
) -> None:
    """Write the observations of some environments, each for its own goals.

    Args:
        world: Shared data.
        state: Rows.
        rows: Which environments, shape (k,).
        work: Work space.
        view: PLAIN (4.30), FEATURES, FORECAST or CROWD.
        who: EVERYBODY as ordinarily, the nearest seen and all counted; or the one person who
            is there alone.
        goals: Where each tcp shall be [m], shape (k, n, 3).
        out: Filled, shape (k, n, F).
    """
    for k in range(rows.shape[0]):
        e = rows[k]
        clearance = _look(world, state, e, work, view, who)
        for i in range(goals.shape[1]):
            _write(world, state, e, work, view, clearance, goals[k, i], out[k, i])


@kernel(nogil=True)
def measure_rows(world: ReachWorld, state: ReachState, rows: Indices, work: Work) -> None:
    """Measure the distance of robot and people in some environments, shape (k,), anew."""
    for e in rows:
        _place(world, state, e, work)
        state.clear[e, 0] = people_clearance(world.people, work.robot.columns, work.crowd)


@kernel(nogil=True)
def distances_of_rows(
    world: ReachWorld, state: ReachState, rows: Indices, work: Work, out: Vec
) -> None:
    """Write the distances of robot and people of some environments.

    Args:
        world: Shared data.
        state: Rows.
        rows: Which environments, shape (k,).
        work: Work space.
        out: Filled [m], workers first, then walkers, shape (k, n_people).
    """
    for k in range(rows.shape[0]):
        _place(world, state, rows[k], work)
        for who in range(out.shape[1]):
            out[k, who] = person_clearance(world.people, work.robot.columns, work.crowd, who)
