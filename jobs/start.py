"""Start of a child process: ``python -m jobs.start --parent PID MODULE ARGUMENT...``.

Requests the parent-death signal, then calls ``main`` of the module. It imports nothing but the
standard library, so that the request precedes the seconds in which a worker imports its
libraries.
"""

import ctypes
import gc
import importlib
import os
import signal
import sys
from collections.abc import Sequence

_PR_SET_PDEATHSIG = 1


def child_command(module: str, *arguments: str) -> tuple[str, ...]:
    """Return the command that runs a module in a process that ends with this one."""
    parent = ("--parent", str(os.getpid()))
    return (sys.executable, "-m", "jobs.start", *parent, module, *arguments)


def die_with_parent(parent: int) -> None:
    """Request the kernel to kill this process when the server, process ``parent``, ends.

    Linux only; elsewhere fencing alone prevents writes of a left-over worker.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it ended before the request
        raise SystemExit(f"the server (process {parent}) is gone")


def main(arguments: Sequence[str]) -> None:
    """Call ``main`` of the module of the command line in this process."""
    _, parent, name, *others = arguments
    die_with_parent(int(parent))
    sys.argv[1:] = others
    gc.disable()  # a sixth of the time of imports: they make many objects and drop few
    module = importlib.import_module(name)
    gc.enable()
    sys.exit(module.main())


if __name__ == "__main__":
    main(sys.argv[1:])
