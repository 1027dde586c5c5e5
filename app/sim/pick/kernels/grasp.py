"""Phases of a pick: approach, descend and close, lift (compiled).

The target of a pick is a point over an object. From there the tool descends to the object,
holds still while the gripper closes, and comes up again; at a dock the same motion sets an
object down. The policy moves the robot in all phases; this module decides which phase it is.

| from | to | when |
|---|---|---|
| approach | descend | tool at the target, upright and slow, nobody within ``start_clearance`` |
| descend | lift | tool held at the object for ``close_s`` |
| descend | approach | somebody within ``abort_clearance``, or the tool off the line |
| lift | end | the tool is up again: success |

The line is the vertical over the object.

Source: this project. The thesis counts a target as reached within 0.1 m (section 5.3.1); the
object is not picked up in its simulator.
"""

import math
from typing import NamedTuple

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.core.pick_depth import PICK_DEPTH_M

APPROACH, DESCEND, LIFT = range(3)
"""Phases of a pick."""


class GraspRules(NamedTuple):
    """Geometry and times of a grasp; with ``depth`` 0 the task is the approach only."""

    depth: float = PICK_DEPTH_M
    """Descent from the target to the object [m]."""
    close_s: float = 1.25
    """Time for which the tool is held at the object while the gripper closes [s]."""
    start_distance: float = 0.03
    """Largest distance from the target at which the descent starts [m]."""
    hold_distance: float = 0.02
    """Largest distance from the object at which the gripper closes [m]."""
    tilt: float = 0.1
    """Largest angle of the tool to the vertical at the start of the descent and while the
    gripper closes [rad]."""
    speed: float = 0.1
    """Largest tcp speed then [m/s]."""
    start_clearance: float = 0.06
    """Least clearance to people for the descent to start [m]."""
    abort_clearance: float = 0.05
    """Clearance to people below which a descent is broken off [m]."""
    abort_offset: float = 0.06
    """Horizontal distance from the object beyond which a descent is broken off [m]."""
    lift_tolerance: float = 0.015
    """Height below the target at which the object counts as lifted [m]."""


class ToolState(NamedTuple):
    """The tool at the end of a control period."""

    tcp: Vec
    """Tool centre point [m], shape (3,)."""
    tilt: float
    """Angle of the tool to the vertical [rad]."""
    speed: float
    """Speed of the tcp [m/s]."""
    clearance: float
    """Clearance of the robot to people [m]."""


REACH_ONLY = GraspRules(depth=0.0)
"""No grasp: the task ends when the target is reached."""


@kernel(inline="always")
def target_height(rules: GraspRules, phase: int, goal: Vec) -> float:
    """Return the height at which the tool is wanted in a phase [m].

    Args:
        phase: Phase of the pick.
        goal: Target over the object [m], shape (3,).
    """
    height: float = goal[2]
    return height - rules.depth if phase == DESCEND else height


@kernel(inline="always")
def distance_left(rules: GraspRules, phase: int, goal: Vec, tcp: Vec) -> float:
    """Return the path length to the end of the pick [m].

    It is the distance to the phase's target, and the descent and lift to come.

    Args:
        goal: Target over the object [m], shape (3,).
        tcp: Tool centre point [m], shape (3,).
    """
    dz = target_height(rules, phase, goal) - tcp[2]
    to_target = math.sqrt((goal[0] - tcp[0]) ** 2 + (goal[1] - tcp[1]) ** 2 + dz * dz)
    return to_target + (2.0 - phase) * rules.depth


@kernel()
def next_phase(
    rules: GraspRules, phase: int, closing: float, goal: Vec, tool: ToolState, dt: float
) -> tuple[int, float, bool]:
    """Return the phase after a control period, the closing time [s] and whether it succeeded.

    Args:
        phase: Phase of the pick.
        closing: Time for which the tool has been held at the object [s].
        goal: Target over the object [m], shape (3,).
        tool: The tool at the end of the control period.
        dt: Control period [s].
    """
    tcp = tool.tcp
    offset = math.hypot(goal[0] - tcp[0], goal[1] - tcp[1])
    dz = tcp[2] - target_height(rules, phase, goal)
    distance = math.hypot(offset, dz)
    still = tool.tilt < rules.tilt and tool.speed < rules.speed
    if phase == APPROACH:
        clear = tool.clearance >= rules.start_clearance
        start = clear and still and distance < rules.start_distance
        return (DESCEND if start else APPROACH), 0.0, False
    if phase == LIFT:
        return LIFT, closing, dz > -rules.lift_tolerance
    if tool.clearance < rules.abort_clearance or offset > rules.abort_offset:
        return APPROACH, 0.0, False
    if distance >= rules.hold_distance or not still:
        return DESCEND, closing, False
    closing += dt
    return (LIFT if closing >= rules.close_s - 1e-9 else DESCEND), closing, False
