import json
import random
from pathlib import Path

import pytest

from app.cli.entry import main
from tests.cli.test_commands import run
from tests.support import workshop


@pytest.fixture(autouse=True)
def own_cell(tmp_path: Path) -> None:
    """A cell of the user's own in the data folder."""
    file = tmp_path / "workshop.json"
    file.write_text(json.dumps(workshop.definition()))
    assert main(["cells", "add", str(file)]) == 0


def test_backup_and_restore_name_their_content(
    data: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    file = str(tmp_path / "b.tar")
    assert main(["backup", file]) == 0
    assert main(["cells", "remove", "workshop"]) == 0
    capfd.readouterr()
    assert main(["restore", file, "--json"]) == 0
    found = json.loads(capfd.readouterr().out)
    assert found["rows"]["cells"] == 1
    assert Path(found["kept"]).parent == data
    assert main(["cells", "show", "workshop"]) == 0


def test_wrong_backup_is_one_line(
    data: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    notes = tmp_path / "notes.txt"
    notes.write_text("mine")
    capfd.readouterr()
    assert main(["restore", str(notes)]) == 2
    assert capfd.readouterr().err.startswith("tandem: FILE = ")
    assert main(["backup", str(notes)]) == 2
    assert "exists: name a new file" in capfd.readouterr().err
    assert (data / "tandem.db").exists()


def test_server_of_a_damaged_database_names_the_remedy(data: Path) -> None:
    path = data / "tandem.db"
    content = bytearray(path.read_bytes())
    content[4096:] = random.Random(1).randbytes(len(content) - 4096)
    path.write_bytes(content)
    ended = run("serve", data=data, TANDEM_PORT="0")
    assert ended.returncode != 0
    assert "Traceback" not in ended.stderr
    assert "is damaged or no database" in ended.stderr
    assert "'python -m app restore FILE'" in ended.stderr
