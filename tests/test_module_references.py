"""Modules that docstrings, comments and pages name exist."""

import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FILES = subprocess.run(
    ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True
).stdout.split()
SOURCES = [name for name in FILES if name.endswith(".py")]
OLD = ("docs/notebook/",)


def named(pattern: str, files: list[str]) -> set[tuple[str, str]]:
    return {
        (file, found)
        for file in files
        for found in re.findall(pattern, (ROOT / file).read_text("utf-8"))
    }


def test_files_that_docstrings_name_exist() -> None:
    found = named(r"``([a-z_0-9][a-z_0-9/]*\.(?:py|npz|json))``", SOURCES)
    assert len(found) > 50
    missing = {
        (file, name)
        for file, name in found
        if not any(path == name or path.endswith("/" + name) for path in FILES)
    }
    assert missing == set()


def test_paths_that_pages_name_exist() -> None:
    pages = [name for name in FILES if name.endswith(".md") and not name.startswith(OLD)]
    found = named(r"`((?:app|web|jobs|tools|tests)/[a-z_0-9/]+\.[a-z]+)`", pages)
    assert len(found) > 10
    assert {(page, path) for page, path in found if path not in FILES} == set()


def test_modules_that_docstrings_name_exist() -> None:
    modules = {name.removesuffix(".py").replace("/", ".") for name in SOURCES}
    modules |= {name.removesuffix(".__init__") for name in modules}
    found = named(
        r"[`~]((?:app\.(?:api|cli|live|policies|sim|store)|web|jobs|tools)\.[a-z_.]+[a-z_])",
        SOURCES,
    )
    assert len(found) > 20
    missing = {
        (file, name)
        for file, name in found
        if name not in modules and name.rpartition(".")[0] not in modules
    }
    assert missing == set()
