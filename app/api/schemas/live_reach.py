"""A live reach cell: what it shows beyond robot and people, and what may be done to it."""

from typing import Self

from pydantic import Field

from app.api.schemas.numbers import Answer
from app.live.reach.snapshot import ReachView, SafetyView


class SafetyLive(Answer):
    """What the safety layer says of this very state."""

    on: bool = Field(description="whether the robot obeys it")
    override: float = Field(description="rate that is executed, 0 to 1; 1 with the layer off")
    advised: float = Field(description="rate that the layer would set, on or off")
    person: int | None = Field(description="id of the person nearest to the robot")
    link: str | None = Field(description="link that is nearest to that person")
    separation: float | None = Field(description="their distance [m]")
    required: float | None = Field(
        description="protective separation distance S_p of that link [m], sum of three terms"
    )
    person_distance: float | None = Field(description="v_h (T_r + T_s) [m]")
    robot_distance: float | None = Field(description="v_r T_r + B [m]")
    margin: float = Field(description="C + Z_d + Z_r and the protective distance [m]")
    use_measured_velocity: bool = Field(
        description="the layer goes by the velocities that people are seen with"
    )
    human_speed: float = Field(
        description="speed assumed for people, v_h; where measured, added to theirs [m/s]"
    )
    stop_time: float = Field(description="how long a stop takes from now, T_s [s]")

    @classmethod
    def from_domain(cls, view: SafetyView) -> Self:
        """Make it from the world's view."""
        return cls(**{name: getattr(view, name) for name in cls.model_fields})


class ReachCountersPublic(Answer):
    """What happened since the last reset, besides ``counters``."""

    touched: int = Field(description="times somebody walked into the standing robot")
    moving_s: float = Field(description="time on the way to goals [s]")
    slowed_s: float = Field(description="of it with the override below 0.5, also at 0 [s]")
    stopped_s: float = Field(description="of it with the override at 0 [s]")
    reaching_s: float = Field(description="time of the episodes that reached their goal [s]")


class ReachLive(Answer):
    """Goal, safety layer and outcomes at one tick."""

    goal: list[float] = Field(description="where the tool centre point shall be [m]")
    goal_mode: str = Field(description="jump or follow")
    on_target: bool = Field(description="the goal is one of the cell's targets")
    distance: float = Field(description="tool centre point to goal [m]")
    tolerance: float = Field(description="distance that counts as reached [m]")
    time_left_s: float = Field(description="time left to reach it [s]")
    inference_mode: str = Field(description="how the policy is asked; empty without one")
    inference_modes: list[str] = Field(description="how it can be asked")
    walk_speed: float | None = Field(
        description="speed of all people that was asked for [m/s]; null: it varies"
    )
    safety: SafetyLive
    counters: ReachCountersPublic

    @classmethod
    def from_domain(cls, view: ReachView) -> Self:
        """Make it from the world's view."""
        same = (
            "goal_mode", "on_target", "distance", "tolerance", "time_left_s", "inference_mode",
            "walk_speed",
        )  # fmt: skip
        counters = ReachCountersPublic.model_fields
        return cls(
            **{name: getattr(view, name) for name in same},
            goal=view.goal.tolist(),
            inference_modes=list(view.inference_modes),
            safety=SafetyLive.from_domain(view.safety),
            counters=ReachCountersPublic(
                **{name: getattr(view.counters, name) for name in counters}
            ),
        )
