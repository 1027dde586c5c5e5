"""Composition root: creates the parts of the service.

``create_app`` builds the HTTP application around a :class:`Service`, which opens the store,
starts the supervisor, compiles the kernels on a thread and then starts the live cell. Several
applications may exist in one process.
"""

import gc
import importlib.util
import logging
import threading
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import numpy as np
from fastapi import FastAPI
from opentelemetry.trace import NoOpTracerProvider, Tracer, TracerProvider
from starlette.concurrency import run_in_threadpool

import web
from app.api.application import build_app
from app.api.known_people import warm_up
from app.api.metrics import Metrics
from app.api.registry import (
    DEFAULT_ALIAS,
    REACH_ALIAS,
    SORTING_ALIASES,
    CheckpointNames,
    PolicyRegistry,
)
from app.api.services import LiveWorld, ResponseCache, Services
from app.api.state_metrics import StateMetrics
from app.errors import Damaged, InvalidInput, MissingPackage, NotReady, ServiceError
from app.live.reach.interfaces import LiveReachPolicy
from app.policies.checkpoints import pretrained
from app.policies.checkpoints.checkpoint import CHOOSING, SORTING, load, require_purpose
from app.policies.checkpoints.trained_cell import cell_of
from app.policies.inference.motion_decision import MotionDecider
from app.policies.inference.reach_policy import ReachPolicy
from app.policies.inference.sorting_policy import SortingPolicy
from app.policies.inference.task_selection import TaskChooser
from app.provenance import VERSION
from app.settings import Settings, check_access, make_data_folder
from app.sim.cells.cell import Cell, load_cell
from app.sim.core.kernel_cache import kernel_cache
from app.sim.pick.task_policy import TaskPolicy
from app.sim.sorting.decision import warm_up as warm_up_sorting
from app.sim.sorting.sorting_values import SortingValues
from app.storage_errors import StorageDamaged, StorageFull, StorageUnavailable
from app.store.checkpoints import find_damaged
from app.store.database.backup import remove_unfinished
from app.store.engine import Store
from app.unused_kernels import remove_unused
from jobs.cell_catalog import CellCatalog
from jobs.checkpoints import shipped
from jobs.composed.reports import Reports
from jobs.composed.sweeps import Sweeps
from jobs.executor import LocalExecutor
from jobs.import_process import ImportProcess
from jobs.recording_catalog import RecordingCatalog
from jobs.remote.uploads import WorkerUploads
from jobs.retention import Retention
from jobs.supervisor import Supervisor
from jobs.timeouts import Timeouts
from web.viewer.loop import LiveCell

logger = logging.getLogger(__name__)

WORLD_ID = "main"
LIVE_CELL = "pick-and-place"
STOP_S = 5.0
"""Time for the compilation of kernels to end when the service stops [s]."""
RETRY_S = 1.0
"""Time from a failed write of the start to its repetition [s]."""
RAY_SHUTDOWN_S = 30.0
"""Time for the last checkpoints of workers on a Ray cluster when the service stops [s]."""
STATIC = Path(web.__file__).parent / "page"


def create_app(settings: Settings, traces: TracerProvider | None = None) -> FastAPI:
    """Return the application; its lifespan starts and stops the service.

    Args:
        settings: Where and how the service runs.
        traces: Receives the spans; None: none are made.

    Raises:
        InvalidInput: The settings give unprotected access.
    """
    check_access(settings)
    counts = Metrics(VERSION)
    tracer = (traces or NoOpTracerProvider()).get_tracer("tandem", VERSION)

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        try:
            service = await run_in_threadpool(Service, settings, counts, tracer)
        except ServiceError as error:
            app.state.failure = error
            raise
        app.state.services = service.parts
        try:
            yield
        finally:
            service.parts.stopping.set()
            await run_in_threadpool(service.close)

    return build_app(
        lifespan=lifespan,
        static=STATIC,
        token=settings.secret,
        version=VERSION,
        counts=counts,
        traces=traces,
    )


