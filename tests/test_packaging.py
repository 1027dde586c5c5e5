"""Dependencies, locks and package data say what the code needs."""

import ast
import re
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from app.provenance import VERSION

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
ROOTS = ("app", "jobs", "web")
EXTRAS = {
    "app/cli/report_job.py": "client",
    "app/client/transport.py": "client",
    "app/policies/inference/onnx_export.py": "onnx",
    "jobs/remote/connection.py": "ray",
    "jobs/remote/ray_driver.py": "ray",
    "tools/distance_fields.py": "dev",
}
"""Modules that are imported only where an extra is installed."""


def pins(name: str) -> dict[str, str]:
    text = (ROOT / name).read_text(encoding="utf-8")
    return dict(re.findall(r"^([a-z0-9.-]+)==([^ ;]+)", text, re.MULTILINE))


def imported_roots(path: Path) -> set[str]:
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module.split(".")[0])
    return found - sys.stdlib_module_names - set(ROOTS)


def names_in(lines: list[str]) -> set[str]:
    return {canonicalize_name(Requirement(line).name) for line in lines}


def test_every_place_states_the_same_version() -> None:
    assert PROJECT["project"]["version"] == VERSION
    assert f"note   = {{Version {VERSION}," in (ROOT / "README.md").read_text(encoding="utf-8")


def test_every_imported_package_is_declared() -> None:
    declared = names_in(PROJECT["project"]["dependencies"])
    extras = PROJECT["project"]["optional-dependencies"]
    owners = {**packages_distributions(), "pinocchio": ["pin"]}
    for path in (path for folder in ROOTS for path in (ROOT / folder).rglob("*.py")):
        extra = EXTRAS.get(path.relative_to(ROOT).as_posix())
        allowed = declared | names_in(extras[extra] if extra else [])
        for root in imported_roots(path):
            packages = {canonicalize_name(name) for name in owners[root]}
            assert packages & allowed, f"{path} imports {root}, which pyproject.toml lacks"


def test_every_declared_package_is_locked_but_torch() -> None:
    extras = PROJECT["project"]["optional-dependencies"]
    runtime, everything = pins("requirements.lock"), pins("requirements-dev.lock")
    for lines, lock in (
        (PROJECT["project"]["dependencies"], runtime),
        (PROJECT["dependency-groups"]["setup"], pins("requirements-setup.lock")),
        (
            extras["dev"] + extras["client"] + extras["onnx"] + extras["otel"] + extras["ray"],
            everything,
        ),
    ):
        for requirement in map(Requirement, lines):
            if requirement.name != "torch":
                assert lock[canonicalize_name(requirement.name)] in requirement.specifier


def test_both_locks_agree() -> None:
    assert pins("requirements.lock").items() <= pins("requirements-dev.lock").items()


def test_locks_hold_versions_and_hashes_and_no_address() -> None:
    line = re.compile(
        r"#.*|[a-z0-9.-]+==[^ ]+( ; [^\\]+)? \\|    --hash=sha256:[0-9a-f]{64}( \\)?"
    )
    for name in ("requirements.lock", "requirements-dev.lock", "requirements-setup.lock"):
        for text in (ROOT / name).read_text(encoding="utf-8").splitlines():
            assert line.fullmatch(text), text


def test_locks_leave_torch_and_its_cuda_packages_out() -> None:
    for name in pins("requirements-dev.lock"):
        assert not re.match(r"torch$|triton|nvidia-|cuda-", name)


def test_makefile_installs_the_declared_torch() -> None:
    (torch,) = (line for line in PROJECT["project"]["dependencies"] if line.startswith("torch"))
    assert f"TORCH ?= {torch.removeprefix('torch==')}\n" in (ROOT / "Makefile").read_text()


def test_extras_are_installed_from_the_checkout_not_from_an_index() -> None:
    named = re.compile(r"install\s+['\"]?tandem\b|['\"]tandem\[")
    texts = [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")]
    texts += [path for folder in ROOTS for path in (ROOT / folder).rglob("*.py")]
    assert [path for path in texts if named.search(path.read_text(encoding="utf-8"))] == []


def test_every_data_file_belongs_to_the_package() -> None:
    data = PROJECT["tool"]["setuptools"]["package-data"]
    packaged = {
        path
        for package, patterns in data.items()
        for pattern in patterns
        for path in (ROOT / package.replace(".", "/")).glob(pattern)
    }
    for folder in ROOTS:
        for path in (ROOT / folder).rglob("*"):
            if path.is_file() and path.suffix != ".py" and path.parent.name != "__pycache__":
                assert path in packaged, f"{path} is in no package-data pattern"
