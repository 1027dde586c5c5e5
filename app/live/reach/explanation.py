"""Status messages of a live reach cell, one sentence each."""

from app.live.reach.snapshot import ReachSnapshot
from app.live.safety.explanation import slowed
from app.live.safety.snapshot import SafetySnapshot
from app.live.snapshot import Status
from app.live.status_messages import length_text

NO_POLICY = "No reach policy is active: moving straight to the goal without avoiding people"


def motion(
    status: Status,
    view: ReachSnapshot,
    safety: SafetySnapshot,
    *,
    has_policy: bool,
    n_people: int,
) -> str:
    """Return the status message."""
    if status == "blocked":
        return "Waiting at home: a person stands at the start position."
    if status == "reached":
        then = "drag it to continue" if view.goal_mode == "follow" else "the next one follows"
        return f"Goal reached: {then}."
    if (reason := slowed(safety, n_people)) is not None:
        return reason
    left = f"{length_text(view.distance)} to go"
    return f"Moving to the goal, {left}." if has_policy else f"{NO_POLICY}, {left}."
