"""Points of the learning curve of a training, and its result."""

from dataclasses import dataclass

from app.policies.checkpoints.checkpoint import Checkpoint


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """One point of the learning curve: episodes without exploration.

    Pick trainings count the episodes of environments without exploration since the last point,
    or run episodes for this point alone if the preset has ``progress_episodes``; the other
    scenarios always run some.
    """

    step: int
    """Environment steps so far."""
    total_steps: int
    """Environment steps of the whole training."""
    updates: int
    """Updates of the critics so far."""
    episodes: int
    """Episodes behind the rates."""
    success: float | None
    """Share of them that succeeded; None where none ended."""
    collision: float | None
    """Share of them that collided."""
    timeout: float | None
    """Share of them that ran out of time."""
    reward: float | None
    """Mean undiscounted return of them."""
    updates_per_s: float
    """Updates per second of wall time in the window."""
    steps_per_s: float
    """Environment steps per second of wall time in the window."""
    cpu_s: float
    """CPU time so far [s], that of interrupted attempts up to their checkpoint included."""
    time_left_s: float | None
    """Estimated wall time to the end [s]; None while no updates run, which cost most of it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainResult:
    """Result of a training."""

    checkpoint: Checkpoint
    """The policy at the end."""
    step: int
    """Environment steps done."""
    stopped: bool
    """Whether it was asked to stop before its end."""
