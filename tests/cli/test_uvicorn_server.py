"""How the server ends at signals."""

import signal
import threading
from types import SimpleNamespace

from fastapi import FastAPI

from app.cli.uvicorn_server import new_server


def test_a_signal_during_the_handler_of_the_first_one_does_not_wait_for_it() -> None:
    """The first handler holds the lock of the event that a second one must not ask for."""
    app, lock, set_by = FastAPI(), threading.Lock(), []
    server = new_server(app)

    class Stopping:
        def set(self) -> None:
            with lock:
                set_by.append(threading.current_thread().name)
                server.handle_exit(signal.SIGTERM, None)

    app.state.services = SimpleNamespace(stopping=Stopping())
    handler = threading.Thread(
        target=server.handle_exit, args=(signal.SIGTERM, None), name="first", daemon=True
    )
    handler.start()
    handler.join(10.0)
    assert not handler.is_alive()
    assert set_by == ["first"] and server.should_exit
