"""Checks before the server loads anything else: its port and its database are unused."""

import errno
import ipaddress
import socket
from contextlib import closing

from app.errors import Conflict, InvalidInput
from app.settings import Settings, make_data_folder
from app.store.database.lease import Lease
from app.store.database.lock import ServerLock
from app.store.engine import Store

BACKLOG = 128


def listen(host: str, port: int) -> socket.socket:
    """Bind an address or name and a port, 0 for any free one, and listen.

    Raises:
        Conflict: Another program listens there.
        InvalidInput: This machine has no such address, or the port needs other rights.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
    except (socket.gaierror, UnicodeError):  # no name has such a label
        raise InvalidInput("TANDEM_HOST", host, "is not an address of this machine") from None
    sock = socket.socket(family, kind, protocol)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        sock.bind(address)
        sock.listen(BACKLOG)
    except OSError as error:
        sock.close()
        raise _explained(error, host, port) from None
    return sock


def address_of(sock: socket.socket) -> str:
    """Return the URL of a listening socket for a browser on this machine."""
    host, port = sock.getsockname()[:2]
    if ipaddress.ip_address(host).is_unspecified:
        host = "127.0.0.1"
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"


def check_database_unused(settings: Settings) -> None:
    """Check that no other server uses the data folder or the database.

    Raises:
        Conflict: Another server does.
    """
    make_data_folder(settings)
    with closing(Store(settings.database)) as store:
        lock = ServerLock(store, settings.data)
        try:
            lock.acquire()
            Lease(store, lock).check()
        finally:
            lock.release()


def _explained(error: OSError, host: str, port: int) -> Conflict | InvalidInput:
    if error.errno == errno.EADDRINUSE:
        return Conflict(
            f"another program already listens on {host}:{port}; stop it, or choose another "
            "port with TANDEM_PORT"
        )
    if error.errno == errno.EACCES:
        return InvalidInput("TANDEM_PORT", port, "needs rights that this user does not have")
    return InvalidInput("TANDEM_HOST", host, f"cannot be listened on: {error.strerror}")
