"""The process beside the server that runs an attempt on a Ray cluster, without a cluster."""

import os
import signal
import subprocess
import sys

import pytest

from jobs.executor import PROJECT_ROOT


def test_output_of_a_worker_for_which_the_disk_has_no_room_is_dropped() -> None:
    program = "from jobs.remote import ray_driver; ray_driver.copy_output(b'a line')"
    with open("/dev/full", "wb") as full:
        ended = subprocess.run([sys.executable, "-c", program], cwd=PROJECT_ROOT, stdout=full)
    assert ended.returncode == 0


@pytest.mark.parametrize(
    ("code", "status"),
    [(0, 0), (3, 3), (-signal.SIGTERM, os.EX_TEMPFAIL), (-signal.SIGKILL, os.EX_SOFTWARE)],
)
def test_process_of_a_node_that_is_terminated_is_queued_again(code: int, status: int) -> None:
    program = f"from jobs.remote import ray_driver; exit(ray_driver.exit_status({code}))"
    ended = subprocess.run([sys.executable, "-c", program], cwd=PROJECT_ROOT, check=False)
    assert ended.returncode == status
