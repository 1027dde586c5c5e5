"""The routes of the service on a real port, without its live cell and its supervisor."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from app.api.services import Services
from app.store.engine import Store
from tests.api.live_server import running
from tests.support.idle_service import app_of, idle_service

TOKEN = "a-token-of-some-length"


@contextmanager
def serving(store: Store, data_dir: Path) -> Iterator[tuple[str, Services]]:
    """Yield the address of a server of the routes, and the parts that they use."""
    parts = idle_service(store, data_dir)
    with running(app_of(parts, TOKEN)) as (_, address):
        yield address, parts
