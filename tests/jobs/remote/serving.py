"""The routes of the service on a real port, without its live cell and its supervisor."""

from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path

from fastapi import FastAPI
from opentelemetry.trace import NoOpTracer

from app.api.application import build_app
from app.api.metrics import Metrics
from app.api.services import Services
from app.main import STATIC, assemble
from app.store.engine import Store
from jobs.recording_catalog import RecordingCatalog
from jobs.retention import Retention
from jobs.supervisor import Supervisor
from tests.api.live_server import running

TOKEN = "a-token-of-some-length"


@contextmanager
def serving(store: Store, data_dir: Path) -> Iterator[tuple[str, Services]]:
    """Yield the address of a server of the routes, and the parts that they use."""
    counts = Metrics("test")
    retention = Retention(
        store=store, logs=data_dir / "logs", keep_jobs=1000, keep_states=5, acting=dict
    )
    parts = assemble(
        Supervisor(store, data_dir),
        retention,
        RecordingCatalog(store),
        data=data_dir,
        worlds={},
        metrics=counts,
        tracer=NoOpTracer(),
    )

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
        counts=counts,
        traces=None,
    )
    with running(app) as (_, address):
        yield address, parts
