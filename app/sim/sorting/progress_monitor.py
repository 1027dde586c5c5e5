"""Loop and stall monitor of a sorting policy: when the exact planner takes over.

A greedy policy can repeat a cycle of moves. The monitor of one task stores the visited states
and the expected effect of the last move; the next state is then classified:

| next state | meaning | effect |
|---|---|---|
| the expected one | the move succeeded | a state visited before triggers the fallback |
| unchanged, the pick can fail | failed pick | continues |
| unchanged, the pick cannot fail | repeated state | triggers the fallback |
| any other | a person interfered, or another object moved | restarts the monitor |

A state includes its goal and failure map, so that a change of these restarts the monitor too.
The fallback also triggers after :data:`ATTEMPT_FACTOR` times the expected attempts. The planner
then decides until the goal is reached or the monitor restarts. The monitor is plain data: a
client receives it with a decision and returns it with the next request.

Source: ours (the method has no such rule); expected attempts are those of the exact planner.
"""

import hashlib
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from app.sim.sorting.state import SortingState

ATTEMPT_FACTOR = 1.5
"""Attempts granted to a policy, as a multiple of the expected ones."""
MAX_SEEN = 256
"""Largest number of stored states; a further one triggers the fallback."""
KEY_BYTES = 8
"""Length of a state's key; its text has twice as many characters."""

FallbackReason = Literal["repeated", "attempts-exceeded"]
"""Reason of the planner fallback: a repeated state, or too many attempts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgressMonitor:
    """Transitions of one task since its start or the last interference."""

    checkpoint: str
    """SHA-256 of the monitored policy."""
    last: str
    """Key of the last decision's state."""
    expected: str
    """Key of the state that the move chosen there leads to; empty before the choice."""
    can_fail: bool
    """Whether that move's pick can fail."""
    seen: tuple[str, ...]
    """Keys of the visited states, each once, at most :data:`MAX_SEEN`."""
    attempts: int
    """Attempts since the start or, after a fallback, since then."""
    budget: float
    """Number of attempts that triggers the fallback."""
    planner_fallback: FallbackReason | None
    """Reason of the fallback; None while the policy decides."""


def state_key(state: SortingState) -> str:
    """Return a hexadecimal hash of a state with its goal and failure map."""
    digest = hashlib.blake2b(digest_size=KEY_BYTES)
    digest.update(bytes(state.towers.shape))
    for codes in (state.clutter, state.towers, state.goal):
        digest.update(np.ascontiguousarray(codes, dtype=np.int8).tobytes())
    digest.update(np.ascontiguousarray(state.fail, dtype=np.float64).tobytes())
    return digest.hexdigest()


def begin_monitor(key: str, expected_attempts: float, checkpoint: str) -> ProgressMonitor:
    """Return the monitor of a task that starts now; arguments as :func:`observe_transition`."""
    return ProgressMonitor(
        checkpoint=checkpoint,
        last=key,
        expected="",
        can_fail=False,
        seen=(key,),
        attempts=0,
        budget=ATTEMPT_FACTOR * expected_attempts,
        planner_fallback=None,
    )


def observe_transition(
    monitor: ProgressMonitor | None, key: str, expected_attempts: float, checkpoint: str
) -> ProgressMonitor:
    """Return the monitor updated with the present state.

    Args:
        monitor: Result of :func:`expect_state` at the last decision; None at the first.
        key: Key of the present state.
        expected_attempts: Expected attempts of the exact planner from here.
        checkpoint: SHA-256 of the policy.
    """
    if monitor is None or monitor.checkpoint != checkpoint:
        return begin_monitor(key, expected_attempts, checkpoint)
    moved = key == monitor.expected
    if not moved and key != monitor.last:
        return begin_monitor(key, expected_attempts, checkpoint)
    now = replace(monitor, last=key, attempts=monitor.attempts + 1)
    if now.planner_fallback is not None:
        return now
    repeated = key in monitor.seen if moved else not monitor.can_fail
    if repeated:
        return _fall_back(now, "repeated")
    if now.attempts >= now.budget or len(now.seen) >= MAX_SEEN:
        return _fall_back(now, "attempts-exceeded")
    return replace(now, seen=(*now.seen, key)) if moved else now


def expect_state(monitor: ProgressMonitor, expected: str, *, can_fail: bool) -> ProgressMonitor:
    """Return the monitor with the chosen move's next state, by its key, and if it can fail."""
    return replace(monitor, expected=expected, can_fail=can_fail)


def _fall_back(monitor: ProgressMonitor, reason: FallbackReason) -> ProgressMonitor:
    return replace(monitor, planner_fallback=reason, attempts=0, seen=())
