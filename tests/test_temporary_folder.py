"""Folders of killed processes are removed by the next one, those of living ones are not."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from app.temporary_folder import TemporaryFolder

OWNER = """
import sys
from pathlib import Path

from app.temporary_folder import TemporaryFolder

folder = TemporaryFolder("a-", Path(sys.argv[1]))
(folder.path / "file").touch()
print(folder.path, file=sys.stderr, flush=True)
sys.stdin.read()
"""
VIEWER = """
import sys

from web.viewer.server import ViewerServer

print(ViewerServer().address.parent, file=sys.stderr, flush=True)
sys.stdin.read()
"""


@contextmanager
def owner(program: str, parent: Path) -> Iterator[Path]:
    """Yield the folder of a process, which is killed at the end of the block."""
    with subprocess.Popen(
        [sys.executable, "-c", program, str(parent)],
        env={**os.environ, "TMPDIR": str(parent)},
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    ) as process:
        assert process.stderr is not None
        try:
            yield Path(process.stderr.readline().decode().strip())
        finally:
            process.kill()


def test_folder_of_a_killed_process_is_removed_by_the_next_one(tmp_path: Path) -> None:
    (tmp_path / "b-other").mkdir()
    with owner(OWNER, tmp_path) as first:
        second = TemporaryFolder("a-", tmp_path)
        assert (first / "file").exists()
    third = TemporaryFolder("a-", tmp_path)
    assert not first.exists()
    assert second.path.exists() and third.path.exists() and (tmp_path / "b-other").exists()
    for one in (second, third, third):
        one.close()
    assert [one.name for one in tmp_path.iterdir()] == ["b-other"]


def test_link_to_another_folder_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "a-link").symlink_to(tmp_path / "mine")
    TemporaryFolder("a-", tmp_path).close()
    assert {one.name for one in tmp_path.iterdir()} == {"mine", "a-link"}


def test_socket_of_a_killed_viewer_is_removed_by_the_next_one(tmp_path: Path) -> None:
    with owner(VIEWER, tmp_path) as first:
        assert (first / "viewer").is_socket()
    with owner(VIEWER, tmp_path) as second:
        assert [one for one in tmp_path.iterdir() if one.is_dir()] == [second]
