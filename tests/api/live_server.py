"""A real server on a real port, for what needs one: streams, sockets, an orderly end."""

import contextlib
import threading
import time
from collections.abc import Iterator

from fastapi import FastAPI

from app.cli.preflight import address_of, listen
from app.cli.uvicorn_server import Server, new_server
from tests.support import patient_http

START_S = 30.0
WARM_UP_S = 900.0
"""On a loaded machine, with every kernel to compile [s]."""


@contextlib.contextmanager
def running(app: FastAPI, *, root_path: str = "") -> Iterator[tuple[Server, str]]:
    """Run ``app`` on a free port; yields the server and its address."""
    sock = listen("127.0.0.1", 0)
    server = new_server(app, root_path=root_path)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [sock]})
    thread.start()
    give_up = time.monotonic() + START_S
    while not server.started:
        assert thread.is_alive() and time.monotonic() < give_up
        time.sleep(0.02)
    try:
        yield server, address_of(sock)
    finally:
        server.handle_exit(0, None)
        thread.join(timeout=30.0)
        assert not thread.is_alive()


def wait_until_ready(address: str, headers: dict[str, str] | None = None) -> None:
    """Wait for the kernels and the live cell."""
    give_up = time.monotonic() + WARM_UP_S
    url = f"{address}/readyz"
    while (answer := patient_http.get(url, headers=headers)).status_code != 200:
        assert time.monotonic() < give_up, answer.text
        time.sleep(0.05)
