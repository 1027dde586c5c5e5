"""Adversarial people: they try to hit the robot within the assumed speed, compiled.

In one period every end of a worker's capsules moves on a straight line, never farther than
``v dt``; so no point of the person is faster than ``v``, in any posture. A worker who would be
faster is slowed down: less of the script passes, and the remaining excess is cut. A walker's
axis and radius together change by at most ``v dt`` per period, so no point of the cylinder is
faster either.

*Script*: the work cycle, or the walk of docs/method.md 2.1. *Straight*: after a random time, at
``v`` straight toward the nearest link. *Zig-zag*: the same, with random swerves. *Tease*:
toward and away from the nearest link for random times. A running worker keeps the posture and
moves in any direction, even upwards: no human can, so that the trial is harder.
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
from app.sim.people.kernels.motion import worker_at
from app.sim.people.kernels.pedestrian import R, advance_pedestrian
from app.sim.people.kernels.people import People, PeopleGeometry, PeopleState, place_workers
from app.sim.robot.kernels.actions import ActionRule
from app.sim.robot.kernels.arm import CONTROLLED, Arm
from app.sim.robot.kernels.joints import JointState
from app.sim.safety.kernels.separation_check import NOW, SeparationRule, SsmWorkspace

SCRIPT, STRAIGHT, ZIGZAG, TEASE = range(4)
"""Behaviour of the people."""
BELOW = 1.0 - 1e-12
"""Greatest share of the allowed displacement, for rounding."""


class Trial(NamedTuple):
    """Settings of the episodes of a trial."""

    human_speed: float
    """Greatest true speed of any point of the people [m/s]."""
    n_late: int
    """Periods by which observations of people are late."""
    n_steps: int
    """Longest episode, in periods."""
    monitored: bool
    """Whether the safety layer acts; without it, trajectories are executed as commanded."""
    rule: SeparationRule
    """Assumptions of the safety layer."""
    action: ActionRule
    """Interpretation of the policies' actions."""


class TrialWorkspace(NamedTuple):
    """State and work space of episodes."""

    state: PeopleState
    """Scripts of the workers and walks of the pedestrians, of one environment."""
    geometry: PeopleGeometry
    """A pose of the people."""
    capsules0: Vec
    """The workers' capsules at the start of a period, shape (9, m)."""
    capsules1: Vec
    """The workers' capsules at the end of the period, shape (9, m)."""
    cylinders0: Vec
    """Pedestrians at the start of a period: x, y, radius, top [m], shape (n, 4)."""
    cylinders1: Vec
    """Pedestrians at the end of the period, likewise, shape (n, 4)."""
    capsules: Vec
    """The workers' capsules at a time within the period, shape (9, m)."""
    cylinders: Vec
    """Pedestrians at a time within the period, shape (n, 4)."""
    seen_capsules: Vec
    """Capsules in the observations of the last periods, a ring buffer, (n_late + 1, 9, m)."""
    seen_cylinders: Vec
    """Pedestrians in these observations, likewise, shape (n_late + 1, n, 4)."""
    ssm: SsmWorkspace
    """Work space of the safety layer."""
    touch: SsmWorkspace
    """Work space of the contact search."""
    offset: Vec
    """Displacement of workers from their scripts in the world frame [m], shape (W, 3)."""
    time: Vec
    """Time in the workers' scripts [s], shape (W,)."""
    q: Vec
    """The robot's joint positions [rad], shape (6,)."""
    qd: Vec
    """The robot's joint speeds [rad/s], shape (6,)."""
    qdd: Vec
    """The robot's joint accelerations [rad/s^2], shape (6,)."""
    c: Vec
    """Commanded second coefficients [rad/s^2], shape (6,)."""
    d: Vec
    """Commanded third coefficients [rad/s^3], shape (6,)."""
    end: JointState
    """Commanded state of the robot after the period."""
    act: Vec
    """Action of the policy, shape (CONTROLLED,)."""
    aim: Vec
    """Target of the policy: a configuration [rad] or switching times [s], shape (6,)."""
    direction: Vec
    """Direction of a person's motion, at first from person to robot [m], shape (3,)."""
    toward: Vec
    """Clearances of one of the workers' capsules to the robot's capsules [m], shape (n,)."""
    plan: Vec
    """Turn of the direction [rad], time at which it is drawn again [s], start of the run [s],
    share of the speed while running (0 to 1), shape (4,)."""
    rng: random.State
    """Random stream of the episode, shape (1,)."""


