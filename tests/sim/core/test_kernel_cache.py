"""Compiled kernels of one version are not used by another."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from app.sim.core.kernel_cache import fingerprint, kernel_cache, kernel_sources
from app.sim.robot.kernels.acceleration_bounds import greatest_end_speed

ROOT = Path(__file__).parents[3]


def test_cache_folder_lies_in_the_data_folder_and_names_the_version(tmp_path: Path) -> None:
    folder = kernel_cache(tmp_path)
    assert folder.parent.parent == tmp_path
    assert folder.name == fingerprint() == fingerprint()


def test_kernels_of_the_tests_are_kept_under_the_fingerprint() -> None:
    greatest_end_speed(1.0, 0.0, 1.0, 0.1)
    assert greatest_end_speed.stats.cache_path.startswith(os.environ["NUMBA_CACHE_DIR"])


def test_every_module_with_compiled_functions_counts() -> None:
    compiled = {
        path
        for path in (ROOT / "app").rglob("*.py")
        if re.search(r"^@(kernel|njit)\(", path.read_text(), re.MULTILINE)
    }
    assert compiled <= set(kernel_sources())
    assert len(compiled) > 60


@pytest.mark.parametrize(
    ("module", "folder"),
    [
        ("app.sim.core.jit", "{cache}/tandem/kernels/"),
        ("tools.arguments", "{root}/data/kernels/"),
    ],
)
def test_programs_beside_the_command_line_keep_kernels_by_version(
    module: str, folder: str, tmp_path: Path
) -> None:
    code = f"import {module}, app.sim.robot.kernels.acceleration_bounds as k;" + (
        "print(k.greatest_end_speed.stats.cache_path)"
    )
    env = {**os.environ, "XDG_CACHE_HOME": str(tmp_path), "PYTHONPATH": str(ROOT)}
    del env["NUMBA_CACHE_DIR"]
    found = subprocess.run(
        [sys.executable, "-c", code], env=env, check=True, capture_output=True, text=True
    )
    expected = folder.format(cache=tmp_path, root=ROOT) + fingerprint()
    assert found.stdout.startswith(expected)
