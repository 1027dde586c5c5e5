"""Says in one sentence what the robot of a live reach cell does and why."""

from app.live.reach.snapshot import ReachView, SafetyView
from app.live.snapshot import Status

FULL = 0.995
"""Override from which on nothing is said of it."""
NO_PILOT = "No trained policy acts here: the robot goes straight to the goal's posture"


def doing(status: Status, view: ReachView, *, piloted: bool, n_people: int) -> str:
    """Return what the robot does.

    Args:
        status: What the robot is doing.
        view: Goal and safety layer.
        piloted: Whether a policy moves it.
        n_people: How many people there are.
    """
    if status == "blocked":
        return "Waiting at home: a person stands where the robot begins."
    if status == "reached":
        then = "drag it on" if view.goal_mode == "follow" else "the next one follows"
        return f"Reached the goal: {then}."
    if (why := slowed(view.safety, n_people)) is not None:
        return why
    far = f"{100.0 * view.distance:.0f} cm to go"
    if not piloted:
        return f"{NO_PILOT}, {far}; it does not see people."
    return f"On its way to the goal, {far}."


def slowed(safety: SafetyView, n_people: int) -> str | None:
    """Return why the safety layer slows the robot down; None where it does not."""
    if not safety.on or safety.override >= FULL or safety.separation is None:
        return None
    verb = "Stopped" if safety.override <= 0.0 else f"Slowed to {100 * safety.override:.0f} %"
    who = "the person" if n_people < 2 else f"person {(safety.person or 0) + 1}"
    gap, need = safety.separation, safety.required or 0.0
    place = f"{who} is {max(gap, 0.0):.2f} m from the {link_name(safety.link)}"
    if gap <= 0.0:
        return f"{verb}: {who} touches the {link_name(safety.link)}; the robot stands still."
    if gap < need:
        return f"{verb}: {place}, {need:.2f} m needed."
    return f"{verb}: {place}, and could come too near on the way ahead."


def link_name(link: str | None) -> str:
    """Return a link's name for people."""
    return {
        None: "robot",
        "base_link": "base",
        "shoulder_link": "shoulder",
        "upper_arm_link": "upper arm",
        "forearm_link": "forearm",
        "wrist_1_link": "wrist",
        "wrist_2_link": "wrist",
        "wrist_3_link": "tool",
    }.get(link, str(link).replace("_", " "))