class Service:
    """The running parts of one application.

    Raises:
        Conflict: Another server uses the same database.
    """

    def __init__(self, settings: Settings, counts: Metrics, tracer: Tracer) -> None:
        make_data_folder(settings)
        store = Store(settings.database)
        worlds: dict[str, LiveWorld] = {}
        names = CheckpointNames(store)
        retention = Retention(
            store=store,
            logs=settings.data.absolute() / "logs",
            keep_jobs=settings.keep_jobs,
            keep_states=settings.keep_states,
            acting=lambda: acting_in(worlds),
            on_removed=names.forget,
        )
        supervisor = Supervisor(
            store,
            settings.data,
            max_running=settings.max_jobs,
            executor=executor_of(settings, store.url),
            timeouts=Timeouts(shutdown_s=RAY_SHUTDOWN_S) if settings.ray else None,
            retention=retention,
            tracer=tracer,
        )
        supervisor.composed = Sweeps(), Reports()
        supervisor.on_lease, supervisor.on_tick = names.refresh, names.forget_unstored
        self._imports = ImportProcess()
        recordings = RecordingCatalog(store, self._imports)
        try:
            supervisor.start()
            remove_unfinished(store, settings.data)
            self.parts = assemble(
                supervisor,
                retention,
                recordings,
                names,
                data=settings.data,
                worlds=worlds,
                metrics=counts,
                tracer=tracer,
            )
        except BaseException:
            supervisor.stop()
            store.close()
            raise
        counts.watch(StateMetrics(self.parts))
        self._warm_up = threading.Thread(target=self._start_cell, name="warm-up", daemon=True)
        self._warm_up.start()

    def close(self) -> None:
        """Stop the live cell and the supervisor, close the database."""
        self.parts.stopping.set()
        self._imports.stop()
        self._warm_up.join(STOP_S)
        self.parts.readiness.ready = False
        self.parts.readiness.reason = "stopping"
        with self.parts.replacing:
            for world in self.parts.worlds.values():
                world.stop()
            self.parts.worlds.clear()
        self.parts.supervisor.stop()
        self.parts.store.close()
        gc.unfreeze()

    def _start_cell(self) -> None:
        """Compile the kernels and start the live cell; update ``readiness``."""
        readiness = self.parts.readiness
        try:
            readiness.reason = "warming up: loading the shipped checkpoints"
            self._store_shipped()
            readiness.reason = "warming up: compiling the simulator's kernels"
            policy = self.parts.task_policies.load(DEFAULT_ALIAS)
            warm_up(load_cell(LIVE_CELL))
            warm_up_sorting()
            for name in SORTING_ALIASES:
                warm_up_sorting(self.parts.sorting_policies.load(name))
            self.parts.reach_policies.load(REACH_ALIAS)
            cell = LiveCell(load_cell(LIVE_CELL), policy, id=WORLD_ID)
            if self.parts.stopping.is_set():
                return
            cell.start()
            self.parts.worlds[WORLD_ID] = cell
            # A full collection of all that was imported stops the server for half a second.
            gc.collect()
            gc.freeze()
            readiness.ready, readiness.reason = True, "ready"
            logger.info("ready: %s decides in the live cell", policy.title)
            remove_unused(kernel_cache(self.parts.data))
            self._look_for_damage()
        except ServiceError as error:
            readiness.failed, readiness.reason = True, error.message
            logger.error("the live cell could not start: %s", error.message)
        except Exception as error:
            readiness.failed, readiness.reason = True, f"the start failed: {error}"
            logger.exception("the live cell could not start")

    def _store_shipped(self) -> None:
        """Store the shipped checkpoints; waits while the database takes no writes."""
        while not self.parts.stopping.is_set():
            try:
                publish_shipped(self.parts.checkpoints)
            except StorageDamaged:
                raise
            except (StorageFull, StorageUnavailable) as error:
                self.parts.readiness.reason = f"warming up: waiting, {error.short}"
                self.parts.stopping.wait(RETRY_S)
            else:
                return
        raise NotReady("stopping")

    def _look_for_damage(self) -> None:
        """Record the damaged checkpoints of the store."""
        names = self.parts.checkpoints
        for damage in find_damaged(names.store):
            if self.parts.stopping.is_set():
                return
            if damage is not None:
                names.mark_damaged(damage)


