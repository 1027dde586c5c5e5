"""Modules and folders stay short, as CONTRIBUTING.md asks; maps of packages are complete."""

import ast
import re
import subprocess
from collections import Counter
from pathlib import Path, PurePath

import pytest

from tests.conftest import GROUPS

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


def test_groups_of_test_files_name_files_that_exist() -> None:
    assert len(GROUPS) > 10
    assert [name for name in GROUPS if not (ROOT / name).is_file()] == []


ENTRY = re.compile(r"^([a-z_0-9]+/?)(?:  +\S|$)", re.MULTILINE)
PACKAGES = [path for path in SOURCES if path.name == "__init__.py" and path.parts[0] != "tests"]


def mapped(package: PurePath) -> set[str]:
    """Entries of a package's docstring: modules, and packages with a slash."""
    return set(ENTRY.findall(ast.get_docstring(ast.parse((ROOT / package).read_text())) or ""))


def content(package: PurePath) -> set[str]:
    """Modules and packages in a package."""
    inside = [path for path in SOURCES if path.is_relative_to(package.parent)]
    parts = [path.relative_to(package.parent).parts for path in inside]
    found = {f"{one[0]}/" for one in parts if len(one) > 1}
    return found | {one[0][:-3] for one in parts if len(one) == 1} - {"__init__"}


WITHOUT_MAP = {
    "app/client/operations",  # written by `make client`; its imports list the modules
    CHAIN,  # each module names the one before it
}


@pytest.mark.parametrize("package", PACKAGES, ids=lambda path: str(path.parent))
def test_the_map_of_a_package_is_complete(package: PurePath) -> None:
    inside = content(package)
    if mapped(package) or (len(inside) >= 3 and str(package.parent) not in WITHOUT_MAP):
        assert mapped(package) ^ inside == set()
