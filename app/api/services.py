"""What the routes work with, handed over by ``app.main`` when it wires the service."""

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Protocol

from fastapi import Depends
from starlette.requests import HTTPConnection

from app.api.registry import CheckpointNames, PolicyRegistry
from app.api.tracker_sessions import TrackerSessions
from app.errors import NotFound, NotReady
from app.live.reach.interfaces import LiveReachPolicy
from app.live.world_handle import WorldHandle
from app.policies.inference.motion_decision import MotionDecider
from app.sim.cells.cell import Cell
from app.sim.pick.task_policy import TaskPolicy
from app.sim.sorting.sorting_values import SortingValues
from app.store.engine import Store
from jobs.cell_catalog import CellCatalog
from jobs.recording_catalog import RecordingCatalog
from jobs.supervisor import Supervisor

MAX_UPLOADS = 4
"""Most files that are taken in at once; each is held in memory."""
MAX_STREAMS = 16
"""Most sockets that ask for recording at once."""
MAX_VIEWERS = 16
"""Most 3D viewers that are open at once."""


class LiveWorld(Protocol):
    """One live world and its viewer; ``web.viewer.loop.LiveCell`` is one."""

    @property
    def handle(self) -> WorldHandle:
        """Commands in, snapshots out."""

    @property
    def cell(self) -> Cell:
        """The work cell it shows."""

    @property
    def viewer_address(self) -> Path:
        """Unix socket of its 3D viewer."""

    def stop(self) -> None:
        """End world and viewer."""


StartWorld = Callable[
    [str, Cell, TaskPolicy | None, SortingValues | None, LiveReachPolicy | None], LiveWorld
]
"""Starts a world of an id, in a cell, with what chooses tasks, sorts and reaches there; the
caller stops it."""


@dataclass(slots=True)
class Readiness:
    """How far the start has come; written by one thread, read by all."""

    ready: bool = False
    """Whether the service can decide."""
    reason: str = "starting"
    """What it is doing, or why it cannot, for people."""
    failed: bool = False
    """Whether the start broke off."""

    def require(self) -> None:
        """Raise unless the service can decide.

        Raises:
            NotReady: It cannot; says why.
        """
        if not self.ready:
            raise NotReady(self.reason)


@dataclass(slots=True, kw_only=True)
class Services:
    """The parts behind the routes."""

    store: Store
    """The database."""
    supervisor: Supervisor
    """Runs the jobs; is woken when one is posted."""
    checkpoints: CheckpointNames
    """The stored checkpoints by name."""
    policies: PolicyRegistry[TaskPolicy]
    """Those that choose tasks, as objects that decide."""
    sorters: PolicyRegistry[SortingValues]
    """Those that sort."""
    movers: PolicyRegistry[MotionDecider]
    """Those that move the arm to goals."""
    cells: CellCatalog
    """The work cells by name."""
    recordings: RecordingCatalog
    """The imported recorded human motion by name."""
    start_world: StartWorld
    """Starts a live world."""
    worlds: dict[str, LiveWorld] = field(default_factory=dict)
    """The live worlds by id; empty until the kernels are warm."""
    trackers: TrackerSessions = field(default_factory=TrackerSessions)
    """The trackers that are listened to."""
    readiness: Readiness = field(default_factory=Readiness)
    """Whether the service can decide."""
    replacing: threading.Lock = field(default_factory=threading.Lock)
    """Held by whoever starts a world anew, or stops them all."""
    uploads: threading.BoundedSemaphore = field(
        default_factory=lambda: threading.BoundedSemaphore(MAX_UPLOADS)
    )
    """Held by whoever posts a file."""
    motion_streams: threading.BoundedSemaphore = field(
        default_factory=lambda: threading.BoundedSemaphore(MAX_STREAMS)
    )
    """Held by every open socket that asks for recording."""
    viewers: threading.BoundedSemaphore = field(
        default_factory=lambda: threading.BoundedSemaphore(MAX_VIEWERS)
    )
    """Held by every open viewer."""
    stopping: threading.Event = field(default_factory=threading.Event)
    """Set when the server goes down: open streams end."""

    def world(self, world_id: str) -> LiveWorld:
        """Return a live world.

        Raises:
            NotReady: Worlds start once the kernels are warm.
            NotFound: There is no such world.
        """
        found = self.worlds.get(world_id)
        if found is None:
            self.readiness.require()
            raise NotFound("world", world_id, tuple(self.worlds))
        return found


def services_of(connection: HTTPConnection) -> Services:
    """Return the parts behind the app that answers ``connection``."""
    services: Services = connection.app.state.services
    return services


ServicesDep = Annotated[Services, Depends(services_of)]
