"""A reverse proxy on loopback that answers some requests by an error of its own."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.client import HTTPConnection
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer


class FailingProxy:
    """A running proxy."""

    def __init__(self) -> None:
        self.address = ""
        """Its address."""
        self.failures: list[int] = []
        """Statuses of the next answers, which reach no server; further requests do."""


@contextmanager
def failing_proxy(address: str) -> Iterator[FailingProxy]:
    """Show a server at an address of its own; yields the proxy."""
    proxy = FailingProxy()

    class Forwarder(BaseHTTPRequestHandler):
        def forward(self) -> None:
            body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
            if proxy.failures:
                self.answer(proxy.failures.pop(0), b"")
                return
            server = HTTPConnection(address.removeprefix("http://"))
            server.request(self.command, self.path, body, dict(self.headers))
            found = server.getresponse()
            self.answer(found.status, found.read(), found.getheader("Content-Type", ""))
            server.close()

        do_GET = do_POST = do_PUT = forward

        def answer(self, status: int, content: bytes, kind: str = "text/plain") -> None:
            self.send_response(status)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(content)))
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, format: str, *args: object) -> None:
            """Write nothing."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Forwarder) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        proxy.address = f"http://127.0.0.1:{server.server_address[1]}"
        try:
            yield proxy
        finally:
            server.shutdown()
            thread.join()
