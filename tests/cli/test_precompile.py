"""Compilation of kernels at set-up."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
COMPILE_S = 1200.0
RARE = """
from app.precompile import PARTS
from app.sim.reach.kernels.queries import distances_of_envs
from app.sim.robot.kernels.arm import cell_clearance, self_clearance
for part in ("moving", "choosing"):
    PARTS[part]()
for kernel in (distances_of_envs, cell_clearance, self_clearance):
    print(len(kernel.signatures))
"""
"""Prints for kernels that live worlds call rarely how many entries set-up has compiled."""


def test_setup_compiles_kernels_that_live_worlds_call_rarely() -> None:
    done = subprocess.run(
        [sys.executable, "-c", RARE],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=COMPILE_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["1", "1", "1"]
