"""State of a live reach cell beyond robot and people: goal, inference mode, safety layer."""

from dataclasses import dataclass
from typing import Literal

from app.live.read_model import Internal, Numbers, ReadModel

GoalMode = Literal["jump", "follow"]
"""``jump``: a reached goal is replaced by another one; ``follow``: it stays until dragged."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SafetySnapshot(ReadModel):
    """Speed and separation monitoring of the present state (docs/method.md 2.7)."""

    on: bool
    """whether the robot obeys the safety layer"""
    override: float
    """executed speed override, 0 to 1; 1 with the layer disabled"""
    advised: float
    """override of the layer, enabled or not"""
    person: int | None
    """id of the person nearest to the robot; null without people"""
    link: str | None
    """link nearest to that person"""
    separation: float | None
    """separation distance [m]"""
    required: float | None
    """protective separation distance S_p of that link, the sum of the three terms [m]"""
    person_distance: float | None
    """human contribution S_h = v_h (T_r + T_s) [m]"""
    robot_distance: float | None
    """robot reaction and stopping S_r + S_s = v_r T_r + B [m]"""
    margin: float
    """C + Z_d + Z_r and the protective distance [m]"""
    use_measured_velocity: bool
    """whether S_p uses the measured velocities of people"""
    human_speed: float
    """assumed speed of people v_h; added to measured velocities [m/s]"""
    stop_time: float
    """stopping time from now T_s [s]"""
    zone: Internal
    """outline on the floor of the positions nearer than S_p [m], shape (n, 2); for a standing
    person where velocities are measured"""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReachCounters(ReadModel):
    """Events since the last reset, besides ``counters``."""

    touched: int = 0
    """contacts of a person with the standing robot"""
    moving_s: float = 0.0
    """time of the motions to goals [s]"""
    slowed_s: float = 0.0
    """part of it with the override below 0.5, standstill included [s]"""
    stopped_s: float = 0.0
    """part of it with the override at 0 [s]"""
    reaching_s: float = 0.0
    """time of the episodes that reached their goal [s]"""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReachSnapshot(ReadModel):
    """Goal, safety layer and outcomes at one tick."""

    goal: Numbers
    """target of the tool centre point [m]"""
    goal_mode: GoalMode
    """`jump` or `follow`"""
    on_target: bool
    """whether the goal is one of the cell's targets"""
    distance: float
    """tool centre point to goal [m]"""
    tolerance: float
    """distance that counts as reached [m]"""
    time_left_s: float
    """time left to reach the goal [s]"""
    inference_mode: str
    """inference mode of the policy; empty without one"""
    inference_modes: tuple[str, ...]
    """available inference modes"""
    walk_speed: float | None
    """walking speed of all people [m/s]; null: variable, as in training"""
    safety: SafetySnapshot
    """speed and separation monitoring"""
    counters: ReachCounters
    """events since the last reset"""
