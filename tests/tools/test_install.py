import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tools.install import places

SCRIPT = Path(__file__).resolve().parents[2] / "tools/install.py"


@pytest.fixture
def wheels(tmp_path: Path) -> Path:
    """Return a folder with the wheel of a package ``probe``."""
    folder = tmp_path / "wheels"
    folder.mkdir()
    info = "probe-1.0.dist-info"
    with zipfile.ZipFile(folder / "probe-1.0-py3-none-any.whl", "w") as wheel:
        wheel.writestr("probe.py", "VALUE = 7\n")
        wheel.writestr(f"{info}/METADATA", "Metadata-Version: 2.1\nName: probe\nVersion: 1.0\n")
        wheel.writestr(f"{info}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\n")
        wheel.writestr(f"{info}/RECORD", "")
    return folder


def install(wheels: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the script with pip configured for a folder of wheels alone."""
    kept = {key: value for key, value in os.environ.items() if not key.startswith("UV_")}
    return subprocess.run(
        [sys.executable, SCRIPT, *arguments],
        env={**kept, "PIP_FIND_LINKS": str(wheels), "PIP_NO_INDEX": "1"},
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


def test_pip_installs_where_uv_cannot(wheels: Path, tmp_path: Path) -> None:
    arguments = ["--root-user-action", "ignore", "--target", str(tmp_path / "here"), "probe"]
    answer = install(wheels, *arguments)  # uv has no such option
    assert "--root-user-action" in answer.stderr
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
