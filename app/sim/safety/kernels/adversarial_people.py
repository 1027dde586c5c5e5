"""People who try to be hit, and never break the rules they are held to, compiled.

In one period every end of a worker's capsules goes straight from where it was to where it will
be, never farther than ``v dt``; so no point of the person is faster than ``v``, whatever the
posture. A worker who would be faster is slowed down: less of the script passes, and what is
still too far is cut. A walker's axis and radius together change by at most ``v dt`` per period,
so no point of the cylinder is faster either.

*Script*: the work cycle, or the walk of METHOD 2.1. *Straight*: after a while, from wherever it
is, at ``v`` straight at the nearest link. *Zig-zag*: the same, swerving to either side at
random. *Tease*: now at the nearest link, now away from it, for random times. A worker who runs
keeps the posture and flies: no human could, which only makes it harder.
"""

import math
from typing import NamedTuple

import numpy as np

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.core.kernels import rng as random
from app.sim.geometry.capsules import (
    INVERSE,
    RADIUS,
    UU,
    UX,
    UY,
    UZ,
    X,
    Y,
    copy_rows,
    distances,
    greatest_displacement,
    least,
)
from app.sim.geometry.segments import segment_nearest
from app.sim.human.kernels import kinematics as body
from app.sim.people.kernels.pedestrian import R, advance_walker
from app.sim.people.kernels.people import Crowd, People, PeopleState, place_workers, worker_at
from app.sim.robot.kernels.arm import CONTROLLED, Arm
from app.sim.safety.kernels.separation_check import NOW, Watch

SCRIPT, STRAIGHT, ZIGZAG, TEASE = range(4)
"""What people do."""
BELOW = 1.0 - 1e-12
"""Share of the allowed way that is gone at most, for rounding."""


class Trial(NamedTuple):
    """How episodes go."""

    human_speed: float
    """Greatest true speed of any point of the people [m/s]."""
    n_late: int
    """Periods by which the people are seen late."""
    n_steps: int
    """Longest episode, in periods."""
    guarded: bool
    """Whether the safety layer acts; without it, pieces are executed as commanded."""


class TrialWorkspace(NamedTuple):
    """State and work space of one episode after the other."""

    state: PeopleState
    """Scripts and walks, one row."""
    crowd: Crowd
    """A pose of the people."""
    columns0: Vec
    """The people's capsules at the start of a period, shape (9, m)."""
    columns1: Vec
    """At its end."""
    cylinders0: Vec
    """Cylinders at the start of a period, x, y, radius, top [m], shape (n, 4)."""
    cylinders1: Vec
    """At its end."""
    columns: Vec
    """Between them."""
    cylinders: Vec
    """Between them."""
    seen_columns: Vec
    """What the tracker showed, a ring, shape (n_late + 1, 9, m)."""
    seen_cylinders: Vec
    """The same of the cylinders, shape (n_late + 1, n, 4)."""
    watch: Watch
    """Of the safety layer."""
    touch: Watch
    """Of the contact search."""
    offset: Vec
    """How far workers have flown from their scripts [m], shape (W, 3)."""
    time: Vec
    """Time in the workers' scripts [s], shape (W,)."""
    q: Vec
    """Joints [rad], shape (6,)."""
    qd: Vec
    """Speeds [rad/s], shape (6,)."""
    qdd: Vec
    """Accelerations [rad/s^2], shape (6,)."""
    c: Vec
    """Commanded second coefficients [rad/s^2], shape (6,)."""
    d: Vec
    """Commanded third coefficients [rad/s^3], shape (6,)."""
    end: Vec
    """Commanded state after the period, shape (3, 6)."""
    act: Vec
    """Action, shape (CONTROLLED,)."""
    aim: Vec
    """What the policy is at: a posture, or times [rad, s], shape (6,)."""
    way: Vec
    """From person to robot [m], shape (3,)."""
    toward: Vec
    """Distances of one capsule to the robot's [m], shape (n,)."""
    plan: Vec
    """Swerve [rad], until when [s], start of the run [s], its share of the speed, (4,)."""
    rng: random.State
    """Random stream of the episode, shape (1,)."""


