"""When the exact planner takes over from a policy: a record of one task, as plain data.

A greedy policy may go in circles. The record holds the states it decided in and what each move
was meant to give; the next state then tells what happened:

| next state | what happened | record |
|---|---|---|
| what the move gives | it worked | goes on; a state met before hands over |
| as before, the pick can fail | a failed pick | goes on |
| as before, the pick cannot fail | a repeated state | hands over |
| any other | a person, or another object moved than meant | begins anew |

States are compared with their goal and failure map: a change of these is a person's, too. The
planner also takes over after :data:`PATIENCE` times the expected attempts. It then decides
until the goal is reached or the record begins anew. The record is small and travels in JSON:
who asks gets it with the answer and hands it back with the next question.

Source: ours (the method has no such rule); expected attempts are the exact planner's.
"""

import dataclasses
import hashlib
from dataclasses import dataclass
from typing import Literal

import numpy as np

from app.sim.sorting.state import SortingState

PATIENCE = 1.5
"""Attempts granted to a policy, as a multiple of the expected ones."""
MAX_SEEN = 256
"""Most states a record holds; a policy that meets more hands over."""
KEY_BYTES = 8
"""Length of a state's key; its text has twice as many characters."""

HandOver = Literal["repeated", "patience"]
"""Why the planner took over: a repeated state, or too many attempts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgressMonitor:
    """The record of one task since it began, or since somebody interfered."""

    checkpoint: str
    """SHA-256 of the policy that is watched."""
    last: str
    """Key of the state decided in last."""
    expected: str
    """Key of the state that the move chosen there gives; empty until it is chosen."""
    can_fail: bool
    """Whether that move's pick can fail."""
    seen: tuple[str, ...]
    """Keys of the states met, each once, at most :data:`MAX_SEEN`."""
    attempts: int
    """Moves tried since the record began or, after a hand-over, since then."""
    budget: float
    """Attempts after which the planner takes over."""
    planner_fallback: HandOver | None
    """Why the planner decides; None while the policy does."""


def state_key(state: SortingState) -> str:
    """Return a short name of a state with its goal and failure map, hexadecimal."""
    digest = hashlib.blake2b(digest_size=KEY_BYTES)
    digest.update(bytes(state.towers.shape))
    for codes in (state.clutter, state.towers, state.goal):
        digest.update(np.ascontiguousarray(codes, dtype=np.int8).tobytes())
    digest.update(np.ascontiguousarray(state.fail, dtype=np.float64).tobytes())
    return digest.hexdigest()


def begin_monitor(key: str, expected_attempts: float, checkpoint: str) -> ProgressMonitor:
    """Return the record of a task that begins now.

    Args:
        key: Of its state.
        expected_attempts: Attempts that the exact planner expects from here.
        checkpoint: SHA-256 of the policy that decides.
    """
    return ProgressMonitor(
        checkpoint=checkpoint,
        last=key,
        expected="",
        can_fail=False,
        seen=(key,),
        attempts=0,
        budget=PATIENCE * expected_attempts,
        planner_fallback=None,
    )


def look(
    watch: ProgressMonitor | None, key: str, expected_attempts: float, checkpoint: str
) -> ProgressMonitor:
    """Return the record after a look at the present state.

    Args:
        watch: As :func:`note_move` left it; None where there is none yet.
        key: Of the present state.
        expected_attempts: Attempts that the exact planner expects from here.
        checkpoint: SHA-256 of the policy that would decide.
    """
    if watch is None or watch.checkpoint != checkpoint:
        return begin_monitor(key, expected_attempts, checkpoint)
    moved = key == watch.expected
    if not moved and key != watch.last:
        return begin_monitor(key, expected_attempts, checkpoint)
    now = dataclasses.replace(watch, last=key, attempts=watch.attempts + 1)
    if now.planner_fallback is not None:
        return now
    repeated = key in watch.seen if moved else not watch.can_fail
    if repeated:
        return _hand_over(now, "repeated")
    if now.attempts >= now.budget or len(now.seen) >= MAX_SEEN:
        return _hand_over(now, "patience")
    return dataclasses.replace(now, seen=(*now.seen, key)) if moved else now


def note_move(watch: ProgressMonitor, expected: str, *, can_fail: bool) -> ProgressMonitor:
    """Return the record with the move that was chosen.

    Args:
        watch: As :func:`look` gave it.
        expected: Key of the state that the move gives.
        can_fail: Whether its pick can fail.
    """
    return dataclasses.replace(watch, expected=expected, can_fail=can_fail)


def _hand_over(watch: ProgressMonitor, why: HandOver) -> ProgressMonitor:
    return dataclasses.replace(watch, planner_fallback=why, attempts=0, seen=())
