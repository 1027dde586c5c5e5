"""Parts of the service that routes use; ``app.main`` creates them."""

import threading
from collections.abc import Callable, Hashable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Protocol

from fastapi import Depends
from opentelemetry.trace import NoOpTracer, Tracer
from starlette.concurrency import run_in_threadpool
from starlette.requests import HTTPConnection

from app.api.metrics import Metrics
from app.api.motion.load import MotionLoad
from app.api.registry import CheckpointNames, PolicyRegistry
from app.api.schemas.worlds import FollowPublic
from app.api.tracker_sessions import TrackerSessions
from app.errors import InvalidInput, NotFound, NotReady
from app.live.lateness import Lateness
from app.live.reach.interfaces import LiveReachPolicy
from app.live.world_handle import WorldHandle
from app.policies.inference.motion_decision import MotionDecider
from app.sim.cells.cell import Cell, cell_names
from app.sim.pick.task_policy import TaskPolicy
from app.sim.sorting.sorting_values import SortingValues
from app.store.engine import Store
from jobs.cell_catalog import CellCatalog
from jobs.recording_catalog import RecordingCatalog
from jobs.remote.uploads import WorkerUploads
from jobs.retention import Retention
from jobs.supervisor import Supervisor

MAX_UPLOADS = 4
"""Largest number of uploads at once; each file is held in memory."""
MAX_VIEWERS = 16
"""Largest number of open 3D viewers."""
MAX_CACHED_RESPONSES = 64
"""Largest number of responses that are kept until the next commit."""


class LiveWorld(Protocol):
    """A live world and its viewer; implemented by ``web.viewer.loop.LiveCell``."""

    @property
    def handle(self) -> WorldHandle:
        """Commands in, snapshots out."""

    @property
    def cell(self) -> Cell:
        """Its work cell."""

    @property
    def lateness(self) -> Lateness:
        """Lateness of its ticks."""

    @property
    def viewer_address(self) -> Path:
        """Unix socket of its 3D viewer."""

    def stop(self) -> None:
        """Stop the world and its viewer."""


StartWorld = Callable[
    [str, Cell, TaskPolicy | None, SortingValues | None, LiveReachPolicy | None], LiveWorld
]
"""Starts a world: its id, cell, and policies for task selection, sorting and reaching. The
caller stops it."""


@dataclass(slots=True)
class Readiness:
    """State of the start; written by one thread, read by all."""

    ready: bool = False
    """Whether the service can decide."""
    reason: str = "starting"
    """Present activity, or the reason why it cannot decide, as text."""
    failed: bool = False
    """Whether the start failed."""

    def require(self) -> None:
        """Check that the service can decide.

        Raises:
            NotReady: It cannot; contains the reason.
        """
        if not self.ready:
            raise NotReady(self.reason)


@dataclass(slots=True)
class Follows:
    """Trainings that live worlds follow (``app.api.following``)."""

    by_world: dict[str, tuple[FollowPublic, LiveWorld, int]] = field(default_factory=dict)
    """What each world follows or has followed, with the world and its expected ``choices``."""
    lock: threading.RLock = field(default_factory=threading.RLock)
    """Held while one of them changes."""
    thread: threading.Thread | None = None
    """Looks for newer checkpoints; None while nothing is followed."""

    def of(self, world_id: str) -> FollowPublic | None:
        """Return what a world follows or has followed; None for nothing."""
        found = self.by_world.get(world_id)
        return None if found is None else found[0]


@dataclass(slots=True)
class ResponseCache:
    """Cache of responses, until the next commit of the database; empty on PostgreSQL."""

    store: Store
    """The database."""
    entries: dict[Hashable, bytes] = field(default_factory=dict)
    """Responses by what they depend on beside the database."""
    commit: int | None = None
    """Number of the commit for which they hold."""

    async def find(self, key: Hashable, read: Callable[[], bytes]) -> bytes:
        """Return a response; called on the event loop.

        Args:
            key: Everything that the response depends on beside the database.
            read: Reads the response, on a thread.
        """
        commit = self.store.commit_number()
        if commit is None or commit != self.commit or len(self.entries) >= MAX_CACHED_RESPONSES:
            self.entries.clear()
        self.commit = commit
        found = self.entries.get(key)
        if found is None:
            found = await run_in_threadpool(read)
            if commit is not None and commit == self.commit:
                self.entries[key] = found
        return found


