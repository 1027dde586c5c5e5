"""What a live reach cell shows beyond robot and people: goal, way of deciding, safety layer."""

from dataclasses import dataclass
from typing import Literal

from app.sim.core.arrays import Vec

GoalMode = Literal["jump", "follow"]
"""Where the goal is next: somewhere else as soon as it is reached, or where it is dragged."""
GOAL_MODES: tuple[GoalMode, ...] = ("jump", "follow")


@dataclass(frozen=True, slots=True, kw_only=True)
class SafetyView:
    """What the safety layer says of this very state (METHOD 2.7)."""

    on: bool
    """Whether the robot obeys it."""
    override: float
    """Rate at which the commanded piece is executed; 1 where the layer is off."""
    advised: float
    """Rate that the layer would set, on or off."""
    person: int | None
    """Id of the person nearest to the robot; None where nobody is there."""
    link: str | None
    """The link that is nearest to that person."""
    separation: float | None
    """Their distance [m]."""
    required: float | None
    """Protective separation distance S_p for that link [m], the sum of the three terms."""
    person_distance: float | None
    """What the person covers until the robot rests, v_h (T_r + T_s) [m]."""
    robot_distance: float | None
    """What the robot covers until then, v_r T_r + B [m]."""
    margin: float
    """Distance to keep, C + Z_d + Z_r and the protective distance [m]."""
    use_measured_velocity: bool
    """Whether the layer goes by the velocities that people are seen with."""
    human_speed: float
    """Speed assumed for people, v_h; where measured what is added to theirs [m/s]."""
    stop_time: float
    """How long a stop takes from now, T_s [s]."""
    zone: Vec
    """Outline on the floor of where a person would be nearer than S_p [m], where velocities are
    measured one who stands; shape (n, 2), read-only."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReachCounters:
    """What happened since the last reset, besides ``snapshot.Counters``."""

    touched: int = 0
    """Times somebody walked into the robot while it stood still."""
    moving_s: float = 0.0
    """Time on the way to goals [s]."""
    slowed_s: float = 0.0
    """Part of it with the override below one half, standing included [s]."""
    stopped_s: float = 0.0
    """Part of it with the override at 0 [s]."""
    reaching_s: float = 0.0
    """Time of the episodes that reached their goal [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReachView:
    """A live reach cell at one tick."""

    goal: Vec
    """Where the tcp shall be [m], shape (3,), read-only."""
    goal_mode: GoalMode
    """Where the goal is next."""
    on_target: bool
    """Whether the goal is one of the cell's targets."""
    distance: float
    """tcp to goal [m]."""
    tolerance: float
    """Distance that counts as reached [m]."""
    time_left_s: float
    """Time left to reach it [s]."""
    inference_mode: str
    """How the policy is asked: one of ``ways``."""
    inference_modes: tuple[str, ...]
    """How it can be asked; empty without a policy."""
    walk_speed: float | None
    """Speed of all people that a visitor asked for [m/s]; None as METHOD 2.1."""
    safety: SafetyView
    """The safety layer."""
    counters: ReachCounters
    """What happened."""
