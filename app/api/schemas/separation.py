"""Speed and separation monitoring in a motion request and in its answer.

Source: ISO/TS 15066; docs/method.md 2.7.
"""

from dataclasses import replace
from typing import Annotated

from pydantic import Field

from app.api.schemas.numbers import Answer, Body, Data
from app.sim.human.model import CAPSULE_NAMES
from app.sim.reach.motion_types import MotionDecision
from app.sim.safety.layer import SafetySettings

Metres = Annotated[float, Field(ge=0.0, le=5.0)]
Seconds = Annotated[float, Field(ge=0.0, le=5.0)]


class SafetyInput(Body):
    """Assumptions of speed and separation monitoring; null keeps the value of the cell."""

    human_speed: Annotated[float, Field(ge=0.0, le=10.0)] | None = Field(
        default=None,
        description="assumed speed of any point of a person, v_h; a part of a person that is "
        "observed faster counts at its observed speed [m/s]",
    )
    use_measured_velocity: bool | None = Field(
        default=None,
        description="whether people given as cylinders are extrapolated with their own "
        "velocity (`vx`, `vy`, `growth`), which must then be measured, instead of with "
        "`human_speed` in any direction; people in other forms are not",
    )
    speed_change: Annotated[float, Field(ge=0.0, le=10.0)] | None = Field(
        default=None, description="assumed excess over that velocity, in any direction [m/s]"
    )
    reaction_time: Seconds | None = Field(
        default=None, description="time from a decision to its effect, a part of T_r [s]"
    )
    tracker_delay: Seconds | None = Field(
        default=None, description="age of the tracker's data on arrival, a part of T_r [s]"
    )
    intrusion_distance: Metres | None = Field(
        default=None, description="intrusion distance C [m]"
    )
    person_uncertainty: Metres | None = Field(
        default=None, description="uncertainty of a person's position, Z_d [m]"
    )
    robot_uncertainty: Metres | None = Field(
        default=None, description="uncertainty of the robot's position, Z_r [m]"
    )
    protective_distance: Metres | None = Field(
        default=None, description="additional distance to people while the robot moves [m]"
    )
    pfl: bool | None = Field(
        default=None,
        description="power and force limiting: whether contact is allowed at the speed limits "
        "of body parts",
    )

    def to_domain(self, own: SafetySettings) -> SafetySettings:
        """Return the settings of the cell with the given values in their place."""
        given = self.model_dump(exclude_none=True)
        return replace(own, **given) if given else own


class Terms(Answer):
    """Protective separation distance S_p of ISO/TS 15066, term by term."""

    person: int = Field(description="index in `people`")
    link: str = Field(description="nearest link of the robot")
    separation: float = Field(description="observed distance [m]")
    required: float = Field(
        description="v_h (T_r + T_s) + v_r T_r + B + C + Z_d + Z_r + protective distance [m]"
    )
    human_speed: float = Field(
        description="v_h [m/s]: assumed, or observed where that is faster; with "
        "`use_measured_velocity` the component toward the link plus `speed_change`"
    )
    robot_speed: float = Field(description="v_r, bound of that link's speed [m/s]")
    reaction_time: float = Field(description="T_r: period, reaction, delay and age [s]")
    stop_time: float = Field(description="T_s, duration of a stop [s]")
    braking: float = Field(description="B, displacement of the link during the stop [m]")
    intrusion: float = Field(description="C, intrusion distance [m]")
    person_uncertainty: float = Field(description="Z_d, of the person's position [m]")
    robot_uncertainty: float = Field(description="Z_r, of the robot's position [m]")
    protective_distance: float = Field(description="additional distance [m]")


class Override(Answer):
    """Speed override by monitoring, and its cause."""

    override: float = Field(description="override at the end of the period, 0 (a stop) to 1")
    set_by: int | None = Field(description="person that limits it: index in `people`, or null")
    part: str | None = Field(description="body part of that person; null for a cylinder")
    lacking: float = Field(
        description="violation of the separation distance on the refused motion [m]"
    )
    stop_distance: float = Field(
        description="bound of the distance of any point of the robot in a stop [m]"
    )
    terms: Terms | None = Field(
        description="S_p of that person, else of the one with the least reserve; null without "
        "people"
    )

    @staticmethod
    def data_of(decision: MotionDecision) -> Data | None:
        """Return the data of the override of a decision; None without monitoring."""
        safe, whose, terms = decision.safe, decision.terms_of, decision.terms
        if safe is None:
            return None
        known = None
        if whose is not None and terms is not None:
            known = {
                name: whose if name == "person" else getattr(terms, name)
                for name in Terms.model_fields
            }
        return {
            "override": safe.override,
            "set_by": None if safe.person is None else whose,
            "part": None if safe.part is None else CAPSULE_NAMES[safe.part],
            "lacking": safe.lacking,
            "stop_distance": safe.stop_distance,
            "terms": known,
        }
