"""Timeouts of the supervisor."""

from dataclasses import dataclass

from app.store.database.lease import LEASE_S


@dataclass(frozen=True, slots=True, kw_only=True)
class Timeouts:
    """How long the supervisor waits, and how often it tries."""

    tick_s: float = 0.25
    """Period of the supervisor [s]."""
    cancel_s: float = 30.0
    """Time from a cancel until the worker is killed [s]."""
    silence_s: float = 300.0
    """Time without a heartbeat until a worker is killed [s]."""
    lease_s: float = LEASE_S
    """Time from a renewal of the lease until another server may take it [s]."""
    shutdown_s: float = 8.0
    """Time for the workers' last checkpoints when the server stops [s]."""
    late_s: float = 15.0
    """Time without a heartbeat until the database is checked for a lock [s]."""
    lock_s: float = 30.0
    """Time for the heartbeat of a silent worker once the database takes writes again [s]."""
    retry_s: float = 5.0
    """Time until the next start after a worker that could not start or write, or was
    terminated [s]."""
    retain_s: float = 60.0
    """Time until old jobs are removed after one that ended without a worker [s]."""
    max_failures: int = 3
    """A job fails with this number of crashes."""
