"""Says in one sentence what a live robot does and why."""

from collections.abc import Callable

from app.live.snapshot import ContactView, Status
from app.sim.pick.case_verdict import Verdict
from app.sim.pick.task_policy import Decision

Label = Callable[[str], str]
"""Maps a station id to its name for people."""

_BODIES = {
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
    """Return why the choice changed: when, and both values of that moment side by side."""
    old = decision.values[names.index(before)]
    new = decision.values[decision.index]
    return (
        f"Changed its mind at {t_s:.1f} s: {label(decision.chosen)} was worth {new:.2f} then, "
        f"{label(before)} {old:.2f}."
    )


def going(decision: Decision, names: tuple[str, ...], label: Label) -> str:
    """Return where the robot goes, and the value of the next best."""
    text = f"Going to {label(decision.chosen)}, worth {decision.values[decision.index]:.2f}"
    others = [i for i in range(len(names)) if i != decision.index]
    if not others:
        return text + "."
    second = max(others, key=lambda i: decision.values[i])
    return f"{text}; next is {label(names[second])} at {decision.values[second]:.2f}."


def touched(contact: ContactView, *, final: bool) -> str:
    """Return what touched what; ``final`` where it ends a case study."""
    link = contact.link.replace("_", " ")
    body = _BODIES.get(contact.body, contact.body)
    then = "The case ended." if final else "The robot starts again from home."
    return f"Contact: {link} touched {body}. {then}"


def case_ended(verdict: Verdict, goal: str | None, label: Label) -> str:
    """Return where a case study ended, and the verdict on the whole run."""
    agrees = "as expected" if verdict.as_expected else "not as expected"
    if goal is None:
        return f"Time is up in this case: {agrees}."
    return f"The case ended at {label(goal)}: {agrees}."


def resting(status: Status, goal: str | None, label: Label) -> str:
    """Return why the robot does not go anywhere.

    Args:
        status: What the robot is doing.
        goal: Station it is at, if any.
        label: Names of stations.
    """
    return {
        "picking": f"Reached {label(goal)}." if goal else "Reached.",
        "blocked": "Waiting at home: a person is in the robot's way.",
        "no candidates": "Nothing to do: click a cube or a dock to offer it.",
        "no policy": "Resting: no checkpoint acts here. Choose one, or train one in this cell.",
    }.get(status, "")
