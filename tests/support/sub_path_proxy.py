"""A reverse proxy on loopback that shows a server below a path and removes it from requests."""

import re
import socket
import socketserver
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from urllib.parse import urlsplit

PREFIX = "/robots/tandem"
_REQUEST = re.compile(rb"(GET|HEAD|POST|PUT|DELETE) (/[^ ]*) HTTP/1\.1\r\n")


@contextmanager
def below_path(address: str, outside_paths: list[str]) -> Iterator[str]:
    """Show a server below ``PREFIX``; yields the address of its page.

    Args:
        address: The server's own.
        outside_paths: Filled with the requested paths outside ``PREFIX``; they get 404.
    """
    target = urlsplit(address)

    def shorten(found: re.Match[bytes]) -> bytes:
        path = found[2].decode()
        if not path.startswith(f"{PREFIX}/"):
            outside_paths.append(path)
            path = f"{PREFIX}/nothing-here"
        return found[1] + b" " + path.removeprefix(PREFIX).encode() + b" HTTP/1.1\r\n"

    def copy(source: socket.socket, sink: socket.socket, *, requests: bool) -> None:
        with suppress(OSError):
            while data := source.recv(65536):
                sink.sendall(_REQUEST.sub(shorten, data) if requests else data)
        for end in (source, sink):
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

    class Handler(socketserver.BaseRequestHandler):
        def handle(self) -> None:
            with socket.create_connection((target.hostname, target.port)) as server:
                ends = (server, self.request)
                back = threading.Thread(target=copy, args=ends, kwargs={"requests": False})
                back.start()
                copy(self.request, server, requests=True)
                back.join()

    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), Handler) as proxy:
        thread = threading.Thread(target=proxy.serve_forever)
        thread.start()
        try:
            yield f"http://127.0.0.1:{proxy.server_address[1]}{PREFIX}"
        finally:
            proxy.shutdown()
            thread.join()