def executor_of(settings: Settings, database_url: str) -> LocalExecutor:
    """Return the executor of jobs: a Ray cluster, or processes of this machine.

    Args:
        settings: Where and how the service runs.
        database_url: The database, with an absolute path: workers have another folder.

    Raises:
        MissingPackage: Ray is not installed.
        InvalidInput: Workers cannot know the address of this server.
    """
    data = settings.data
    if settings.ray is None:
        return LocalExecutor(database_url, data)
    if importlib.util.find_spec("ray") is None:
        raise MissingPackage("ray", "TANDEM_RAY", "install the extra 'ray'")
    unknown = settings.host in ("0.0.0.0", "::") or settings.port == 0
    if settings.worker_url is None and unknown:
        rule = "must be set for TANDEM_RAY: workers cannot know the address of this server"
        raise InvalidInput("TANDEM_WORKER_URL", None, rule)
    given = {"TANDEM_RAY": settings.ray, "TANDEM_WORKER_URL": settings.worker_address}
    if settings.secret is not None:
        given["TANDEM_TOKEN"] = settings.secret
    return LocalExecutor(database_url, data, "jobs.remote.ray_driver", given)


def assemble(
    supervisor: Supervisor,
    retention: Retention,
    recordings: RecordingCatalog,
    names: CheckpointNames,
    *,
    data: Path,
    worlds: dict[str, LiveWorld],
    metrics: Metrics,
    tracer: Tracer,
) -> Services:
    """Return the parts that routes use, on a database with all tables.

    Args:
        supervisor: Runs the jobs.
        retention: Removes ended jobs of the database, and reports it to ``names``.
        data: The data folder.
        worlds: Live worlds by id.
        metrics: Metrics of the application.
        tracer: Makes the spans of decisions.
    """
    store = retention.store
    names.acting = lambda: acting_in(worlds)
    return Services(
        store=store,
        response_cache=ResponseCache(store),
        supervisor=supervisor,
        retention=retention,
        data=data,
        worker_uploads=WorkerUploads(store, data),
        worlds=worlds,
        checkpoints=names,
        task_policies=PolicyRegistry(names, build_task_policy, DEFAULT_ALIAS),
        sorting_policies=PolicyRegistry(names, build_sorting_policy, SORTING_ALIASES[0]),
        reach_policies=PolicyRegistry(names, build_reach_policy, REACH_ALIAS),
        cells=CellCatalog(store),
        recordings=recordings,
        start_world=start_world,
        metrics=metrics,
        tracer=tracer,
    )


def acting_in(worlds: Mapping[str, LiveWorld]) -> dict[str, str]:
    """Return the SHA-256 of each checkpoint that acts, or soon will, with its live world."""
    handles = [world.handle for world in tuple(worlds.values())]
    return {sha256: f"world {one.id}" for one in handles for sha256 in one.acting}


def start_world(
    world_id: str,
    cell: Cell,
    policy: TaskPolicy | None,
    sorting_policy: SortingValues | None = None,
    reach_policy: LiveReachPolicy | None = None,
) -> LiveCell:
    """Start a live cell with its viewer; the caller stops it."""
    live = LiveCell(
        cell, policy, id=world_id, sorting_policy=sorting_policy, reach_policy=reach_policy
    )
    live.start()
    return live


def build_task_policy(manifest: Mapping[str, Any], tensors: bytes) -> TaskPolicy:
    """Return the task-selection policy of a checkpoint, whose numbers are finite."""
    checkpoint = load(manifest, tensors)
    require_purpose(checkpoint, CHOOSING)
    with np.errstate(all="ignore"):  # numbers that overflow are refused
        policy = TaskChooser(checkpoint)
        policy.require_finite()
    return policy


def build_sorting_policy(manifest: Mapping[str, Any], tensors: bytes) -> SortingValues:
    """Return the sorting policy of a checkpoint, whose values are finite."""
    checkpoint = load(manifest, tensors)
    require_purpose(checkpoint, SORTING)
    policy = SortingPolicy(checkpoint)
    policy.require_finite()
    return policy


def build_reach_policy(manifest: Mapping[str, Any], tensors: bytes) -> MotionDecider:
    """Return the reach policy of a checkpoint, with compiled kernels and finite actions."""
    actor = ReachPolicy(load(manifest, tensors))
    decider = MotionDecider(actor, cell_of(manifest))
    with np.errstate(all="ignore"):  # actions that overflow are refused
        decider.warm_up()
    return decider


def publish_shipped(names: CheckpointNames) -> None:
    """Store the shipped checkpoints under their aliases.

    Damaged ones in the store are replaced; for a damaged file of the package the stored one is
    used.

    Raises:
        NotFound: A file of the package is damaged, and the checkpoint is not stored.
    """
    for alias, sha256 in pretrained.SHA256.items():
        try:
            names.publish(alias, shipped(alias))
        except Damaged as error:
            names.mark_damaged(error)
            names.point(alias, sha256)
