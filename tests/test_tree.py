"""Modules and folders stay short; the limits of CONTRIBUTING.md."""

import subprocess
from collections import Counter
from pathlib import Path, PurePath

ROOT = Path(__file__).resolve().parent.parent
FILES = subprocess.run(
    ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
    cwd=ROOT,
    capture_output=True,
    text=True,
    check=True,
).stdout.split()
SOURCES = [
    PurePath(name)
    for name in FILES
    if name.endswith((".py", ".js")) and (ROOT / name).is_file()
]
MAX_LINES = 400
MAX_MODULES = 20
CHAIN = "app/store/migrations/versions"  # grows by a file per change of the tables


def test_modules_have_at_most_400_lines() -> None:
    lines = {str(path): len((ROOT / path).read_text("utf-8").splitlines()) for path in SOURCES}
    assert len(lines) > 500
    assert {name: n for name, n in lines.items() if n > MAX_LINES} == {}


def test_folders_have_at_most_20_modules() -> None:
    modules = Counter(str(path.parent) for path in SOURCES if path.name != "__init__.py")
    modules.pop(CHAIN)
    assert len(modules) > 50
    assert {folder: n for folder, n in modules.items() if n > MAX_MODULES} == {}
