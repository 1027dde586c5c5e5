"""The TCP ports on which this process listens, as the kernel says (Linux)."""

import os
from pathlib import Path

LISTEN = "0A"


def listening_ports() -> set[int]:
    """Return the ports of this process's listening sockets, IPv4 and IPv6."""
    own = set()
    for link in Path("/proc/self/fd").iterdir():
        try:
            own.add(os.readlink(link))
        except OSError:
            continue  # closed since it was listed
    ports = set()
    for table in ("tcp", "tcp6"):
        path = Path("/proc/self/net") / table
        for row in path.read_text().splitlines()[1:] if path.exists() else ():
            fields = row.split()
            if fields[3] == LISTEN and f"socket:[{fields[9]}]" in own:
                ports.add(int(fields[1].rsplit(":", 1)[1], 16))
    return ports
