"""Install packages as ``pip install`` does, in a third of its time.

    .venv/bin/python tools/install.py [OPTION ...] [-r FILE] [PACKAGE ...]

uv installs; it does not read pip's configuration, so that the places and certificates of that
are handed to it in its own environment variables. Where uv cannot be had, or fails, pip
installs. pip installs uv itself first, the version of ``requirements-setup.lock``, whose hashes
are checked.
"""

import argparse
import ast
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

LOCK = Path(__file__).resolve().parents[1] / "requirements-setup.lock"
PIP = [sys.executable, "-m", "pip", "--disable-pip-version-check"]
VARIABLES = {
    "index-url": "UV_DEFAULT_INDEX",
    "extra-index-url": "UV_INDEX",
    "find-links": "UV_FIND_LINKS",
    "no-index": "UV_NO_INDEX",
    "trusted-host": "UV_INSECURE_HOST",
    "cert": "SSL_CERT_FILE",
    "client-cert": "SSL_CLIENT_CERT",
    "proxy": "ALL_PROXY",
    "default-timeout": "UV_HTTP_TIMEOUT",
    "timeout": "UV_HTTP_TIMEOUT",
}
"""uv's variable of each of pip's options."""


def main(arguments: list[str]) -> int:
    """Install; return the exit status."""
    given = parser().parse_args(arguments)
    if has_uv():
        uv = [sys.executable, "-m", "uv", "pip", "install", "--python", sys.executable]
        # As pip does, uv is to take the best match of all indexes, not of the first.
        best = ["--index-strategy", "unsafe-best-match"]
        env = places(configuration())
        if given.index_url is not None:
            env.pop("UV_DEFAULT_INDEX", None)  # uv would take this one, and not the argument's
        if subprocess.run([*uv, *best, *arguments], env=env).returncode == 0:
            return 0
        print("uv failed: pip installs instead", file=sys.stderr)
    return subprocess.run([*PIP, "install", "--progress-bar", "off", *arguments]).returncode


def parser() -> argparse.ArgumentParser:
    """Return the options, which pip and uv share.

    Not ``tools.arguments``: this file runs alone, before any package is there.
    """
    found = argparse.ArgumentParser(
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    for flag in ("--quiet", "--require-hashes", "--no-deps"):
        found.add_argument(flag, action="store_true")
    for option in ("--only-binary", "--index-url", "--target", "-r"):
        found.add_argument(option)
    found.add_argument("packages", nargs="*", metavar="PACKAGE")
    return found


def has_uv() -> bool:
    """Return whether there is uv, after an attempt to install it."""
    if find_spec("uv") is None:
        options = ["--quiet", "--retries", "1", "--require-hashes", "--no-deps"]
        command = [*PIP, "install", *options, "-r", str(LOCK)]
        return subprocess.run(command, capture_output=True).returncode == 0
    return True


def configuration() -> str:
    """Return what pip is configured for, as ``pip config list`` prints it."""
    done = subprocess.run([*PIP, "config", "list"], capture_output=True, text=True)
    return done.stdout


def places(config: str) -> dict[str, str]:
    """Return the environment of uv: this process's with pip's places.

    Args:
        config: What ``pip config list`` prints, such as
            ``global.find-links='/opt/wheels'``. Of an option that stands in several
            sections, the environment counts most, then the section of ``install``.
    """
    values: dict[str, str] = {}
    for section in ("global", "install", ":env:"):
        for line in config.splitlines():
            name, _, value = line.partition("=")
            variable = VARIABLES.get(name.removeprefix(f"{section}."))
            if variable is not None:
                separator = "," if variable == "UV_FIND_LINKS" else " "
                values[variable] = separator.join(str(ast.literal_eval(value)).split())
    return {**values, **os.environ}


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