@kernel(error_model="numpy", inline="always")
def _worker_to_robot(w: int, work: TrialWorkspace) -> float:
    """Write the vector from worker ``w`` to the nearest link [m]; return the clearance [m]."""
    robot, first = work.ssm.capsules[NOW], w * body.N_CAPSULES
    _, j = least(work.touch.clearance[NOW, first : first + body.N_CAPSULES])
    distances(work.capsules0, first + j, robot, work.toward)
    d, i = least(work.toward)
    segment_nearest(work.capsules0, first + j, robot, i, work.direction)
    return d


@kernel(error_model="numpy", inline="always")
def _cylinder_to_robot(x: float, y: float, work: TrialWorkspace) -> None:
    """Write the horizontal vector from an axis (x, y) [m] to the nearest end of a link [m]."""
    robot, best = work.ssm.capsules[NOW], 1e9
    for i in range(robot.shape[1]):
        for end in range(2):
            wx = robot[X, i] + end * robot[UX, i] - x
            wy = robot[Y, i] + end * robot[UY, i] - y
            if math.hypot(wx, wy) < best:
                best = math.hypot(wx, wy)
                work.direction[0], work.direction[1], work.direction[2] = wx, wy, 0.0


@kernel(error_model="numpy")
def _turn_direction(mode: int, t: float, work: TrialWorkspace) -> None:
    """Turn the direction of running people by their behaviour and normalise it."""
    plan, direction, rng = work.plan, work.direction, work.rng
    if t >= plan[1]:
        plan[1] = t + 0.05 + 0.4 * random.uniform(rng)
        if mode == ZIGZAG:
            plan[0] = 1.2 * (2.0 * random.uniform(rng) - 1.0)
        elif mode == TEASE:
            plan[0] = math.pi if random.uniform(rng) < 0.45 else 0.0
            plan[3] = 0.3 + 0.7 * random.uniform(rng)
    c, s = math.cos(plan[0]), math.sin(plan[0])
    up = -direction[2] if mode == TEASE and plan[0] > 0.0 else direction[2]
    x, y = c * direction[0] - s * direction[1], s * direction[0] + c * direction[1]
    length = math.sqrt(x * x + y * y + up * up)
    scale = plan[3] / length if length > 1e-9 else 0.0
    direction[0], direction[1], direction[2] = scale * x, scale * y, scale * up


@kernel(error_model="numpy")
def place_workers_at(people: People, work: TrialWorkspace, step: float) -> None:
    """Write the workers' capsules into ``capsules1``, ``step`` [s] later in their scripts."""
    state, out = work.state, work.capsules1
    for w in range(work.time.shape[0]):
        when = state.clock[0, w] + people.pace * (work.time[w] + step)
        worker_at(people, state, 0, w, when, people.pace, work.geometry.away)
    copy_rows(state.size[0], work.geometry.size)
    place_workers(people, state.q[0], work.geometry)
    copy_rows(work.geometry.capsules, out)
    for w in range(work.time.shape[0]):
        for k in range(w * body.N_CAPSULES, (w + 1) * body.N_CAPSULES):
            for i in range(3):
                out[i, k] += work.offset[w, i]


