"""State of the safety layer at one tick."""

from dataclasses import dataclass

from app.live.read_model import Internal, ReadModel


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
    """id of the person that limits the override, else of the one with the least reserve: its
    distance minus what it may move until the robot rests; null without people"""
    link: str | None
    """link nearest to the body part of that person with the least reserve"""
    separation: float | None
    """distance of that link and that body part [m]"""
    required: float | None
    """S_p of that link with the protective distance: the sum of the three terms [m]"""
    person_distance: float | None
    """human contribution S_h = v_h (T_r + T_s) [m]"""
    robot_distance: float | None
    """robot reaction and stopping S_r + S_s = v_r T_r + B [m]"""
    margin: float
    """C + Z_d + Z_r and the protective distance [m]"""
    protective_distance: float
    """part of the margin: distance added to S_p [m]"""
    use_measured_velocity: bool
    """whether S_p uses the measured velocities of people"""
    human_speed: float
    """assumed speed of people v_h; added to measured velocities [m/s]"""
    reaction_time: float
    """reaction time, a part of T_r [s]"""
    pfl: bool
    """whether power and force limiting permits contacts at admissible speeds"""
    stop_time: float
    """stopping time from now T_s [s]"""
    moving_s: float
    """time of motions since the last reset [s]"""
    slowed_s: float
    """part of it with the override below 0.5, standstill included [s]"""
    stopped_s: float
    """part of it with the override at 0 [s]"""
    zone: Internal
    """outline on the floor of the positions nearer than S_p [m], shape (n, 2): of people at the
    assumed speed; of a standing person where velocities are measured"""
