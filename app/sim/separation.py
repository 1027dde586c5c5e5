"""The protective separation distance of the standard, term by term, and as a zone on the floor.

S_p = v_h (T_r + T_s) + (v_r T_r + B) + (C + Z_d + Z_r + protective distance), for each capsule
of the robot as fast as its joints could make it. ``safety.py`` decides by the poses themselves,
not by this sum; the sum is what people are shown.

Source: METHOD 2.7; ISO/TS 15066:2016, 5.5.4.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from app.sim.kernels import arm as arm_kernel
from app.sim.kernels import override
from app.sim.kernels.arm import Arm
from app.sim.kernels.columns import RADIUS, UX, UY, X, Y
from app.sim.kernels.cylinder import cylinder_clearance
from app.sim.ports import Vec
from app.sim.robot import LINK_NAMES
from app.sim.scene import own

if TYPE_CHECKING:  # safety.py takes the sum from here
    from app.sim.safety import SafetySettings

N_DIRECTIONS = 72
"""Corners of the zone's outline."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Separation:
    """S_p of one capsule of the robot [m], and its terms."""

    person_way: float
    """v_h (T_r + T_s) [m]."""
    robot_way: float
    """v_r T_r + B [m]."""
    margin: float
    """C + Z_d + Z_r and the protective distance [m]."""
    stop_time: float
    """T_s [s]."""

    @property
    def required(self) -> float:
        """S_p [m]."""
        return self.person_way + self.robot_way + self.margin


def separation_of(
    arm: Arm, settings: "SafetySettings", qd: Vec, capsule: int, age: float = 0.0
) -> Separation:
    """Return S_p of one of the robot's capsules.

    Args:
        arm: Robot in its cell.
        settings: Assumptions.
        qd: Joint speeds [rad/s], shape (6,).
        capsule: Which capsule.
        age: How old people's places are beyond the tracker's delay [s].
    """
    t_stop = float(override.stop_time(own(qd), arm.qdd_max))
    joints = slice(0, int(arm.link[capsule]))
    v_r = float(np.abs(qd[joints]) @ arm.lever[joints])
    t_r = arm.dt + settings.lead + age
    return Separation(
        person_way=settings.human_speed * (t_r + t_stop),
        robot_way=v_r * t_r + 0.5 * v_r * t_stop,
        margin=settings.margin,
        stop_time=t_stop,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Nearest:
    """The cylinder nearest to the robot."""

    index: int
    """Which cylinder, from 0."""
    capsule: int
    """The robot's capsule that is nearest to it."""
    link: str
    """The link that it belongs to."""
    distance: float
    """Their distance [m]."""


def nearest_cylinder(arm: Arm, q: Vec, cylinders: Vec) -> Nearest | None:
    """Return which cylinder is nearest to the robot, and to what of it; None for nobody.

    Args:
        arm: Robot in its cell.
        q: Joint positions [rad], shape (6,).
        cylinders: x, y, radius and top of each [m], shape (C, 4).
    """
    robot = arm_kernel.new_robot_pose(arm)
    arm_kernel.place_robot(arm, own(q), robot)
    found = [cylinder_clearance(robot.columns, 0, *row) for row in cylinders]
    if not found:
        return None
    index = int(np.argmin([distance for distance, _ in found]))
    distance, capsule = found[index]
    return Nearest(
        index=index,
        capsule=int(capsule),
        link=LINK_NAMES[arm.link[capsule]],
        distance=float(distance),
    )


def zone(arm: Arm, settings: "SafetySettings", q: Vec, qd: Vec) -> Vec:
    """Return the outline of where a person would be nearer than S_p.

    The convex hull, seen from above, of all capsules, each grown by its own S_p.

    Args:
        arm: Robot in its cell.
        settings: Assumptions.
        q: Joint positions [rad], shape (6,).
        qd: Joint speeds [rad/s], shape (6,).

    Returns:
        Corners, counter-clockwise [m], shape (N_DIRECTIONS, 2).
    """
    robot = arm_kernel.new_robot_pose(arm)
    arm_kernel.place_robot(arm, own(q), robot)
    n = len(arm.link)
    grown = [separation_of(arm, settings, qd, k).required for k in range(n)]
    start, along = robot.columns[[X, Y], :n].T, robot.columns[[UX, UY], :n].T
    points = np.concatenate([start, start + along])
    radii = np.tile(robot.columns[RADIUS, :n] + grown, 2)
    angles = 2.0 * np.pi * np.arange(N_DIRECTIONS) / N_DIRECTIONS
    out = np.column_stack([np.cos(angles), np.sin(angles)])
    furthest = np.argmax(out @ points.T + radii, axis=1)
    return np.asarray(points[furthest] + radii[furthest, None] * out)
