import os
import time
from pathlib import Path

from app.sim.core.kernel_cache import kernel_cache
from app.unused_kernels import KEEP_S, remove_unused


def test_kernels_of_versions_that_have_not_started_for_long_are_removed(tmp_path: Path) -> None:
    used = kernel_cache(tmp_path)
    long_ago = time.time() - KEEP_S - 60.0
    for name, at in (
        (used.name, long_ago),
        ("0123456789abcdef", long_ago),
        ("fedcba9876543210", long_ago + 120.0),
        ("notes", long_ago),
    ):
        (used.parent / name / "module").mkdir(parents=True)
        (used.parent / name / "module/kernel.nbc").write_bytes(b"code")
        os.utime(used.parent / name, (at, at))
    for _ in range(2):
        remove_unused(used)
        kept = {one.name for one in used.parent.iterdir()}
        assert kept == {used.name, "fedcba9876543210", "notes"}
    assert time.time() - used.stat().st_mtime < KEEP_S / 2


def test_data_folder_without_kernels_stays_as_it_is(tmp_path: Path) -> None:
    remove_unused(kernel_cache(tmp_path))
    assert list(tmp_path.iterdir()) == []
