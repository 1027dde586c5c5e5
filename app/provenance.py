"""Version of Tandem; machine, versions and commit of a measurement, printed with its result."""

import os
import platform
import subprocess
from functools import cache
from importlib import metadata
from pathlib import Path

VERSION = "0.1.0"
"""Version of Tandem, as in ``pyproject.toml``."""
PACKAGES = ("numpy", "numba", "torch", "stable-baselines3", "pin", "python-fcl", "mujoco")
"""Packages with an effect on measurements."""


@cache
def describe() -> dict[str, object]:
    """Describe this machine as JSON data.

    Returns:
        ``cpu``, ``cores`` (of this process), ``memory_gib``, ``system``, ``python``,
        ``packages`` and ``commit`` (None outside a checkout; with a trailing ``+`` for a
        modified tree).
    """
    return {
        "cpu": _cpu_model(),
        "cores": cores(),
        "memory_gib": _memory_gib(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "packages": _versions(),
        "commit": _commit(),
    }


def _cpu_model() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    models = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.processor() or platform.machine()


def cores() -> int:
    """Return the number of cores of this process."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _memory_gib() -> float | None:
    try:
        total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return None
    return round(total / 2**30, 1)


def _versions() -> dict[str, str]:
    found = {}
    for name in PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found


def _commit() -> str | None:
    command = ["git", "describe", "--always", "--dirty=+", "--exclude=*", "--abbrev=12"]
    root = Path(__file__).resolve().parent.parent
    try:
        done = subprocess.run(
            command, cwd=root, capture_output=True, text=True, timeout=5, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()
