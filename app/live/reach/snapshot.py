"""State of a live reach cell beyond robot and people: goal, inference mode, outcomes."""

from dataclasses import dataclass
from typing import Literal

from app.live.read_model import Numbers, ReadModel

GoalMode = Literal["jump", "follow"]
"""``jump``: a reached goal is replaced by another one; ``follow``: it stays until dragged."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReachCounters(ReadModel):
    """Events since the last reset, besides ``counters``."""

    reaching_s: float = 0.0
    """time of the episodes that reached their goal [s]"""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReachSnapshot(ReadModel):
    """Goal, inference mode and outcomes at one tick."""

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
    counters: ReachCounters
    """events since the last reset"""
