"""Compiled kernels of one version are not used by another."""

import os
from pathlib import Path

from app.sim.core.kernel_cache import fingerprint, kernel_cache
from app.sim.robot.kernels.acceleration_bounds import greatest_end_speed


def test_cache_folder_lies_in_the_data_folder_and_names_the_version(tmp_path: Path) -> None:
    folder = kernel_cache(tmp_path)
    assert folder.parent.parent == tmp_path
    assert folder.name == fingerprint() == fingerprint()


def test_kernels_of_the_tests_are_kept_under_the_fingerprint() -> None:
    greatest_end_speed(1.0, 0.0, 1.0, 0.1)
    assert greatest_end_speed.stats.cache_path.startswith(os.environ["NUMBA_CACHE_DIR"])
