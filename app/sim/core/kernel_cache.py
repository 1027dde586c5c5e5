"""Cache of compiled kernels between runs.

numba compiles a function again when *its* file changes, but not when a function changes that it
calls from another file: after an update it would go on with old code. So the folder's name is
a fingerprint of all kernels.
"""

import hashlib
from importlib import resources
from pathlib import Path


def fingerprint() -> str:
    """Return a short hash of the sources of all kernels."""
    digest = hashlib.sha256()
    folder = Path(str(resources.files("app.sim")))
    sources = {
        *folder.glob("**/kernels/*.py"),
        *folder.glob("core/*.py"),
        *folder.glob("geometry/*.py"),
    }
    for source in sorted(sources):
        name = source.relative_to(folder).as_posix()
        digest.update(name.encode() + b"\0" + source.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def kernel_cache(data: Path) -> Path:
    """Return the folder for numba's cache (``NUMBA_CACHE_DIR``) under the data folder."""
    return data.resolve() / "kernels" / fingerprint()
