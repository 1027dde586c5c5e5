"""Readers get tensors and manifest of one checkpoint, whenever the writer is stopped."""

import json
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from app.policies.checkpoints.checkpoint import TensorFile
from app.policies.checkpoints.files import read_files, write_files
from tests.cli.test_commands import ROOT

STEPS = [TensorFile({"step": n}, bytes([n]) * 100_000) for n in range(200)]
WRITER = """
import sys
from pathlib import Path

from app.policies.checkpoints.checkpoint import TensorFile
from app.policies.checkpoints.files import write_files
from os import _exit as end

path, events, step = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
seen = 0

def stop(event, arguments):
    global seen
    if event in ("open", "os.rename") and str(path.parent) in str(arguments[0]):
        seen += 1
        if seen > events:
            end(9)

sys.addaudithook(stop)
write_files(path, TensorFile({"step": step}, bytes([step]) * 100_000))
"""


def read(path: Path) -> TensorFile:
    return read_files(
        path, lambda it: TensorFile(json.loads(it.read_text()), path.read_bytes())
    )


def interrupted_write(path: Path, events: int, step: int) -> bool:
    """Write in a process that ends before it opens or renames one more file than ``events``."""
    command = [sys.executable, "-c", WRITER, str(path), str(events), str(step)]
    ended = subprocess.run(command, cwd=ROOT, check=False).returncode
    assert ended in (0, 9)
    return ended != 0


def test_writer_that_is_stopped_anywhere_leaves_a_whole_checkpoint(tmp_path: Path) -> None:
    path, events, before = tmp_path / "policy.safetensors", 0, 0
    write_files(path, STEPS[0])
    while interrupted_write(path, events, step=events + 1):
        events += 1
        found = read(path)
        assert found in (STEPS[before], STEPS[events])
        before = found.manifest["step"]
    assert before > 0 and read(path) == STEPS[events + 1]
    assert {one.name for one in tmp_path.iterdir()} == {"policy.safetensors", "policy.json"}


def test_reader_beside_a_writer_gets_whole_checkpoints(tmp_path: Path) -> None:
    path = tmp_path / "policy.safetensors"
    write_files(path, STEPS[0])

    def write_all() -> None:
        for one in STEPS:
            write_files(path, one)

    seen = 0
    with ThreadPoolExecutor(1) as pool:
        writer = pool.submit(write_all)
        while not writer.done():
            found = read(path)
            assert found == STEPS[found.manifest["step"]]
            seen += 1
        writer.result()
    assert seen > 1 and read(path) == STEPS[-1]


def test_damage_of_a_file_is_reported_at_once(tmp_path: Path) -> None:
    path = tmp_path / "policy.safetensors"
    write_files(path, STEPS[0])
    path.with_suffix(".json").write_text("{")
    with pytest.raises(ValueError):
        read(path)
