"""The process beside the server that runs an attempt on a Ray cluster, without a cluster."""

import subprocess
import sys

from jobs.executor import PROJECT_ROOT


def test_output_of_a_worker_for_which_the_disk_has_no_room_is_dropped() -> None:
    program = "from jobs.remote import ray_driver; ray_driver.copy_output(b'a line')"
    with open("/dev/full", "wb") as full:
        ended = subprocess.run([sys.executable, "-c", program], cwd=PROJECT_ROOT, stdout=full)
    assert ended.returncode == 0
