"""Errors of the database and its disk."""

from app.errors import Conflict, ServiceError


class StaleAttempt(Conflict):
    """The refused write of a worker that no longer holds its job."""

    def __init__(self, job_id: str, attempt: int) -> None:
        super().__init__(
            f"attempt {attempt} no longer holds job {job_id}, which was cancelled, ended or "
            "started again: this write is refused"
        )
        self.job_id, self.attempt = job_id, attempt

    def problem(self) -> dict[str, object]:
        """Return the job and the attempt."""
        return {"job": self.job_id, "attempt": self.attempt}


class LeaseLost(Conflict):
    """The refused write of a server whose lease another server took.

    Args:
        database: URL of the database without password.
        owner: The server that holds the lease now.
    """

    def __init__(self, database: str, owner: str, epoch: int) -> None:
        super().__init__(
            f"this server no longer holds the lease of {database}, which {owner} took (epoch "
            f"{epoch}): this write is refused"
        )
        self.database, self.owner, self.epoch = database, owner, epoch

    def problem(self) -> dict[str, object]:
        """Return the database, the owner and its epoch."""
        return {"database": self.database, "owner": self.owner, "epoch": self.epoch}


class StorageUnavailable(ServiceError):
    """The database does not answer for now: locked for too long, unreachable, unreadable.

    Args:
        database: Its URL without password.
        reason: Its error.
    """

    def __init__(self, database: str, reason: str) -> None:
        super().__init__(f"{database} cannot be used for now: {reason}")
        self.database, self.reason = database, reason
        self.short = "database locked" if "locked" in reason else "database unavailable"
        """The reason in two words, for the state of the queue."""
        if "disk I/O" in reason:
            self.short = "disk error"

    def problem(self) -> dict[str, object]:
        """Return the database and the reason."""
        return {"database": self.database, "reason": self.reason}


class ServerUnreachable(StorageUnavailable):
    """The server does not answer a worker on another machine for now."""

    def __init__(self, address: str, reason: str) -> None:
        super().__init__(address, reason)
        self.short = "server unreachable"


class StorageDamaged(StorageUnavailable):
    """The file of the database is damaged, or is no database."""

    def __init__(self, database: str, reason: str) -> None:
        super().__init__(database, reason)
        self.message = (
            f"{database} is damaged or no database ({reason}): stop the server and restore a "
            "backup with 'python -m app restore FILE', which keeps the damaged file beside it"
        )
        self.args = (self.message,)
        self.short = "database damaged"


class StorageFull(ServiceError):
    """The database or the disk is full.

    Args:
        database: Its URL without password.
    """

    short = "disk full"
    """The reason in two words, for the state of the queue."""

    def __init__(self, database: str) -> None:
        super().__init__(
            f"no room left in {database} (database or disk is full): free some space or set "
            "TANDEM_DATA to a folder of a larger disk"
        )
        self.database = database

    def problem(self) -> dict[str, object]:
        """Return the database."""
        return {"database": self.database}
