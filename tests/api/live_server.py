"""A real server on a real port, for what needs one: streams, sockets, an orderly end."""

import contextlib
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from fastapi import FastAPI
from opentelemetry.trace import TracerProvider

from app.cli.preflight import address_of, listen
from app.cli.uvicorn_server import Server, new_server
from app.main import create_app
from app.settings import Settings
from tests.support import patient_http
from tests.support.waiting import wait_until

WARM_UP_S = 900.0
"""On a loaded machine, with every kernel to compile [s]."""


@contextlib.contextmanager
def running(
    app: FastAPI,
    *,
    host: str = "127.0.0.1",
    root_path: str = "",
    traces: TracerProvider | None = None,
) -> Iterator[tuple[Server, str]]:
    """Run ``app`` on a free port; yields the server and its address."""
    sock = listen(host, 0)
    server = new_server(app, root_path=root_path, traces=traces)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [sock]})
    thread.start()
    wait_until(lambda: server.started or not thread.is_alive())
    assert server.started
    try:
        yield server, address_of(sock)
    finally:
        server.handle_exit(0, None)
        thread.join(timeout=30.0)
        assert not thread.is_alive()


def wait_until_ready(address: str, headers: dict[str, str] | None = None) -> None:
    """Wait for the kernels and the live cell."""
    url = f"{address}/readyz"
    wait_until(lambda: patient_http.get(url, headers=headers).is_success, within_s=WARM_UP_S)


@contextlib.contextmanager
def served(data: Path, **settings: Any) -> Iterator[str]:
    """Run a whole service on a free port; yields its address once it is ready."""
    with running(create_app(Settings(data=data, **settings))) as (_, address):
        wait_until_ready(address)
        yield address
