"""Status messages of a live pick cell, one sentence each."""

from collections.abc import Callable

from app.live.snapshot import ContactSnapshot, Status
from app.sim.pick.case_verdict import Verdict
from app.sim.pick.task_policy import Decision

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


def switched(
    decision: Decision, names: tuple[str, ...], before: str, t_s: float, label: Label
) -> str:
    """Return the message on a target switch: time and both values."""
    old = decision.values[names.index(before)]
    new = decision.values[decision.index]
    return (
        f"Switched to {label(decision.chosen)} at {t_s:.1f} s "
        f"(Q {new:.2f} vs {old:.2f} for {label(before)})."
    )


def going(decision: Decision, names: tuple[str, ...], label: Label) -> str:
    """Return the target with its value and the next best."""
    text = f"Moving to {label(decision.chosen)} (Q {decision.values[decision.index]:.2f})"
    others = [i for i in range(len(names)) if i != decision.index]
    if not others:
        return text + "."
    second = max(others, key=lambda i: decision.values[i])
    return f"{text}; next: {label(names[second])} ({decision.values[second]:.2f})."


def touched(contact: ContactSnapshot, *, final: bool) -> str:
    """Return the message on a contact; ``final`` if it ends a case study."""
    link = contact.link.replace("_", " ")
    body = _TOUCHED.get(contact.body, contact.body)
    then = "The scenario ended." if final else "The robot starts again from home."
    return f"Contact: {link} touched {body}. {then}"


def case_ended(verdict: Verdict, goal: str | None, label: Label) -> str:
    """Return how a case study ended, and the verdict on the whole run."""
    agrees = "as expected" if verdict.as_expected else "not as expected"
    if goal is None:
        return f"Timed out: {agrees}."
    return f"The scenario ended at {label(goal)}: {agrees}."


def resting(status: Status, goal: str | None, label: Label) -> str:
    """Return why the robot does not move.

    Args:
        status: Status of the robot.
        goal: Station the robot is at, if any.
        label: Names of stations.
    """
    return {
        "picking": f"Reached {label(goal)}." if goal else "Reached.",
        "blocked": "Waiting at home: a person blocks the robot.",
        "no candidates": "Nothing to do: click a cube or a dock to select it.",
        "no policy": "Resting: no policy is active. Choose a checkpoint, or train one here.",
    }.get(status, "")
