"""The command that exports a policy as an ONNX model."""

from pathlib import Path

import onnx
import pytest

from app.cli.entry import main
from app.policies.checkpoints import pretrained
from app.settings import Settings
from app.store.checkpoints import put_checkpoint, set_alias
from app.store.database.migrate import migrate
from app.store.engine import Store
from jobs.checkpoints import to_store


def test_model_has_the_name_of_its_checkpoint(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data.mkdir()
    store, shipped = Store(Settings().database), to_store(pretrained.load("reach"))
    migrate(store)
    put_checkpoint(store, shipped)
    set_alias(store, "reach-1.2", shipped.sha256)
    store.close()
    monkeypatch.chdir(tmp_path)
    assert main(["export", "reach-1.2"]) == 0
    model = onnx.load(tmp_path / "reach-1.2.onnx")
    metadata = {one.key: one.value for one in model.metadata_props}
    assert (metadata["name"], metadata["checkpoint"]) == ("reach-1.2", shipped.sha256)


def test_sorting_policy_that_is_not_exported_is_named(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["export", "sorting-e0"]) == 2
    text = capsys.readouterr().err
    assert "checkpoint = 'sorting-e0' is a sorting policy, which is not exported" in text
