"""Cache of compiled kernels between runs.

numba compiles a function again when *its* file changes, but not when a function changes that it
calls from another file: after an update it would go on with old code. So the folder's name is
a fingerprint of all kernels. It must be set before numba is imported.
"""

import hashlib
from importlib import resources
from pathlib import Path

COMPILED = b"from app.sim.core.jit import"
"""Line of modules outside kernel packages that have compiled functions."""


def kernel_sources() -> list[Path]:
    """Return the files with compiled functions, and those they depend on."""
    folder = Path(str(resources.files("app")))
    return sorted(
        {
            *folder.glob("sim/**/kernels/*.py"),
            *folder.glob("sim/core/*.py"),
            *folder.glob("sim/geometry/*.py"),
            *(one for one in folder.glob("policies/**/*.py") if COMPILED in one.read_bytes()),
        }
    )


def fingerprint() -> str:
    """Return a short hash of the sources of all kernels."""
    digest, folder = hashlib.sha256(), Path(str(resources.files("app")))
    for source in kernel_sources():
        name = source.relative_to(folder).as_posix()
        digest.update(name.encode() + b"\0" + source.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def kernel_cache(data: Path) -> Path:
    """Return the folder for numba's cache (``NUMBA_CACHE_DIR``) under the data folder."""
    return data.resolve() / "kernels" / fingerprint()