@dataclass(slots=True, kw_only=True)
class Services:
    """Parts of the service that routes use."""

    store: Store
    """The database."""
    response_cache: ResponseCache
    """Responses read from the database."""
    supervisor: Supervisor
    """Runs the jobs; woken when one is posted."""
    retention: Retention
    """Removes ended jobs."""
    data: Path
    """The data folder."""
    worker_uploads: WorkerUploads
    """Stores what workers on other machines send."""
    checkpoints: CheckpointNames
    """Stored checkpoints by name."""
    task_policies: PolicyRegistry[TaskPolicy]
    """Loaded policies for task selection."""
    sorting_policies: PolicyRegistry[SortingValues]
    """Loaded policies for sorting."""
    reach_policies: PolicyRegistry[MotionDecider]
    """Loaded policies for reaching."""
    cells: CellCatalog
    """Work cells by name."""
    recordings: RecordingCatalog
    """Recordings of human motion by name."""
    start_world: StartWorld
    """Starts a live world."""
    tracer: Tracer
    """Makes the spans of decisions."""
    metrics: Metrics
    """Counts decisions."""
    worlds: dict[str, LiveWorld] = field(default_factory=dict)
    """Live worlds by id; empty until the kernels are compiled."""
    follows: Follows = field(default_factory=Follows)
    """Trainings that live worlds follow."""
    trackers: TrackerSessions = field(default_factory=TrackerSessions)
    """Open trackers."""
    readiness: Readiness = field(default_factory=Readiness)
    """Whether the service can decide."""
    replacing: threading.Lock = field(default_factory=threading.Lock)
    """Held while a world is replaced, all are stopped, or a cell is removed."""
    uploads: threading.BoundedSemaphore = field(
        default_factory=lambda: threading.BoundedSemaphore(MAX_UPLOADS)
    )
    """Held during an upload."""
    motion_load: MotionLoad = field(default_factory=MotionLoad)
    """Load by motion sockets."""
    viewers: threading.BoundedSemaphore = field(
        default_factory=lambda: threading.BoundedSemaphore(MAX_VIEWERS)
    )
    """Held by every open viewer."""
    stopping: threading.Event = field(default_factory=threading.Event)
    """Set when the server stops; open streams end."""

    @contextmanager
    def upload(self) -> Iterator[None]:
        """Hold one of the uploads.

        Raises:
            NotReady: All are held.
        """
        if not self.uploads.acquire(blocking=False):
            raise NotReady(f"{MAX_UPLOADS} files are being read: send it again in a moment")
        try:
            yield
        finally:
            self.uploads.release()

    def span(self, name: str) -> AbstractContextManager[object]:
        """Return a context with a span of this name; without traces none is made."""
        if isinstance(self.tracer, NoOpTracer):
            return nullcontext()
        return self.tracer.start_as_current_span(name)

    def world(self, world_id: str) -> LiveWorld:
        """Return a live world.

        Raises:
            NotReady: The kernels are not compiled yet.
            NotFound: There is no such world.
        """
        found = self.worlds.get(world_id)
        if found is None:
            self.readiness.require()
            raise NotFound("world", world_id, tuple(self.worlds))
        return found

    async def known_cell(self, name: str) -> Cell:
        """Return the cell a request names; a shipped one without disk access.

        Raises:
            InvalidInput: No cell has that name.
        """
        if name in cell_names():
            return self.cells.get(name)
        return await run_in_threadpool(self.named_cell, name)

    def named_cell(self, name: str) -> Cell:
        """Return the cell a request names, as :meth:`known_cell` does, on a thread."""
        try:
            return self.cells.get(name)
        except NotFound as error:
            raise InvalidInput("cell", name, "is not a known work cell", error.known) from None


def services_of(connection: HTTPConnection) -> Services:
    """Return the services of the application that handles a connection."""
    services: Services = connection.app.state.services
    return services


async def _services(connection: HTTPConnection) -> Services:
    return services_of(connection)  # FastAPI runs a plain function on a thread


ServicesDep = Annotated[Services, Depends(_services)]
