"""Why the safety layer reduces the speed, in one sentence."""

from app.live.safety.snapshot import SafetySnapshot
from app.live.status_messages import length_text, percent_text

FULL = 0.995
"""Override from which a message does not mention it."""
_LINKS = {
    "base_link": "base",
    "shoulder_link": "shoulder",
    "upper_arm_link": "upper arm",
    "forearm_link": "forearm",
    "wrist_1_link": "wrist",
    "wrist_2_link": "wrist",
    "wrist_3_link": "tool",
}


def slowed(safety: SafetySnapshot, n_people: int) -> str | None:
    """Return why the safety layer reduces the speed; None if it does not."""
    if not safety.on or safety.override >= FULL or safety.separation is None:
        return None
    verb = "Stopped" if safety.override <= 0.0 else f"Slowed to {percent_text(safety.override)}"
    person = "the person" if n_people < 2 else f"person {(safety.person or 0) + 1}"
    gap, need, link = safety.separation, safety.required or 0.0, link_name(safety.link)
    if gap <= 0.0:
        return f"{verb}: {person} touches the {link}; the robot stands still."
    place = f"{person} is {length_text(gap)} from the {link}"
    if gap < need:
        return f"{verb}: {place}, {length_text(need)} required."
    return f"{verb}: {place}, and could come too near along the planned motion."


def link_name(link: str | None) -> str:
    """Return a link's name for people."""
    return "robot" if link is None else _LINKS.get(link, link.replace("_", " "))
