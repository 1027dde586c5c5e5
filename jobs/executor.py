"""Executor of attempts: one local process per attempt.

The child ends with its parent (``jobs.start``), so that a killed server leaves no training
behind. An attempt on a Ray cluster has a local process, too (``jobs.remote.ray_driver``).
"""

import os
import signal
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from app.store.records import Claim
from jobs.start import child_command

PROJECT_ROOT = Path(__file__).resolve().parent.parent
"""Working folder of child processes."""
NO_CPU = "no free CPU in the Ray cluster"
"""Reason for which a job waits that was started on a busy cluster."""
NO_CLUSTER = "no Ray cluster"
"""Reason for which a job waits whose cluster does not answer."""
TAIL_BYTES = 4000
"""Length of the end of a worker's output in an error [bytes]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Exit:
    """End of an attempt's process."""

    code: int
    """Exit status; negative: the signal that killed it."""
    tail: str
    """End of its output."""

    @property
    def reason(self) -> str:
        """The end as text."""
        if self.code >= 0:
            ended = f"the worker ended with exit status {self.code} and no result"
        else:
            ended = f"the worker was killed by {_signal_name(-self.code)}"
        return f"{ended}\n{self.tail}".rstrip()


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalHandle:
    """The child process of an attempt."""

    process: subprocess.Popen[bytes]
    """The process; its id is not reused before it is reaped here."""
    log: Path
    """File of its output."""
    log_start: int
    """Length of the log before this attempt [bytes]."""


class LocalExecutor:
    """Runs every attempt in its own process on this machine.

    Args:
        database_url: The database, for the child; None: it has no access.
        data_dir: The data folder; output of job ``ID`` goes to ``logs/ID.log`` in it.
        module: Module of a worker, which takes ``--job`` and ``--attempt``.
        settings: Further settings of the child, by variable.
    """

    def __init__(
        self,
        database_url: str | None,
        data_dir: Path,
        module: str = "jobs.run",
        settings: Mapping[str, str] | None = None,
    ) -> None:
        self._module = module
        self._logs = data_dir.absolute() / "logs"
        self._environment = {
            **os.environ,
            "TANDEM_DATA": str(data_dir.absolute()),
            "PYTHONPATH": search_path(),
            "PYTHONUNBUFFERED": "1",
            # One job trains on one core and leaves the others to the server.
            "OMP_NUM_THREADS": "1",
            "MKL_NUM_THREADS": "1",
            "NUMBA_NUM_THREADS": "1",
            **(settings or {}),
        }
        self._environment.pop("TANDEM_DATABASE_URL", None)
        self._environment.pop("TANDEM_TOKEN_FILE", None)  # a worker over HTTP has the token
        if database_url is not None:
            self._environment["TANDEM_DATABASE_URL"] = database_url

    def start(self, claim: Claim) -> LocalHandle:
        """Start a worker process for the attempt; returns at once."""
        self._logs.mkdir(parents=True, exist_ok=True)
        log = self._logs / f"{claim.job_id}.log"
        attempt = ("--job", claim.job_id, "--attempt", str(claim.attempt))
        with log.open("ab") as output:
            process = subprocess.Popen(
                child_command(self._module, *attempt),
                cwd=PROJECT_ROOT,
                env=self._environment,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,  # Ctrl-C goes to the server, which stops its workers
            )
            log_start = os.fstat(output.fileno()).st_size
        return LocalHandle(process=process, log=log, log_start=log_start)

    def poll(self, handle: LocalHandle) -> Exit | None:
        """Return the end of the process; None while it runs."""
        code = handle.process.poll()
        if code is None:
            return None
        return Exit(
            code=code, tail=end_of_log(handle.log, TAIL_BYTES, handle.log_start).strip()
        )

    def stop(self, handle: LocalHandle, *, force: bool) -> None:
        """Send SIGTERM, after which a worker stops at its next step, or SIGKILL by force."""
        if force:
            handle.process.kill()
        else:
            handle.process.terminate()


def end_of_log(log: Path, n_bytes: int, start: int = 0) -> str:
    """Return the end of a log as text; empty where there is none, as once a job was deleted.

    Args:
        n_bytes: Largest length [bytes].
        start: Place in the log before which nothing is read [bytes].
    """
    try:
        with log.open("rb") as file:
            end = file.seek(0, os.SEEK_END)
            file.seek(max(start, end - n_bytes))
            return file.read(n_bytes).decode(errors="replace")
    except FileNotFoundError:
        return ""


def search_path() -> str:
    """Return the ``PYTHONPATH`` of a child process."""
    earlier = os.environ.get("PYTHONPATH")
    return os.pathsep.join([str(PROJECT_ROOT), *([earlier] if earlier else [])])


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
