"""Joint configurations that bring the tool to a target: the goals of the planners.

Damped least squares from random starts (Pinocchio) finds several configurations of any tilt,
among which a planner may choose.
"""

import numpy as np

from app.sim.core.arrays import Vec
from app.sim.robot.inverse_kinematics import configuration_at
from app.sim.robot.kernels.arm import CONTROLLED, Arm
from app.sim.robot.ur10 import Robot

N_STARTS = 24
"""Starts of the search: the cell's home, then random ones."""
APART = 0.1
"""Configurations nearer than this count as one [rad]."""


def goal_configurations(
    arm: Arm, target: Vec, rng: np.random.Generator, *, spread: float = 0.0
) -> Vec:
    """Return configurations whose tcp is at a target, of any tilt.

    Args:
        arm: From ``scene.arm_of``.
        target: Position of the tcp [m], shape (3,).
        rng: Source of the starts of the search and of points near the target.
        spread: Greatest distance of the tcp to the target [m]; success counts within 0.1 m.

    Returns:
        Configurations inside the joint limits that differ by at least APART [rad], shape
        (k, 6), with the joints beyond the controlled ones at home; k = 0 where none was found.
        People and contacts are not considered.
    """
    robot = Robot(arm.lengths.tool)
    found: list[Vec] = []
    for k in range(N_STARTS):
        q = np.array(arm.home)
        if k > 0:
            low, high = arm.limits.within_half_turn()
            q[:CONTROLLED] = rng.uniform(low[:CONTROLLED], high[:CONTROLLED])
        point = np.array(target, dtype=np.float64)
        if k > 0 and spread > 0.0:
            offset = rng.normal(size=3)
            point += spread * rng.uniform() ** (1.0 / 3.0) * offset / np.linalg.norm(offset)
        limits = arm.limits.q_min, arm.limits.q_max
        reached = configuration_at(robot, point, q, limits, CONTROLLED)
        if reached is None:
            continue
        if all(np.abs(reached - other).max() > APART for other in found):
            found.append(reached)
    return np.array(found).reshape(-1, 6)


def goal_configurations_of(arm: Arm, goals: Vec, seed: int, spread: float) -> list[Vec]:
    """Return :func:`goal_configurations` of each of several goals, (k, 6) each.

    Args:
        goals: Goals [m], shape (n, 3).
        seed: Seed of the search; (seed, index) determines those of a goal.
    """
    return [
        goal_configurations(arm, goal, np.random.default_rng([seed, k]), spread=spread)
        for k, goal in enumerate(goals)
    ]
