import os
import subprocess
import sys
import zipfile
from pathlib import Path
from urllib.parse import quote

import pytest

from tools.install import places

SCRIPT = Path(__file__).resolve().parents[2] / "tools/install.py"


@pytest.fixture
def wheels(tmp_path: Path) -> Path:
    """Return a folder with the wheel of a package ``probe``."""
    folder = tmp_path / "wheels"
    add_wheel(folder, "1.0")
    return folder


def add_wheel(folder: Path, version: str) -> None:
    """Add the wheel of a version of a package ``probe`` to a folder, which is created."""
    folder.mkdir(parents=True)
    info = f"probe-{version}.dist-info"
    with zipfile.ZipFile(folder / f"probe-{version}-py3-none-any.whl", "w") as wheel:
        wheel.writestr("probe.py", "VALUE = 7\n")
        metadata = f"Metadata-Version: 2.1\nName: probe\nVersion: {version}\n"
        wheel.writestr(f"{info}/METADATA", metadata)
        wheel.writestr(f"{info}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\n")
        wheel.writestr(f"{info}/RECORD", "")


def add_index(root: Path, version: str) -> str:
    """Create a package index with a version of ``probe``; return its URL."""
    folder = root / "probe"
    add_wheel(folder, version)
    (wheel,) = folder.iterdir()
    (folder / "index.html").write_text(f'<a href="{quote(wheel.name)}">{wheel.name}</a>')
    return root.as_uri()


def install(wheels: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the script with pip configured for a folder of wheels alone."""
    return install_from({"PIP_FIND_LINKS": str(wheels), "PIP_NO_INDEX": "1"}, *arguments)


def install_from(places: dict[str, str], *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the script with pip configured by some variables alone."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("UV_", "PIP_"))}
    return subprocess.run(
        [sys.executable, SCRIPT, *arguments],
        env={**kept, "PIP_CONFIG_FILE": os.devnull, **places},
        capture_output=True,
        text=True,
        check=True,
    )


def installer_of(target: Path) -> str:
    """Return what installed the package."""
    return (target / "probe-1.0.dist-info/INSTALLER").read_text().strip()


def test_uv_installs_from_where_pip_would(wheels: Path, tmp_path: Path) -> None:
    install(wheels, "--quiet", "--target", str(tmp_path / "here"), "probe")
    assert (tmp_path / "here/probe.py").read_text() == "VALUE = 7\n"
    assert installer_of(tmp_path / "here") == "uv"


def test_index_of_the_command_counts_more_than_that_of_pip(tmp_path: Path) -> None:
    own, cpu = (add_index(tmp_path / f"v{v}", v) for v in ("1.0", "1.0+cpu"))
    arguments = ["--quiet", "--target", str(tmp_path / "here"), "--index-url", cpu]
    install_from({"PIP_INDEX_URL": own}, *arguments, "probe==1.0")
    info = tmp_path / "here/probe-1.0+cpu.dist-info"
    assert (info / "INSTALLER").read_text().strip() == "uv"


def test_pip_installs_where_uv_cannot(wheels: Path, tmp_path: Path) -> None:
    places = {"PIP_FIND_LINKS": str(wheels), "PIP_NO_INDEX": "1"}
    no_cache = {"UV_CACHE_DIR": str(SCRIPT / "cache")}  # below a file
    answer = install_from({**places, **no_cache}, "--target", str(tmp_path / "here"), "probe")
    assert "uv failed: pip installs instead" in answer.stderr
    assert installer_of(tmp_path / "here") == "pip"


def test_missing_package_fails(wheels: Path, tmp_path: Path) -> None:
    with pytest.raises(subprocess.CalledProcessError):
        install(wheels, "--quiet", "--target", str(tmp_path / "here"), "no-such-package")


def test_environment_counts_more_than_files(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("UV_DEFAULT_INDEX", "UV_FIND_LINKS", "UV_INDEX", "SSL_CERT_FILE"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("UV_NO_INDEX", "0")  # what is set for uv itself counts most
    env = places(
        ":env:.index-url='https://c.example/simple'\n"
        "global.index-url='https://a.example/simple'\n"
        "global.extra-index-url='https://x.example/simple\\nhttps://y.example/simple'\n"
        "global.find-links='/opt/a /opt/b'\n"
        "global.no-index='1'\n"
        "install.index-url='https://b.example/simple'\n"
        "download.cert='/other/command.pem'\n"
        "global.constraint='/etc/constraints.txt'\n"
    )
    assert env["UV_DEFAULT_INDEX"] == "https://c.example/simple"
    assert env["UV_INDEX"] == "https://x.example/simple https://y.example/simple"
    assert env["UV_FIND_LINKS"] == "/opt/a,/opt/b"
    assert env["UV_NO_INDEX"] == "0"
    assert "SSL_CERT_FILE" not in env
