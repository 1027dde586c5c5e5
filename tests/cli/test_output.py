"""The file of ``--output``: replaced as a whole, or a device; means in tables."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from app.cli.output import table, write_output
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


def test_only_rates_of_a_table_are_percentages() -> None:
    mean = {"mean": 0.5, "low": 0.25, "high": 0.75}
    row = {"success": mean, "time_s": {**mean, "sd": 0.1}, "grasps": mean}
    result = {"protocol": "any", "seed": 1, "episodes": 4, "results": [row]}
    cells = table(result).splitlines()[-1]
    assert cells == "50.0 % [25.0, 75.0]  0.5 [0.25, 0.75]  0.5 [0.25, 0.75]"


def test_no_rate_of_a_stored_result_exceeds_100_percent() -> None:
    stored = [json.loads(path.read_bytes()) for path in (ROOT / "docs/results").glob("*.json")]
    found = [one for one in stored if "protocol" in one]
    protocols = {one["protocol"] for one in found}
    assert {"pick-ssm", "reach-ssm", "sorting-people", "sorting-grid"} <= protocols
    for one in found:
        assert all(float(rate) <= 100.0 for rate in re.findall(r"([\d.]+) %", table(one)))
