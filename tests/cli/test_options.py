from pathlib import Path
from typing import NoReturn

import pytest

from app.cli.entry import main
from app.errors import Conflict
from app.policies.evaluation import registry
from app.policies.training import train as training


@pytest.mark.parametrize("command", [["evaluate", "pick-single"], ["train", "pick-td3"]])
def test_folder_that_cannot_keep_compiled_kernels_is_named_once(
    command: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def end(*_: object, **__: object) -> NoReturn:
        raise Conflict("that is enough")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(registry, "evaluate", end)
    monkeypatch.setattr(training, "train", end)
    (tmp_path / "file").write_text("")
    for name, reasons in (("file", ["Not a directory"]), ("data", [])):
        monkeypatch.delenv("NUMBA_CACHE_DIR")
        monkeypatch.setenv("TANDEM_DATA", str(tmp_path / name))
        assert main(command) == 1
        lines = [one for one in capsys.readouterr().err.splitlines() if "kernels" in one]
        assert [one.rpartition(": ")[2] for one in lines] == reasons
        assert all(f"TANDEM_DATA = {tmp_path / name}" in one for one in lines)
