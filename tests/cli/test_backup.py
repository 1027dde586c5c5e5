import json
import random
import shutil
import sqlite3
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


def test_files_on_another_disk_are_backed_up(
    data: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    disk = tmp_path / "disk"
    (disk / "job").mkdir(parents=True)
    (disk / "job/replay.bin").write_bytes(b"transitions")
    (data / "resume").symlink_to(disk)
    (data / "above").symlink_to(tmp_path)
    file = str(tmp_path / "b.tar")
    assert main(["backup", file]) == 0
    shutil.rmtree(disk)
    disk.mkdir()
    capfd.readouterr()
    assert main(["restore", file, "--json"]) == 0
    assert json.loads(capfd.readouterr().out)["n_files"] == 1
    assert (disk / "job/replay.bin").read_bytes() == b"transitions"


def test_error_of_a_backup_names_the_folder_or_the_database(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main(["backup", str(tmp_path / "none/b.tar")]) == 2
    assert f"file = '{tmp_path}/none' cannot be" in capfd.readouterr().err
    other = sqlite3.connect(tmp_path / "other.db")
    other.execute("CREATE TABLE notes (text)")
    other.close()
    monkeypatch.setenv("TANDEM_DATABASE_URL", f"sqlite:///{tmp_path}/other.db")
    assert main(["backup", str(tmp_path / "b.tar")]) == 1
    assert "b.tar" not in (printed := capfd.readouterr().err)
    assert "other.db" in printed and "no such table: alembic_version" in printed


def test_command_that_reads_makes_no_database(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TANDEM_DATABASE_URL", f"sqlite:///{tmp_path}/new.db")
    assert main(["cells", "list"]) == 0
    assert main(["cells", "remove", "workshop"]) == 2
    assert not (tmp_path / "new.db").exists()


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