@kernel(error_model="numpy", inline="always")
def _worker_to_robot(w: int, work: TrialWorkspace) -> float:
    """Write the way from worker ``w`` to the nearest link; return the distance [m]."""
    robot, gap, first = work.watch.columns[NOW], work.touch.gap[NOW], w * body.N_CAPSULES
    _, j = least(gap[first : first + body.N_CAPSULES])
    distances(work.columns0, first + j, robot, work.toward)
    d, i = least(work.toward)
    segment_nearest(work.columns0, first + j, robot, i, work.way)
    return d


@kernel(error_model="numpy", inline="always")
def _cylinder_to_robot(x: float, y: float, work: TrialWorkspace) -> None:
    """Write the way from an axis to the nearest link's nearer end, seen from above [m]."""
    robot, best = work.watch.columns[NOW], 1e9
    for i in range(robot.shape[1]):
        for end in range(2):
            wx = robot[X, i] + end * robot[UX, i] - x
            wy = robot[Y, i] + end * robot[UY, i] - y
            if math.hypot(wx, wy) < best:
                best = math.hypot(wx, wy)
                work.way[0], work.way[1], work.way[2] = wx, wy, 0.0


@kernel(error_model="numpy")
def _swerve(mode: int, t: float, work: TrialWorkspace) -> None:
    """Turn the way of those who run by what they are up to, and give it length 1."""
    plan, way, rng = work.plan, work.way, work.rng
    if t >= plan[1]:
        plan[1] = t + 0.05 + 0.4 * random.uniform(rng)
        if mode == ZIGZAG:
            plan[0] = 1.2 * (2.0 * random.uniform(rng) - 1.0)
        elif mode == TEASE:
            plan[0] = math.pi if random.uniform(rng) < 0.45 else 0.0
            plan[3] = 0.3 + 0.7 * random.uniform(rng)
    c, s = math.cos(plan[0]), math.sin(plan[0])
    up = -way[2] if mode == TEASE and plan[0] > 0.0 else way[2]
    x, y = c * way[0] - s * way[1], s * way[0] + c * way[1]
    length = math.sqrt(x * x + y * y + up * up)
    scale = plan[3] / length if length > 1e-9 else 0.0
    way[0], way[1], way[2] = scale * x, scale * y, scale * up


@kernel(error_model="numpy")
def place_workers_at(people: People, work: TrialWorkspace, step: float) -> None:
    """Write the workers' capsules ``step`` seconds on in their scripts into ``columns1``."""
    state, out = work.state, work.columns1
    for w in range(work.time.shape[0]):
        when = state.clock[0, w] + people.pace * (work.time[w] + step)
        worker_at(people, state, 0, w, when, people.pace, work.crowd.away)
    copy_rows(state.size[0], work.crowd.size)
    place_workers(people, state.q[0], work.crowd)
    copy_rows(work.crowd.columns, out)
    for w in range(work.time.shape[0]):
        for k in range(w * body.N_CAPSULES, (w + 1) * body.N_CAPSULES):
            for i in range(3):
                out[i, k] += work.offset[w, i]


@kernel(error_model="numpy")
def blend(a: Vec, b: Vec, part: float, out: Vec) -> None:
    """Write capsules whose ends are ``part`` of the way from those of a to those of b."""
    for row in range(UX + 3):
        for k in range(a.shape[1]):
            out[row, k] = a[row, k] + part * (b[row, k] - a[row, k])
    for k in range(a.shape[1]):
        uu = out[UX, k] ** 2 + out[UY, k] ** 2 + out[UZ, k] ** 2
        out[UU, k], out[INVERSE, k] = uu, 1.0 / uu if uu > 1e-12 else 0.0
        out[RADIUS, k] = b[RADIUS, k]


