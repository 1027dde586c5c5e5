"""Status messages common to the live worlds, one sentence each, and their numbers as text."""

import math
from collections.abc import Callable

from app.live.snapshot import ContactSnapshot, Status

Label = Callable[[str], str]
"""Maps a station id to its name for people."""
_MINUS = "\N{MINUS SIGN}"

_TOUCHED = {
    "pelvis": "the person's hips",
    "abdomen": "the person's waist",
    "chest": "the person's chest",
    "head": "the person's head",
    "upper_arm_r": "the right upper arm",
    "upper_arm_l": "the left upper arm",
    "forearm_r": "the right forearm",
    "forearm_l": "the left forearm",
    "hand_r": "the right hand",
    "hand_l": "the left hand",
    "leg_r": "the right leg",
    "leg_l": "the left leg",
    "walker": "the person",
    "table": "the table",
    "obstacle": "an obstacle",
}


def contact_message(contact: ContactSnapshot, *, final: bool) -> str:
    """Return the message on a contact; ``final`` if it ends a case study."""
    link, body = contact.link.replace("_", " "), _TOUCHED.get(contact.body, contact.body)
    if contact.kind == "self":
        body = f"the robot's {contact.body.replace('_', ' ')}"
    then = "The scenario ended." if final else "The robot starts again from home."
    return f"Contact: {link} touched {body}. {then}"


def standstill_message(status: Status) -> str:
    """Return why the robot does not move."""
    return {
        "blocked": "Waiting at home: a person blocks the robot.",
        "no candidates": "Nothing to do: click a cube or a dock to select it.",
        "no policy": "Resting: no policy is active. Choose a checkpoint, or train one here.",
    }.get(status, "")


def value_text(value: float, digits: int = 2) -> str:
    """Return a value with fixed decimals and a true minus sign, as ``value`` in format.js."""
    return f"{value:z.{digits}f}".replace("-", _MINUS)


def length_text(metres: float) -> str:
    """Return a length in metres, in millimetres below 1 cm.

    The page has the same rule: ``length`` in web/page/format.js.

    Args:
        metres: The length [m], not negative.
    """
    mm = math.floor(1000.0 * metres + 0.5)
    if mm >= 10:
        return f"{metres:.2f} m"
    if mm > 0:
        return f"{mm} mm"
    return "0 m" if metres == 0.0 else "< 1 mm"


def percent_text(share: float) -> str:
    """Return a share in [0, 1] in whole percent."""
    return f"{100.0 * share:.0f} %"
