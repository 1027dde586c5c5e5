"""Removal of compiled kernels that earlier versions have left in the data folder."""

import os
import re
import shutil
import time
from contextlib import suppress
from pathlib import Path

KEEP_S = 30 * 24 * 3600.0
"""Time for which the kernels of a version are kept after its last start [s]."""
_VERSION = re.compile(r"[0-9a-f]{16}")
"""Name of the folder of a version: the fingerprint of its kernels."""


def remove_unused(used: Path) -> None:
    """Delete the folders of versions that no server has started for ``KEEP_S``.

    The time of a folder is that of the last start with its kernels. A server that runs for
    longer has loaded them; its later workers compile them again. Folders that cannot be changed
    stay.

    Args:
        used: Folder of the kernels of this process; those of other versions lie beside it.
    """
    with suppress(OSError):
        os.utime(used)
    for other in used.parent.glob("*"):
        with suppress(OSError):
            is_old = time.time() - other.stat().st_mtime > KEEP_S
            if is_old and other != used and _VERSION.fullmatch(other.name):
                shutil.rmtree(other)