@kernel(error_model="numpy", inline="always")
def advance_workers(
    people: People, trial: Trial, mode: int, t: float, dt: float, work: TrialWorkspace
) -> None:
    """Write where the workers are after the period, nobody faster than the trial's speed."""
    most, runs = BELOW * trial.human_speed * dt, mode != SCRIPT and t >= work.plan[2]
    if runs:
        for w in range(work.time.shape[0]):
            _worker_to_robot(w, work)
            _swerve(mode, t, work)
            for i in range(3):
                work.offset[w, i] += most * work.way[i]
    step = 0.0 if runs else dt
    for _ in range(4):
        place_workers_at(people, work, step)
        way = greatest_displacement(work.columns0, work.columns1)
        if way <= most:
            break
        step *= 0.95 * most / way
    for w in range(work.time.shape[0]):
        work.time[w] += step
    way = greatest_displacement(work.columns0, work.columns1)
    blend(
        work.columns0, work.columns1, min(1.0, most / way) if way > 0.0 else 1.0, work.columns
    )
    copy_rows(work.columns, work.columns1)


@kernel(error_model="numpy", inline="always")
def advance_cylinders(
    people: People, trial: Trial, mode: int, t: float, dt: float, work: TrialWorkspace
) -> None:
    """Write where the walkers are after the period, nobody faster than the trial's speed."""
    most, runs = BELOW * trial.human_speed * dt, mode != SCRIPT and t >= work.plan[2]
    for k in range(work.cylinders0.shape[0]):
        old, new, rows = work.cylinders0[k], work.cylinders1[k], work.state.walkers.rows
        advance_walker(people.walkers, work.state.walkers, 0, k, dt)
        for i in range(2):
            new[i] = rows[0, k, i]
        new[2] = rows[0, k, R]
        if runs:
            _cylinder_to_robot(old[0], old[1], work)
            _swerve(mode, t, work)
            new[0], new[1] = old[0] + most * work.way[0], old[1] + most * work.way[1]
            new[2] = old[2]
        way = math.hypot(new[0] - old[0], new[1] - old[1]) + abs(new[2] - old[2])
        part = min(1.0, most / way) if way > 0.0 else 1.0
        for i in range(3):
            new[i] = old[i] + part * (new[i] - old[i])


@kernel(error_model="numpy", inline="always")
def people_speed(work: TrialWorkspace, dt: float) -> float:
    """Return the greatest speed of any point of the people in the period [m/s]."""
    fastest = greatest_displacement(work.columns0, work.columns1)
    for k in range(work.cylinders0.shape[0]):
        old, new = work.cylinders0[k], work.cylinders1[k]
        way = math.hypot(new[0] - old[0], new[1] - old[1]) + abs(new[2] - old[2])
        fastest = max(fastest, way)
    return fastest / dt


def new_trial_work(
    arm: Arm, people: People, state: PeopleState, crowd: Crowd, watches: tuple[Watch, Watch],
    n_late: int,
) -> TrialWorkspace:  # fmt: skip
    """Return work space for people of one row of ``state``."""
    n_workers, n_walkers = state.q.shape[1], state.cylinders.shape[1]
    columns, cylinders = people.columns, np.zeros((n_walkers, 4))
    return TrialWorkspace(
        state,
        crowd,
        columns.copy(),
        columns.copy(),
        cylinders.copy(),
        cylinders.copy(),
        columns.copy(),
        cylinders.copy(),
        np.repeat(columns[None], n_late + 1, axis=0),
        np.repeat(cylinders[None], n_late + 1, axis=0),
        watches[0],
        watches[1],
        np.zeros((n_workers, 3)),
        np.zeros(n_workers),
        np.zeros(6),
        np.zeros(6),
        np.zeros(6),
        np.zeros(6),
        np.zeros(6),
        np.zeros((3, 6)),
        np.zeros(CONTROLLED),
        np.zeros(6),
        np.zeros(3),
        np.zeros(arm.columns.shape[1]),
        np.zeros(4),
        np.zeros(1, dtype=np.uint64),
    )
