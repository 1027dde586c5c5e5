"""A robot at rest or in a turn, and people before it."""

from dataclasses import replace

import numpy as np

from app.sim.cells.cell import load_cell
from app.sim.collision.checker import Checker, Shapes, capsule_shapes, no_people
from app.sim.robot.ur10 import Robot
from app.sim.safety.layer import SafetySettings
from app.sim.scene.scene import arm_of

CELL = load_cell("pick-and-place")
ARM = arm_of(CELL)
REST, NONE = np.array([1.0, -0.8, 0.4, 0.0, 0.0, 0.0]), np.zeros(6)  # stretched out
PAN = np.array([0.5, 0.0, 0.0, 0.0, 0.0, 0.0])
RADIUS = 0.05
NO_MARGINS = SafetySettings(reaction_time=0.0, protective_distance=0.0)


def tool(q=REST):
    """Where the tool's tip is [m], and which offset it goes when the base turns."""
    tip = Robot(ARM.lengths.tool).tcp_pose(q)[:3, 3]
    offset = np.array([-tip[1], tip[0], 0.0])
    return tip, offset / np.linalg.norm(offset), np.hypot(tip[0], tip[1])


def ball(center):
    return capsule_shapes(np.array([[center, center]]), np.array([RADIUS]))


def both(*shapes):
    return Shapes(
        capsules=np.concatenate([s.capsules for s in shapes], axis=1),
        cylinders=np.concatenate([s.cylinders for s in shapes]),
    )


def ahead(distance):
    """A ball before the turning tool, ``distance`` from its surface."""
    tip, offset, _ = tool()
    return ball(tip + (distance + RADIUS + CELL.robot.tool_radius) * offset)


def walker(distance, toward=0.0, across=0.0, growth=0.0):
    """A cylinder before the robot at rest, and how it goes on."""
    tip = tool()[0]
    offset = tip[:2] / np.linalg.norm(tip[:2])
    radius = 0.3
    x, y = tip[:2] + (distance + radius + CELL.robot.tool_radius) * offset
    going = np.append(-toward * offset + across * np.array([-offset[1], offset[0]]), growth)
    cylinders = np.array([[x, y, radius, 3.0]])
    return replace(no_people(), cylinders=cylinders, going=going[None])


def apart(people):
    """How far people are from the robot at rest now [m]."""
    return Checker(ARM, people).clearance(REST).people_m
