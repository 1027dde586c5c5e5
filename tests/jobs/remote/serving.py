"""The routes of the service on a real port, without its live cell and its supervisor."""

from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path

from fastapi import FastAPI

from app.api.application import build_app
from app.api.services import Services
from app.main import STATIC
from app.store.engine import Store
from tests.api.live_server import running
from tests.support.idle_service import idle_service

TOKEN = "a-token-of-some-length"


@contextmanager
def serving(store: Store, data_dir: Path) -> Iterator[tuple[str, Services]]:
    """Yield the address of a server of the routes, and the parts that they use."""
    parts = idle_service(store, data_dir)

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        app.state.services = parts
        yield
        parts.stopping.set()

    app = build_app(
        lifespan=lifespan,
        static=STATIC,
        token=TOKEN,
        version="test",
        counts=parts.metrics,
        traces=None,
    )
    with running(app) as (_, address):
        yield address, parts
