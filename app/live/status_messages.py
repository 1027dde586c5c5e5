"""Status messages common to the live worlds, one sentence each."""

from collections.abc import Callable

from app.live.snapshot import ContactSnapshot, Status

Label = Callable[[str], str]
"""Maps a station id to its name for people."""

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
    "robot": "another part of the robot",
}


def contact_message(contact: ContactSnapshot, *, final: bool) -> str:
    """Return the message on a contact; ``final`` if it ends a case study."""
    link = contact.link.replace("_", " ")
    body = _TOUCHED.get(contact.body, contact.body)
    then = "The scenario ended." if final else "The robot starts again from home."
    return f"Contact: {link} touched {body}. {then}"


def standstill_message(status: Status, goal: str | None, label: Label) -> str:
    """Return why the robot does not move.

    Args:
        goal: Station the robot is at, if any.
        label: Names of stations.
    """
    return {
        "picking": f"Reached {label(goal)}." if goal else "Reached.",
        "blocked": "Waiting at home: a person blocks the robot.",
        "no candidates": "Nothing to do: click a cube or a dock to select it.",
        "no policy": "Resting: no policy is active. Choose a checkpoint, or train one here.",
    }.get(status, "")
