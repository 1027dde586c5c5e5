"""Jobs on a Ray cluster of two nodes: with the bits of local ones, whatever is killed.

The tests share the cluster, and need fewer of its nodes from one to the next.
"""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from app.store import attempts, jobs, metrics
from app.store.engine import Store
from jobs.executor import PROJECT_ROOT, LocalExecutor, search_path
from jobs.supervisor import Supervisor
from tests.jobs.machinery import PATIENCE, supervised, wait_for, wait_until, wait_until_final
from tests.jobs.remote.serving import TOKEN
from tests.support.databases import SQLITE_ONLY
from tests.support.trainings import made_by, run_here, train

pytestmark = [pytest.mark.ray, SQLITE_ONLY]
FIELDS: dict[str, float | str] = {
    "learning.total_steps": 1024,
    "learning.checkpoint_steps": 256,
}
PATIENCE_OF_RAY = replace(PATIENCE, cancel_s=60.0, shutdown_s=60.0)
STEPS = list(range(128, 1025, 128))


@dataclass
class RayCluster:
    """A cluster in a process of its own."""

    process: "subprocess.Popen[str]"
    n_nodes: int
    address: str

    def keep(self, n_nodes: int) -> None:
        """Remove nodes, as if their machines had failed, until so many are left."""
        assert n_nodes <= self.n_nodes and self.process.stdin is not None
        for _ in range(self.n_nodes - n_nodes):
            self.process.stdin.write("the node\n")
            self.process.stdin.flush()
            assert line_of(self.process) == "removed"
        self.n_nodes = n_nodes


@pytest.fixture(scope="module")
def cluster() -> Iterator[RayCluster]:
    """A cluster that begins with two nodes."""
    environment = {
        **os.environ,
        "PYTHONPATH": search_path(),
        "RAY_USAGE_STATS_ENABLED": "0",
        "RAY_worker_niceness": "0",
    }
    command = [sys.executable, "-m", "tests.jobs.remote.ray_cluster", "2"]
    with subprocess.Popen(
        command,
        cwd=PROJECT_ROOT,
        env=environment,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            yield RayCluster(process, 2, line_of(process))
        finally:
            assert process.stdin is not None
            process.stdin.close()  # the cluster ends with it
            process.wait()


def line_of(process: "subprocess.Popen[str]") -> str:
    assert process.stdout is not None
    return process.stdout.readline().strip()


def running_on(
    ray_address: str,
    store: Store,
    folder: Path,
    address: str,
    variables: Mapping[str, str] | None = None,
) -> AbstractContextManager[Supervisor]:
    """Run a supervisor whose jobs run on a cluster."""
    settings = {"TANDEM_RAY": ray_address, "TANDEM_WORKER_URL": address, "TANDEM_TOKEN": TOKEN}
    settings |= variables or {}
    executor = LocalExecutor(store.url, folder, "jobs.remote.ray_driver", settings)
    return supervised(store, folder, executor=executor, timeouts=PATIENCE_OF_RAY)


def process_of(job_id: str, module: str = "jobs.remote.run") -> int | None:
    """Return the process of a job by the module that it runs; None: there is none."""
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            words = path.read_bytes().split(b"\0")
        except OSError:
            continue
        if module.encode() in words and job_id.encode() in words:
            return int(path.parent.name)
    return None


def test_job_whose_cluster_does_not_answer_waits_and_counts_no_crash(
    store: Store, tmp_path: Path, address: str
) -> None:
    impatient = {"RAY_NUM_REDIS_GET_RETRIES": "1", "RAY_gcs_rpc_server_connect_timeout_s": "1"}
    with running_on("127.0.0.1:1", store, tmp_path, address, impatient) as supervisor:
        job_id = train(store, **FIELDS)
        wait_for(store, job_id, lambda job: job.waiting == "no Ray cluster")
        wait_until(lambda: supervisor.waiting == "no Ray cluster")
        job = wait_for(store, job_id, lambda job: job.attempt == 2 or job.failures > 0)
    assert (job.attempt, job.failures) == (2, 0)


def test_training_whose_worker_and_node_fail_ends_with_the_checkpoints_of_a_local_one(
    store: Store, tmp_path: Path, address: str, cluster: RayCluster
) -> None:
    train(store, **FIELDS)
    local = run_here(store, tmp_path)
    with running_on(cluster.address, store, tmp_path, address):
        job_id = train(store, **FIELDS)
        wait_for(store, job_id, lambda job: job.step >= 384)
        pid = process_of(job_id)
        assert pid is not None
        os.kill(pid, signal.SIGKILL)
        wait_for(store, job_id, lambda job: job.attempt == 2 and job.step >= 640)
        cluster.keep(1)
        job = wait_until_final(store, job_id)
    assert (job.state, job.error) == ("succeeded", None)
    made = made_by(store, job_id)
    assert made == made_by(store, local.id) and len(made.checkpoints) == 4
    assert [point.step for point in metrics.list_metrics(store, job_id)] == STEPS


def test_stopped_server_keeps_the_last_step_and_a_killed_one_ends_its_worker(
    store: Store, tmp_path: Path, address: str, cluster: RayCluster
) -> None:
    cluster.keep(1)
    with running_on(cluster.address, store, tmp_path, address):
        job_id = train(store, **{**FIELDS, "learning.total_steps": 200_000})
        wait_for(store, job_id, lambda job: job.step >= 128)
    job = jobs.get_job(store, job_id)
    state = attempts.load_resume(store, job_id)
    assert (job.state, job.failures) == ("queued", 0)
    assert state is not None and state.step >= job.step
    with running_on(cluster.address, store, tmp_path, address):
        wait_for(store, job_id, lambda job: job.step > state.step)
        driver = process_of(job_id, "jobs.remote.ray_driver")
        worker = process_of(job_id)
        assert driver is not None and worker is not None
        jobs.request_cancel(store, job_id)
        os.kill(driver, signal.SIGKILL)
        wait_until(lambda: process_of(job_id) != worker)
        assert wait_until_final(store, job_id).state == "cancelled"


def test_job_without_a_free_processor_waits_and_says_so(
    store: Store, tmp_path: Path, address: str, cluster: RayCluster
) -> None:
    cluster.keep(0)
    with running_on(cluster.address, store, tmp_path, address) as supervisor:
        job_id = train(store, **FIELDS)
        job = wait_for(store, job_id, lambda job: job.waiting is not None)
        assert (job.state, job.waiting) == ("running", "no free CPU in the Ray cluster")
        wait_until(lambda: supervisor.waiting == job.waiting)
        jobs.request_cancel(store, job_id)
        assert wait_until_final(store, job_id).state == "cancelled"
