"""The vendored files of the page are the ones their README names."""

import hashlib
import re
from pathlib import Path

STATIC = Path(__file__).parents[3] / "web" / "page"
VENDOR = STATIC / "vendor"
ROW = re.compile(r"^\| `([^`]+)` \|.*`([0-9a-f]{64})` \|$", re.MULTILINE)


def test_every_vendored_file_has_the_checksum_its_readme_names() -> None:
    named = dict(ROW.findall((VENDOR / "README.md").read_text()))
    files = [p for p in VENDOR.iterdir() if not p.name.startswith(("LICENSE", "README"))]
    found = {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in files}
    assert found == named


def test_every_module_the_page_imports_is_there() -> None:
    imported = re.compile(r"from \"(\.\.?/[^\"]+)\"")
    modules = [path for path in STATIC.rglob("*.js") if VENDOR not in path.parents]
    assert len(modules) > 20
    for module in modules:
        for name in imported.findall(module.read_text()):
            assert (module.parent / name).is_file(), f"{module.name} imports {name}"


def test_page_has_no_inline_script_or_style() -> None:
    text = (STATIC / "index.html").read_text()
    assert "<style" not in text
    assert " style=" not in text
    assert all("src=" in tag for tag in re.findall(r"<script[^>]*>", text))
