"""The protective separation distance around the whole robot, as a zone on the floor.

``SafetyLayer.terms`` gives S_p for one person and the nearest link. This module gives S_p of
every capsule, at the bound on its speed, and the area that it covers on the floor.

Source: docs/method.md 2.7; ISO/TS 15066:2016, 5.5.4.
"""

import numpy as np

from app.sim.core.arrays import Vec, as_kernel_array
from app.sim.geometry.capsules import RADIUS, UX, UY, X, Y
from app.sim.robot.kernels import arm as arm_kernel
from app.sim.robot.kernels import override
from app.sim.robot.kernels.arm import Arm
from app.sim.safety.layer import SafetySettings

N_DIRECTIONS = 72
"""Corners of the outline."""


def required_distances(arm: Arm, settings: SafetySettings, qd: Vec) -> Vec:
    """Return S_p of each of the robot's capsules [m], shape (n,).

    Args:
        qd: Joint speeds [rad/s], shape (6,).
    """
    t_stop = float(override.stop_time(as_kernel_array(qd), arm.limits.qdd_max))
    t_r = arm.dt + settings.latency
    fastest = np.concatenate([[0.0], np.cumsum(np.abs(qd) * arm.lever)])
    v_r = fastest[arm.link]
    robot_distance = v_r * (t_r + 0.5 * t_stop)
    return np.asarray(settings.other_speed * (t_r + t_stop) + robot_distance + settings.margin)


def separation_zone(arm: Arm, settings: SafetySettings, q: Vec, qd: Vec) -> Vec:
    """Return the outline of the area in which a person is nearer than S_p.

    The convex hull, in the horizontal plane, of all capsules, each grown by its own S_p for
    people at the assumed speed; a part that is observed faster is stopped for further out. With
    measured velocities it is the zone of cylinders at rest; workers are stopped for further
    out.

    Args:
        q: Joint positions [rad], shape (6,).
        qd: Joint speeds [rad/s], shape (6,).

    Returns:
        Corners, counter-clockwise [m], shape (N_DIRECTIONS, 2).
    """
    robot = arm_kernel.new_robot_pose(arm)
    arm_kernel.place_robot(arm, as_kernel_array(q), robot)
    n = len(arm.link)
    start, along = robot.capsules[[X, Y], :n].T, robot.capsules[[UX, UY], :n].T
    points = np.concatenate([start, start + along])
    grown = robot.capsules[RADIUS, :n] + required_distances(arm, settings, qd)
    radii = np.tile(grown, 2)
    angles = 2.0 * np.pi * np.arange(N_DIRECTIONS) / N_DIRECTIONS
    out = np.column_stack([np.cos(angles), np.sin(angles)])
    furthest = np.argmax(out @ points.T + radii, axis=1)
    return np.asarray(points[furthest] + radii[furthest, None] * out)
