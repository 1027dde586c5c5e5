"""Status messages of a live pick cell, one sentence each."""

from app.live.status_messages import Label, value_text
from app.sim.pick.case_verdict import Verdict
from app.sim.pick.kernels.grasp import LIFT
from app.sim.pick.task_policy import Decision, PickProgress


def target_switch(
    decision: Decision, names: tuple[str, ...], before: str, t_s: float, label: Label
) -> str:
    """Return the message on a target switch: time and both values."""
    old = decision.values[names.index(before)]
    new = decision.values[decision.index]
    return (
        f"Switched to {label(decision.chosen)} at {t_s:.1f} s "
        f"(Q {value_text(new)} vs {value_text(old)} for {label(before)})."
    )


def target_choice(decision: Decision, names: tuple[str, ...], label: Label) -> str:
    """Return the target with its value and the next best."""
    own = value_text(decision.values[decision.index])
    text = f"Moving to {label(decision.chosen)} (Q {own})"
    others = [i for i in range(len(names)) if i != decision.index]
    if not others:
        return text + "."
    second = max(others, key=lambda i: decision.values[i])
    return f"{text}; next: {label(names[second])} ({value_text(decision.values[second])})."


def pick_phase(decision: Decision, progress: PickProgress, label: Label) -> str:
    """Return the station of the pick and its phase."""
    if progress.phase == LIFT:
        return f"At {label(decision.chosen)}: lifting."
    done = "closing the gripper" if progress.closing_s > 0.0 else "descending"
    return f"At {label(decision.chosen)}: {done}."


def case_outcome(verdict: Verdict, goal: str | None, label: Label) -> str:
    """Return how a case study ended, and the verdict on the whole run."""
    agrees = "as expected" if verdict.as_expected else "not as expected"
    if goal is None:
        return f"Timed out: {agrees}."
    return f"The scenario ended at {label(goal)}: {agrees}."
