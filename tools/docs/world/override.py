"""Measure the safety layer while a person approaches a moving robot (docs/method.md 2.7).

The robot moves back and forth between two cubes; a worker walks to the table, stays and leaves.
Measured and drawn for ``docs/world.md``.
"""

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from app.sim.cells.cell import load_cell
from app.sim.collision.checker import shapes_of
from app.sim.collision.contact import clearance
from app.sim.human import model as human
from app.sim.pick.batch import step_robot
from app.sim.primitives.phase import min_jerk
from app.sim.robot.ur10 import Robot
from app.sim.safety.layer import SafetyLayer, safety_settings
from app.sim.scene.scene import NO_CYLINDERS, arm_of, people_of
from tools.docs.results import Json
from tools.docs.world.plots import BLUE, GREY, RED, WIDTH

CUBES = ("cube0", "cube5")
"""Stations between which the robot moves."""
FAR, NEAR = 3.2, 1.2
"""Pelvis y before the visit and at the table [m]."""
COMES, STAYS, LEAVES, ENDS = 2.0, 5.0, 9.0, 14.0
"""Times of departure, arrival, return and end [s]."""
GAIN = 4.0
"""Gain of the joint speeds toward the next cube [1/s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Visit:
    """Quantities at the ends of n control periods."""

    time: np.ndarray
    """Time [s], shape (n,)."""
    separation: np.ndarray
    """Distance of robot and person [m], shape (n,)."""
    override: np.ndarray
    """Speed override [%], shape (n,)."""
    speed: np.ndarray
    """Speed of the TCP [m/s], shape (n,)."""
    protective: float
    """Distance that the layer keeps while the robot moves [m]: C + Z_d + Z_r + protective
    distance."""


def pelvis_y(t: float) -> float:
    """Return the pelvis y of the person [m]: minimum jerk to the table, stay, return."""
    there, back = min_jerk((t - np.array([COMES, LEAVES])) / (STAYS - COMES))
    return float(FAR + (NEAR - FAR) * (there - back))


def visit() -> tuple[Json, Visit]:
    """Simulate the visit; return numbers and time series."""
    cell = load_cell()
    arm, people, robot = arm_of(cell), people_of(cell), Robot(cell.robot.tool_length)
    settings = safety_settings(cell)
    layer = SafetyLayer(arm, settings)
    goals = [np.array(cell.station(name).position) for name in CUBES]
    found = [robot.ik_vertical(goal, arm.limits.q_min, arm.limits.q_max) for goal in goals]
    configurations = [q for q in found if q is not None]
    assert len(configurations) == len(CUBES), "the robot reaches both cubes"
    q, qd, qdd = configurations[0].copy(), np.zeros(6), np.zeros(6)
    at, rows = 1, []
    for period in range(round(ENDS / arm.dt)):
        person = human.rest_posture(0.0, pelvis_y(period * arm.dt), -0.5 * np.pi)
        if np.abs(configurations[at] - q).max() < 0.05:
            at = 1 - at
        act = np.clip(GAIN * (configurations[at] - q) / arm.limits.qd_max, -1.0, 1.0)[:5]
        segment = step_robot(arm, q, qd, qdd, act)
        done = layer.decide(q, qd, segment.c, segment.d, shapes_of(cell, person[None]))
        q, qd, qdd = done.q, done.qd, done.qdd
        later = human.rest_posture(0.0, pelvis_y((period + 1) * arm.dt), -0.5 * np.pi)
        gap = clearance(arm, people, q, later[None], NO_CYLINDERS).people_m
        speed = float(np.linalg.norm((robot.jacobian(q) @ qd)[:3]))
        rows.append(((period + 1) * arm.dt, gap, 100.0 * done.override, speed))
    time, separation, override, speed = np.array(rows).T
    moving = speed > 1e-3
    numbers = {
        "cell": cell.name,
        "settings": settings.describe(),
        "person_peak_m_s": 1.875 * (FAR - NEAR) / (STAYS - COMES),
        "stopped_s": float((~moving & (time > COMES)).sum() * arm.dt),
        "below_half_s": float((override < 50.0).sum() * arm.dt),
        "least_separation_m": float(separation.min()),
        "least_separation_moving_m": float(separation[moving].min()),
    }
    return numbers, Visit(
        time=time,
        separation=separation,
        override=override,
        speed=speed,
        protective=settings.margin,
    )


def draw(one: Visit) -> Figure:
    """Draw separation, override and tool speed over time."""
    figure = Figure(figsize=(WIDTH, 5.6))
    top, middle, low = figure.subplots(3, 1, sharex=True)
    top.plot(one.time, one.separation, color=BLUE)
    top.axhline(one.protective, color=RED, lw=1.1, ls="--")
    top.annotate(
        f"protective distance {one.protective:g} m",
        (one.time[-1], one.protective),
        xytext=(-4, 4),
        textcoords="offset points",
        ha="right",
        color=RED,
    )
    top.set(title="Separation distance", ylabel="distance [m]", ylim=(0.0, 2.6))
    middle.step(one.time, one.override, where="pre", color=BLUE)
    middle.fill_between(one.time, one.override, step="pre", color=BLUE, alpha=0.12)
    middle.set(title="Override", ylabel="override [%]", ylim=(0.0, 105.0))
    low.plot(one.time, one.speed, color=BLUE)
    low.set(title="Speed of the TCP", ylabel="speed [m/s]", xlabel="time [s]", ylim=(0.0, None))
    low.set_xlim(0.0, one.time[-1])
    for axis in (top, middle, low):
        for begin, text in ((COMES, "approaches"), (STAYS, "at the table"), (LEAVES, "leaves")):
            axis.axvline(begin, color=GREY, lw=0.8, ls=":")
            if axis is top:
                axis.annotate(
                    text, (begin, top.get_ylim()[1]), xytext=(3, -9), textcoords="offset points"
                )
    return figure
