"""Where an attempt runs: an executor of three methods. Here: one local process per attempt.

The child watches its parent itself (``jobs.worker.die_with_parent``), so a killed server
leaves no training behind.
"""

import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from app.store.records import Claim

PROJECT_ROOT = Path(__file__).resolve().parent.parent
"""Folder from which ``python -m jobs.run`` works."""

TAIL_BYTES = 4000
"""How much of a dead worker's last words is kept."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Exit:
    """How an attempt's process ended."""

    code: int
    """Exit status; negative: the signal that killed it."""
    tail: str
    """The end of what it wrote."""

    @property
    def reason(self) -> str:
        """The end, for people."""
        if self.code >= 0:
            ended = f"the worker ended with exit status {self.code} and no result"
        else:
            ended = f"the worker was killed by {_signal_name(-self.code)}"
        return f"{ended}\n{self.tail}".rstrip()


class Handle(Protocol):
    """One started attempt, as its executor knows it."""

    @property
    def claim(self) -> Claim:
        """The attempt."""


class Executor(Protocol):
    """Starts attempts and tells how they end."""

    def start(self, claim: Claim) -> Handle:
        """Start an attempt; returns at once."""

    def poll(self, handle: Handle) -> Exit | None:
        """Return how the attempt ended; None while it runs."""

    def stop(self, handle: Handle, *, force: bool) -> None:
        """Ask the attempt to end at its next step, or end it now; returns at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalHandle:
    """A child process."""

    claim: Claim
    """The attempt."""
    process: subprocess.Popen[bytes]
    """The process; never mistaken for another, since we have not reaped it."""
    log: Path
    """Where its output goes."""
    log_start: int
    """Length of the log before this attempt [bytes]."""


class LocalProcess:
    """Runs every attempt in a process of its own on this machine.

    Args:
        database_url: The database, for the child.
        data_dir: The data folder; output of job ``ID`` goes to ``logs/ID.log`` in it.
        command: How to start a worker, before its arguments.
    """

    def __init__(
        self,
        database_url: str,
        data_dir: Path,
        command: Sequence[str] = (sys.executable, "-m", "jobs.run"),
    ) -> None:
        self._command = tuple(command)
        self._logs = data_dir.absolute() / "logs"
        self._environment = {
            **os.environ,
            "TANDEM_DATA": str(data_dir.absolute()),
            "TANDEM_DATABASE_URL": database_url,
            "PYTHONPATH": search_path(os.environ),
            "PYTHONUNBUFFERED": "1",
            # One job trains on one core; it must not crowd out the server.
            "OMP_NUM_THREADS": "1",
            "MKL_NUM_THREADS": "1",
            "NUMBA_NUM_THREADS": "1",
        }

    def start(self, claim: Claim) -> LocalHandle:
        """Start a worker process for the attempt."""
        self._logs.mkdir(parents=True, exist_ok=True)
        log = self._logs / f"{claim.job_id}.log"
        attempt = ("--attempt", str(claim.attempt), "--parent", str(os.getpid()))
        with log.open("ab") as output:
            process = subprocess.Popen(
                (*self._command, "--job", claim.job_id, *attempt),
                cwd=PROJECT_ROOT,
                env=self._environment,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,  # Ctrl-C is for the server, which then asks politely
            )
            return LocalHandle(
                claim=claim,
                process=process,
                log=log,
                log_start=os.fstat(output.fileno()).st_size,
            )

    def poll(self, handle: Handle) -> Exit | None:
        """Return how the process ended; None while it runs."""
        assert isinstance(handle, LocalHandle)
        code = handle.process.poll()
        return None if code is None else Exit(code=code, tail=_tail(handle))

    def stop(self, handle: Handle, *, force: bool) -> None:
        """Send SIGTERM, or SIGKILL by force."""
        assert isinstance(handle, LocalHandle)
        if force:
            handle.process.kill()
        else:
            handle.process.terminate()


def _tail(handle: LocalHandle) -> str:
    with handle.log.open("rb") as log:
        end = log.seek(0, os.SEEK_END)
        log.seek(max(handle.log_start, end - TAIL_BYTES))
        return log.read().decode(errors="replace").strip()


def search_path(environment: Mapping[str, str]) -> str:
    """Return the ``PYTHONPATH`` by which a child finds this project."""
    earlier = environment.get("PYTHONPATH")
    return os.pathsep.join([str(PROJECT_ROOT), *([earlier] if earlier else [])])


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
