"""A service whose supervisor and live cells have not been started."""

from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

from fastapi import FastAPI
from opentelemetry.trace import NoOpTracer

from app.api.application import build_app
from app.api.metrics import Metrics
from app.api.registry import DEFAULT_ALIAS, CheckpointNames, PolicyRegistry
from app.api.services import LiveWorld, Services
from app.main import STATIC, acting_in, assemble, build_task_policy
from app.policies.checkpoints import pretrained
from app.policies.checkpoints.checkpoint import Checkpoint
from app.sim.cells.cell import load_cell
from app.sim.pick.task_policy import TaskPolicy
from app.store.engine import Store
from app.store.records import NewCheckpoint
from jobs.checkpoints import to_store
from jobs.recording_catalog import RecordingCatalog
from jobs.retention import Retention
from jobs.supervisor import Supervisor
from web.viewer.loop import LiveCell

SEEDS = count(5000)


def idle_service(store: Store, data_dir: Path) -> Services:
    """Return the parts that routes use, without a live world."""
    worlds: dict[str, LiveWorld] = {}
    names = CheckpointNames(store)
    retention = Retention(
        store=store,
        logs=data_dir / "logs",
        keep_jobs=1000,
        keep_states=5,
        acting=lambda: acting_in(worlds),
        on_removed=names.forget,
    )
    return assemble(
        Supervisor(store, data_dir),
        retention,
        RecordingCatalog(store),
        names,
        data=data_dir,
        worlds=worlds,
        metrics=Metrics("test"),
        tracer=NoOpTracer(),
    )


def app_of(parts: Services, token: str | None = None) -> FastAPI:
    """Return the routes of a service; requests need the token, if there is one."""

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        app.state.services = parts
        yield
        parts.stopping.set()

    return build_app(
        lifespan=lifespan,
        static=STATIC,
        token=token,
        version="test",
        counts=parts.metrics,
        traces=None,
    )


def own_policy() -> NewCheckpoint:
    """Return a copy of a shipped policy, as one of a user's own."""
    found = pretrained.load("pick")
    return to_store(Checkpoint({**found.manifest, "seed": next(SEEDS)}, found.tensors))


def add_world(services: Services) -> None:
    """Add a live world with an idle robot, which has not been started."""
    services.worlds["main"] = LiveCell(load_cell("pick-and-place"), None)


def loading(services: Services, meanwhile: Callable[[], object]) -> Services:
    """Return the services with a call after each reading of a task policy."""

    def build(manifest: Mapping[str, Any], tensors: bytes) -> TaskPolicy:
        meanwhile()
        return build_task_policy(manifest, tensors)

    policies = PolicyRegistry(services.checkpoints, build, DEFAULT_ALIAS)
    return replace(services, task_policies=policies)
