import subprocess
import sys

import pytest

from jobs.executor import PROJECT_ROOT
from tests.jobs.machinery import is_running, wait_until

SERVER = """
import subprocess, sys, time
from jobs.start import child_command
print(subprocess.Popen(child_command("tests.jobs.slow_import")).pid, flush=True)
time.sleep(float(sys.argv[1]))
print("killed", flush=True)
time.sleep(3600.0)
"""


@pytest.mark.parametrize("age_s", [0.0, 2.0])
def test_child_that_still_imports_ends_with_its_server(age_s: float) -> None:
    command = [sys.executable, "-c", SERVER, str(age_s)]
    with subprocess.Popen(command, cwd=PROJECT_ROOT, stdout=subprocess.PIPE) as server:
        assert server.stdout is not None
        pid = int(server.stdout.readline())
        server.stdout.readline()
        server.kill()
    wait_until(lambda: not is_running(pid))
