"""Lease: the right of one server to run the jobs of a database.

A row has the owner, the epoch and the time of expiry. The owner renews it; each new owner
raises the epoch. Every write of a supervisor checks its ownership in the same transaction
(:meth:`Lease.require`), so that a server that was paused beyond its lease changes nothing. The
row survives restarts of the database and of the server.

Source: Gray and Cheriton (1989), Leases; the epoch is a fencing token.
"""

import os
import socket
import time
import uuid
from datetime import UTC, datetime, timedelta

import sqlalchemy as sa

from app.errors import Conflict
from app.storage_errors import LeaseLost
from app.store.database.lock import ServerLock
from app.store.database.tables import leases
from app.store.engine import Store

LEASE_S = 30.0
"""Time from a renewal until another server may take the lease [s]."""

_JOBS = "jobs"
"""Name of the lease."""


class Lease:
    """The lease of one server.

    Args:
        lock: The server's lock, held while the lease is. A lease of an earlier server with the
            same lock is taken at once, since that server has ended.
        duration_s: Time from a renewal until another server may take the lease [s].
    """

    def __init__(self, store: Store, lock: ServerLock, duration_s: float = LEASE_S) -> None:
        self._store = store
        self._lock = lock
        self._duration_s = duration_s
        self._token = str(uuid.uuid4())
        self._taken = False
        self._renewed_at = 0.0

    def check(self) -> None:
        """Check that no other server holds the lease; writes nothing.

        Raises:
            Conflict: Another server holds it.
        """
        with self._store.reading() as connection:
            self.refuse_if_held(connection)

    def refuse_if_held(self, connection: sa.Connection) -> None:
        """Check inside a transaction that no other server holds the lease.

        Raises:
            Conflict: Another server holds it.
        """
        if not sa.inspect(connection).has_table(leases.name):
            return  # no tables yet, or those of an earlier version
        row = connection.execute(sa.select(leases).where(leases.c.name == _JOBS)).first()
        if row is None or row.place == self._lock.place:
            return
        now = self._store.now(connection)
        if row.expires_at > now:
            raise Conflict(
                f"another Tandem server ({row.owner}) holds the lease of "
                f"{self._store.shown_url} until {_clock(row.expires_at)} and renews it while "
                f"it runs (it is {_clock(now)} now): stop that server, or wait until then"
            )

    def take(self, connection: sa.Connection) -> None:
        """Take the lease inside a transaction.

        Raises:
            Conflict: Another server holds it.
        """
        self.refuse_if_held(connection)
        mine = leases.c.name == _JOBS
        epoch = connection.execute(sa.select(leases.c.epoch).where(mine)).scalar() or 0
        now = self._store.now(connection)
        values = {
            "name": _JOBS,
            "owner": f"process {os.getpid()} on {socket.gethostname()}",
            "place": self._lock.place,
            "token": self._token,
            "epoch": epoch + 1,
            "expires_at": now + timedelta(seconds=self._duration_s),
        }
        connection.execute(sa.delete(leases).where(mine))
        connection.execute(sa.insert(leases).values(values))
        self._taken = True
        self._renewed_at = time.monotonic()

    def require(self, connection: sa.Connection) -> None:
        """Check inside a writing transaction that this server holds the lease.

        An expired lease that no other server took is still held.

        Raises:
            LeaseLost: Another server took it.
        """
        row = connection.execute(sa.select(leases).where(leases.c.name == _JOBS)).first()
        if row is None or row.token != self._token:
            owner = "no server" if row is None else row.owner
            raise LeaseLost(self._store.shown_url, owner, 0 if row is None else row.epoch)

    def renew(self) -> None:
        """Extend the lease, if a sixth of its duration has passed.

        A SQLite file has the lock of the kernel, and its lease no expiry.

        Raises:
            LeaseLost: Another server took it.
        """
        due = time.monotonic() - self._renewed_at >= self._duration_s / 6
        if not due or self._store.sqlite_path is not None:
            return
        with self._store.writing() as connection:
            self.require(connection)
            self._expire_in(connection, self._duration_s)
        self._renewed_at = time.monotonic()

    def release(self) -> None:
        """End the lease, if it is held, so that another server may take it at once."""
        if self._taken:
            with self._store.writing() as connection:
                self._expire_in(connection, 0.0)

    def _expire_in(self, connection: sa.Connection, duration_s: float) -> None:
        expires_at = self._store.now(connection) + timedelta(seconds=duration_s)
        held = sa.and_(leases.c.name == _JOBS, leases.c.token == self._token)
        connection.execute(sa.update(leases).where(held).values(expires_at=expires_at))


def _clock(time: datetime) -> str:
    return time.astimezone(UTC).strftime("%H:%M:%S UTC")
