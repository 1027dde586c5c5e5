"""Hands that fly past the arm at 2.5 m/s, for the contact test and against the raw meshes.

At that speed a hand crosses 125 mm in one period of 50 ms. It may be clear of the arm at both
ends of the period, and a test of poses alone would let it pass.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from app.sim.cells.cell import Cell
from app.sim.collision.contact import clearance, contact
from app.sim.collision.fcl_recheck import Recheck, Trajectory, robot_ends
from app.sim.human import model as human
from app.sim.human.kernels import kinematics as body
from app.sim.robot.capsules import load_robot_capsules
from app.sim.robot.kernels.joints import JointPath
from app.sim.robot.ur10 import Robot
from app.sim.scene.scene import NO_CYLINDERS, arm_of, people_of

HAND_SPEED = 2.5
"""Speed of the palm, as fast as clean motion capture shows hands [m/s]."""
SUBSTEPS = 50
"""Rows per period of 50 ms: the referee looks every millisecond."""
HAND_RADIUS = float(human.CAPSULE_RADII[body.C_HAND_R])
OUTER = range(3, 12)
"""Capsules of the robot that hands fly past: from the upper arm's middle to the tool."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Period:
    """One control period in which a palm flies past the robot."""

    q: np.ndarray
    """The robot's joints at the start [rad], shape (6,)."""
    qd: np.ndarray
    """Their speeds [rad/s], shape (6,)."""
    c: np.ndarray
    """Coefficients of the period [rad/s^2], shape (6,)."""
    before: np.ndarray
    """The person's joints at the start [m, rad], shape (18,)."""
    after: np.ndarray
    """The person's joints at the end [m, rad], shape (18,)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pass:
    """What was found in one period."""

    speed: float
    """Mean speed of the faster palm [m/s]."""
    reported: float | None
    """When the kernels report contact [s]; None where they do not."""
    touching: float | None
    """First millisecond at which raw meshes touch [s]; None where they never do."""
    clear_at_ends: bool
    """Whether the kernels' clearances are positive at start and end of the period."""


def draw(cell: Cell, rng: np.random.Generator, robot: Robot) -> Period | None:
    """Draw a period; None where the person cannot move like that."""
    mount, capsules = cell.robot, load_robot_capsules()
    target = rng.uniform([-0.6, 0.4, 0.05], [0.6, 0.8, 0.4])
    q = robot.ik_vertical(target, np.array(mount.q_min), np.array(mount.q_max))
    assert q is not None
    speed, dt = np.array(mount.qd_max), mount.dt
    qd = rng.uniform(-speed, speed)
    end = np.clip(qd + rng.uniform(-1, 1, 6) * mount.qdd_max * dt, -speed, speed)
    p0, p1 = robot_ends(robot, capsules, q[None])
    k = rng.choice(OUTER)
    near = p0[0, k] + rng.random() * (p1[0, k] - p0[0, k])
    stand = human.rest_posture(
        near[0] + rng.uniform(-0.3, 0.3), max(1.0, near[1] + rng.uniform(0.4, 0.7)), -1.57
    )
    # The finger tips graze the side that faces the person: only so can a hand be clear of the
    # link before and after, with the forearm behind it.
    side = human.joint_points(stand, cell.body)["neck"] - near + rng.normal(0.0, 0.05, 3)
    side /= np.linalg.norm(side)
    step = np.cross(side, rng.normal(size=3))
    step *= 0.5 * HAND_SPEED * dt / np.linalg.norm(step)
    graze = rng.uniform(0.7, 1.05) * (capsules.radius[k] + HAND_RADIUS)
    middle = near + (graze + body.HAND_TIP - body.MEDIAN_HAND) * side
    hand, swivel = rng.choice(["r", "l"]), rng.uniform(0.0, 0.9)
    ends = [
        human.reach(hand, middle + sign * step, stand, cell.body, swivel=swivel)
        for sign in (-1.0, 1.0)
    ]
    if not all(one.reached for one in ends):
        return None
    c = (end - qd) / (2.0 * dt)
    return Period(q=q, qd=qd, c=c, before=ends[0].q, after=ends[1].q)


def rows(case: Period, dt: float) -> Trajectory:
    """The period as robot and person really move, a row each millisecond."""
    x = np.linspace(0.0, dt, SUBSTEPS + 1)[:, None]
    return Trajectory(
        q_robot=case.q + case.qd * x + case.c * x**2,
        q_human=case.before + (case.after - case.before) * x / dt,
    )


def palm_speed(cell: Cell, case: Period) -> float:
    """Mean speed of the faster palm [m/s]."""
    ends = [human.joint_points(q, cell.body) for q in (case.before, case.after)]
    moved = [np.linalg.norm(ends[1][name] - ends[0][name]) for name in ("hand_r", "hand_l")]
    return float(max(moved)) / cell.robot.dt


def passes(cell: Cell, n: int, seed: int) -> Iterator[Pass]:
    """Yield what kernels and meshes find in up to n periods; some cannot be moved like that."""
    rng, robot, recheck = np.random.default_rng(seed), Robot(), Recheck(cell)
    arm, people, zero = arm_of(cell), people_of(cell), np.zeros(6)
    for _ in range(n):
        case = draw(cell, rng, robot)
        if case is None:
            continue
        ends = (case.before[None], case.after[None])
        found = contact(arm, people, JointPath(case.q, case.qd, case.c, zero), ends)
        path = rows(case, arm.dt)
        touching = recheck.first_contact(path)
        yield Pass(
            speed=palm_speed(cell, case),
            reported=None if found.kind == "none" else found.time_s,
            touching=None if touching is None else touching.index * arm.dt / SUBSTEPS,
            clear_at_ends=all(
                clearance(arm, people, q, human_q[None], NO_CYLINDERS).people_m > 0.0
                for q, human_q in zip(path.q_robot[[0, -1]], path.q_human[[0, -1]], strict=True)
            ),
        )
