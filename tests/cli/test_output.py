"""The file of ``--output``: replaced as a whole, or a device."""

import subprocess
import sys
from pathlib import Path

import pytest

from app.cli.output import write_output
from app.errors import InvalidInput
from tests.cli.test_commands import ROOT

CALL = "import sys; from pathlib import Path; from app.cli.output import write_output\n\
write_output(Path(sys.argv[1]), b'new')"


def test_reader_of_an_earlier_file_keeps_its_content(tmp_path: Path) -> None:
    path, link = tmp_path / "policy.onnx", tmp_path / "link.onnx"
    path.write_bytes(b"earlier")
    link.symlink_to(path)
    with path.open("rb") as reader:
        write_output(link, b"new")
        assert reader.read() == b"earlier"
    assert path.read_bytes() == b"new" and link.is_symlink()
    assert {one.name for one in tmp_path.iterdir()} == {"policy.onnx", "link.onnx"}


def test_standard_output_is_written() -> None:
    command = [sys.executable, "-c", CALL, "/dev/stdout"]
    assert subprocess.run(command, cwd=ROOT, check=True, capture_output=True).stdout == b"new"


@pytest.mark.parametrize("name", [".", "none/policy.onnx"])
def test_file_that_cannot_be_written_is_named(tmp_path: Path, name: str) -> None:
    with pytest.raises(InvalidInput, match="cannot be written"):
        write_output(tmp_path / name, b"new")
    assert list(tmp_path.iterdir()) == []