@kernel(error_model="numpy")
def blend(a: Vec, b: Vec, part: float, out: Vec) -> None:
    """Write capsules interpolated between two sets.

    Args:
        a: Capsules, shape (9, n).
        b: The same capsules at another time, shape (9, n).
        part: 0 for those of ``a`` to 1 for those of ``b``.
        out: Filled, shape (9, n).
    """
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
    """Write the workers after the period into ``capsules1``, at most at the trial's speed.

    Args:
        mode: Behaviour of the people (SCRIPT ...).
        t: Time since the start of the episode [s].
        dt: Period [s].
    """
    most, runs = BELOW * trial.human_speed * dt, mode != SCRIPT and t >= work.plan[2]
    if runs:
        for w in range(work.time.shape[0]):
            _worker_to_robot(w, work)
            _turn_direction(mode, t, work)
            for i in range(3):
                work.offset[w, i] += most * work.direction[i]
    step = 0.0 if runs else dt
    for _ in range(4):
        place_workers_at(people, work, step)
        moved = greatest_displacement(work.capsules0, work.capsules1)
        if moved <= most:
            break
        step *= 0.95 * most / moved
    for w in range(work.time.shape[0]):
        work.time[w] += step
    moved = greatest_displacement(work.capsules0, work.capsules1)
    blend(
        work.capsules0,
        work.capsules1,
        min(1.0, most / moved) if moved > 0.0 else 1.0,
        work.capsules,
    )
    copy_rows(work.capsules, work.capsules1)


@kernel(error_model="numpy", inline="always")
def advance_cylinders(
    people: People, trial: Trial, mode: int, t: float, dt: float, work: TrialWorkspace
) -> None:
    """Write the pedestrians into ``cylinders1``, likewise; see :func:`advance_workers`."""
    most, runs = BELOW * trial.human_speed * dt, mode != SCRIPT and t >= work.plan[2]
    for k in range(work.cylinders0.shape[0]):
        old, new, rows = work.cylinders0[k], work.cylinders1[k], work.state.walkers.rows
        advance_pedestrian(people.walkers, work.state.walkers, 0, k, dt)
        for i in range(2):
            new[i] = rows[0, k, i]
        new[2] = rows[0, k, R]
        if runs:
            _cylinder_to_robot(old[0], old[1], work)
            _turn_direction(mode, t, work)
            new[0], new[1] = (
                old[0] + most * work.direction[0],
                old[1] + most * work.direction[1],
            )
            new[2] = old[2]
        moved = math.hypot(new[0] - old[0], new[1] - old[1]) + abs(new[2] - old[2])
        part = min(1.0, most / moved) if moved > 0.0 else 1.0
        for i in range(3):
            new[i] = old[i] + part * (new[i] - old[i])


@kernel(error_model="numpy", inline="always")
def people_speed(work: TrialWorkspace, dt: float) -> float:
    """Return the greatest speed of any point of the people in the period [m/s]."""
    fastest = greatest_displacement(work.capsules0, work.capsules1)
    for k in range(work.cylinders0.shape[0]):
        old, new = work.cylinders0[k], work.cylinders1[k]
        moved = math.hypot(new[0] - old[0], new[1] - old[1]) + abs(new[2] - old[2])
        fastest = max(fastest, moved)
    return fastest / dt


def new_trial_work(
    arm: Arm,
    people: People,
    state: PeopleState,
    geometry: PeopleGeometry,
    spaces: tuple[SsmWorkspace, SsmWorkspace],
    n_late: int,
) -> TrialWorkspace:
    """Return work space for people of one row of ``state``."""
    n_workers, n_pedestrians = state.q.shape[1], state.cylinders.shape[1]
    capsules, cylinders = people.capsules, np.zeros((n_pedestrians, 4))
    return TrialWorkspace(
        state=state,
        geometry=geometry,
        capsules0=capsules.copy(),
        capsules1=capsules.copy(),
        cylinders0=cylinders.copy(),
        cylinders1=cylinders.copy(),
        capsules=capsules.copy(),
        cylinders=cylinders.copy(),
        seen_capsules=np.repeat(capsules[None], n_late + 1, axis=0),
        seen_cylinders=np.repeat(cylinders[None], n_late + 1, axis=0),
        ssm=spaces[0],
        touch=spaces[1],
        offset=np.zeros((n_workers, 3)),
        time=np.zeros(n_workers),
        q=np.zeros(6),
        qd=np.zeros(6),
        qdd=np.zeros(6),
        c=np.zeros(6),
        d=np.zeros(6),
        end=JointState(np.zeros(6), np.zeros(6), np.zeros(6)),
        act=np.zeros(CONTROLLED),
        aim=np.zeros(6),
        direction=np.zeros(3),
        toward=np.zeros(arm.capsules.shape[1]),
        plan=np.zeros(4),
        rng=np.zeros(1, dtype=np.uint64),
    )
