"""The process of one attempt on a node of a Ray cluster: an actor that starts and watches it.

The process reaches the service over HTTP. It ends with the actor, which ends with the driver on
the server's machine (``jobs.remote.ray_driver``).
"""

import os
import socket
from collections.abc import Mapping
from pathlib import Path

from app.provenance import describe
from app.sim.core.kernel_cache import kernel_cache
from app.store.records import Claim
from app.temporary_folder import TemporaryFolder
from jobs.executor import PROJECT_ROOT, LocalExecutor


class NodeWorker:
    """Starts, polls and stops one process; methods are called one after another.

    Args:
        settings: Settings of the process, by variable: address and token of the service.
    """

    def __init__(self, claim: Claim, settings: Mapping[str, str]) -> None:
        data = Path(os.environ.get("TANDEM_DATA", PROJECT_ROOT / "data"))
        os.environ.setdefault("NUMBA_CACHE_DIR", str(kernel_cache(data)))
        self._folder = TemporaryFolder("tandem-worker-")
        self._executor = LocalExecutor(None, self._folder.path, "jobs.remote.run", settings)
        self._handle = self._executor.start(claim)
        self._read = 0

    def about(self) -> tuple[str, object]:
        """Return the name of the node and the commit of its program."""
        return socket.gethostname(), describe()["commit"]

    def poll(self) -> tuple[bytes, int | None]:
        """Return the output since the last call, and the exit status; None while it runs."""
        ended = self._executor.poll(self._handle)
        with self._handle.log.open("rb") as log:
            log.seek(self._read)
            output = log.read()
        self._read += len(output)
        if ended is None:
            return output, None
        self._folder.close()
        return output, ended.code

    def stop(self) -> None:
        """Stop the process at its next step."""
        self._executor.stop(self._handle, force=False)
