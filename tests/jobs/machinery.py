"""Queue counting jobs, wait for what they reach, check what they left."""

import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from app.store import checkpoints, jobs, metrics
from app.store.database.lease import LEASE_S
from app.store.engine import Store
from app.store.records import JobRecord, NewJob
from jobs.executor import PROJECT_ROOT
from jobs.supervisor import Supervisor
from jobs.timeouts import Timeouts
from tests.jobs.counting_worker import CHECKPOINT_EVERY, FACTOR, GRID, MODULUS
from tests.support import waiting

PATIENCE = Timeouts(tick_s=0.1, cancel_s=1.0, shutdown_s=5.0)
WAIT_S = 600.0
"""Far above what anything takes, compiling kernels included; only a hang reaches it."""
wait_until = partial(waiting.wait_until, within_s=WAIT_S)


def queue(
    store: Store,
    *,
    seed: int = 0,
    kind: str = "count",
    budgets: Mapping[str, Any] | None = None,
    **overrides: object,
) -> str:
    spec = {"kind": kind, "seed": seed, "overrides": overrides}
    new = NewJob(kind=kind, seed=seed, overrides=overrides, spec=spec, **(budgets or {}))
    return jobs.create_job(store, new).id


def wait_for(store: Store, job_id: str, reached: Callable[[JobRecord], bool]) -> JobRecord:
    def reached_or_final(job: JobRecord) -> bool:
        found = reached(job)
        assert found or not job.is_final, f"ended without getting there: {job}"
        return found

    return wait_until(lambda: jobs.get_job(store, job_id), reached_or_final)


def wait_until_final(store: Store, job_id: str) -> JobRecord:
    return wait_for(store, job_id, lambda job: job.is_final)


def assert_counted_once(store: Store, job_id: str, *, steps: int, seed: int = 0) -> None:
    """Every point and checkpoint of the grid is there exactly once, with the right value."""
    value, expected = 1 + seed, {}
    for step in range(1, steps + 1):
        value = value * FACTOR % MODULUS
        expected[step] = value
    curve = {row.step: row.values["value"] for row in metrics.list_metrics(store, job_id)}
    assert list(curve) == list(range(GRID, steps + 1, GRID))
    assert all(expected[step] == found for step, found in curve.items())
    made = checkpoints.list_checkpoints(store, job_id=job_id, limit=200).items
    assert [c.step for c in reversed(made)] == list(
        range(CHECKPOINT_EVERY, steps + 1, CHECKPOINT_EVERY)
    )
    assert jobs.get_job(store, job_id).result == {"value": value}


def is_running(pid: int) -> bool:
    """Whether a process has not ended; its parent may take seconds to read its exit status."""
    return process_state(pid) not in ("", "Z", "X")


def process_state(pid: int) -> str:
    """Return the state of a process by /proc, such as T for stopped; empty: there is none."""
    return _stat(pid)[0]


def _stat(pid: int) -> list[str]:
    """Return the fields of a process that follow its name in /proc: state, parent, others."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return ["", "0"]


def worker_pids(parent: int) -> list[int]:
    """The workers that are children of a process, by /proc."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        pid = int(folder.name)
        if int(_stat(pid)[1]) == parent and is_running(pid) and _is_worker(folder):
            found.append(pid)
    return found


def _is_worker(folder: Path) -> bool:
    try:
        return b"--job" in (folder / "cmdline").read_bytes()
    except OSError:
        return False


@contextmanager
def supervised(
    store: Store, folder: Path, *, timeouts: Timeouts = PATIENCE, **options: Any
) -> Iterator[Supervisor]:
    """Run a supervisor in this process until the end of the block."""
    supervisor = Supervisor(store, folder, timeouts=timeouts, **options)
    supervisor.start()
    try:
        yield supervisor
    finally:
        supervisor.stop()


@contextmanager
def supervisor_process(
    store: Store, data_dir: Path, lease_s: float = LEASE_S
) -> Iterator["subprocess.Popen[bytes]"]:
    """Run a supervisor in a process of its own; killed at the end."""
    arguments = [store.url, str(data_dir), str(lease_s)]
    command = [sys.executable, "-m", "tests.jobs.supervisor_process", *arguments]
    with subprocess.Popen(command, cwd=PROJECT_ROOT, stdout=subprocess.PIPE) as process:
        try:
            assert process.stdout is not None and process.stdout.readline() == b"ready\n"
            yield process
        finally:
            process.kill()
