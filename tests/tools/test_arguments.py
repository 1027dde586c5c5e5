"""Every script of ``tools`` states what it does and refuses wrong arguments, unstarted."""

import runpy
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPTS = [
    ".".join(path.relative_to(ROOT).with_suffix("").parts)
    for path in sorted((ROOT / "tools").rglob("*.py"))
    if '__name__ == "__main__"' in path.read_text(encoding="utf-8")
]
PARSES = ("parser_of(", "ArgumentParser(", "collect(")


@pytest.mark.parametrize("script", SCRIPTS)
@pytest.mark.parametrize(("argument", "status"), [("--help", 0), ("--unknown", 2)])
def test_script_starts_with_its_arguments_only(
    script: str,
    argument: str,
    status: int,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    text = (ROOT / script.replace(".", "/")).with_suffix(".py").read_text(encoding="utf-8")
    assert any(one in text for one in PARSES), "it would start"
    monkeypatch.setattr(sys, "argv", [script, argument])
    monkeypatch.delitem(sys.modules, script, raising=False)
    with pytest.raises(SystemExit) as ended:
        runpy.run_module(script, run_name="__main__")
    assert ended.value.code == status
    said = capsys.readouterr()
    assert "usage:" in (said.out if status == 0 else said.err)
