"""The live cell: one thread that owns world and scene, and a door for everybody else.

The thread drains the queue of commands, steps the world at its control rate and draws. Other
threads (HTTP routes, viser's callbacks) only queue commands and read the last snapshot.

Simulated time follows the clock on the wall: after a stall the loop catches up by at most
``MAX_BEHIND_S`` and then lets the rest go, so that a busy machine slows the cell down instead
of making it jump. A visitor may let it run faster: then several steps are one picture.
"""

import logging
import queue
import threading
import time
from dataclasses import replace
from pathlib import Path

import rich

from app.errors import ServiceError
from app.live import commands
from app.live.command_checks import Command, check, check_state, people_after
from app.live.factory import new_world
from app.live.reach.commands import SetInferenceMode
from app.live.reach.interfaces import LiveReachPolicy
from app.live.snapshot import RefusedCommand, WorldSnapshot
from app.live.sorting.commands import TableCommand
from app.sim.cells.cell import Cell
from app.sim.pick.task_policy import TaskPolicy
from app.sim.sorting.sorting_values import SortingValues
from web.viewer.scene.cell_scene import CellScene
from web.viewer.server import ViewerServer
from web.viewer.view_settings import COLLISION_SHAPES, ViewSettings

logger = logging.getLogger(__name__)

MAX_BEHIND_S = 0.2
"""Lateness beyond which time is let go [s]."""
ERROR_PAUSE_S = 1.0
"""Rest after an unexpected error [s]."""
PICTURE_S = 0.04
"""Least time between two pictures [s]: a slow visitor would fall behind without bound."""


class LiveHandle:
    """What other threads may do with a live cell; see ``app.live.world_handle.WorldHandle``.

    Args:
        id: Name of the world in URLs.
        cell: Work cell, against which commands are checked.
        first: Snapshot until the first tick.
    """

    def __init__(self, id: str, cell: Cell, first: WorldSnapshot) -> None:
        self._id, self._cell, self._last = id, cell, first
        self._queue: queue.SimpleQueue[Command] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._submitted = 0
        # Who will be there once all that waits is done.
        self._people = tuple(person.id for person in first.people)
        # Changes of the table that no snapshot shows yet: those that wait, those in work.
        self._unseen = [0, 0]

    @property
    def id(self) -> str:
        """Name of the world in URLs."""
        return self._id

    def submit(self, command: Command) -> int:
        """Queue one command; returns its number at once.

        A snapshot whose ``commands`` is as high shows its effect.

        Raises:
            ServiceError: The command does not fit this cell.
        """
        with self._lock:
            check(command, self._cell, self._people)
            if isinstance(command, SetInferenceMode):
                check_state(command, self._cell, self._last)
            if isinstance(command, TableCommand):
                if not any(self._unseen):
                    check_state(command, self._cell, self._last)
                self._unseen[0] += 1
            self._people = people_after(command, self._people)
            self._queue.put(command)
            self._submitted += 1
            return self._submitted

    def snapshot(self) -> WorldSnapshot:
        """Return the last snapshot; never waits."""
        return self._last

    def publish(self, snapshot: WorldSnapshot) -> None:
        """Replace the last snapshot; for the owner only."""
        with self._lock:
            self._last = snapshot
            self._unseen[1] = 0

    def drain(self) -> list[Command]:
        """Take all waiting commands; for the owner only."""
        waiting = []
        with self._lock:
            while not self._queue.empty():
                waiting.append(self._queue.get())
            self._unseen = [0, self._unseen[0] + self._unseen[1]]
        return waiting


class LiveCell:
    """One live work cell with its viewer.

    Args:
        cell: Work cell.
        policy: Acts at first; None lets the robot rest.
        seed: Seed of the people's work.
        id: Name of the world in URLs.
        sorting_policy: Values the moves of a sorting cell; None leaves them to the planner.
        reach_policy: Moves the arm of a reach cell; None moves straight to the goals.
    """

    def __init__(
        self,
        cell: Cell,
        policy: TaskPolicy | None,
        *,
        seed: int = 0,
        id: str = "main",
        sorting_policy: SortingValues | None = None,
        reach_policy: LiveReachPolicy | None = None,
    ) -> None:
        self._cell = cell
        # The first one compiles what is not in the kernels' cache yet.
        new_world(cell, policy, seed, id, sorting_policy, reach_policy).step()
        self._world = new_world(cell, policy, seed, id, sorting_policy, reach_policy)
        self.handle = LiveHandle(id, cell, self._world.snapshot())
        """Commands in, snapshots out."""
        self._speed = 1
        self._turn, self._undrawn_s = 0, 0.0
        self._done = 0
        self._refused: RefusedCommand | None = None
        self._stop = threading.Event()
        self._server: ViewerServer | None = None
        self._thread: threading.Thread | None = None

    @property
    def cell(self) -> Cell:
        """The work cell it shows."""
        return self._cell

    @property
    def viewer_address(self) -> Path:
        """Unix socket the viewer listens on."""
        if self._server is None:
            raise RuntimeError("the viewer has not been started")
        return self._server.address

    def start(self) -> None:
        """Start viewer and thread."""
        rich.get_console().quiet = True  # viser would print its own address, past the page
        self._server = ViewerServer()
        views = ViewSettings(self._server, self._cell)
        scene = CellScene(self._server, self._cell, self.handle.submit)
        scene.draw(self.handle.snapshot(), 0.0)
        self._thread = threading.Thread(
            target=self._run, args=(scene, views), name=f"world-{self.handle.id}", daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """End thread and viewer; may be called twice."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(timeout=5.0)
            self._thread = None
        if self._server is not None:
            self._server.stop()
            self._server = None

    def _run(self, scene: CellScene, views: ViewSettings) -> None:
        dt = self._cell.robot.dt
        due = time.monotonic() + dt
        while not self._stop.wait(max(due - time.monotonic(), 0.0)):
            try:
                self._tick(scene, views, dt)
            except Exception:
                logger.exception("the live cell failed at tick %d", self.handle.snapshot().tick)
                self._stop.wait(ERROR_PAUSE_S)
            due = max(due + dt, time.monotonic() - MAX_BEHIND_S)

    def _tick(self, scene: CellScene, views: ViewSettings, dt: float) -> None:
        for command in self.handle.drain():
            self._done += 1
            try:
                self._obey(command)
            except ServiceError as error:
                self._refused = RefusedCommand(number=self._done, reason=error.message)
                logger.warning("command %s was refused: %s", command.tag, error.message)
        for _ in range(self._speed):
            self._world.step()
        snapshot = replace(
            self._world.snapshot(),
            speed=self._speed,
            commands=self._done,
            refused=self._refused,
        )
        self.handle.publish(snapshot)
        self._turn += 1
        self._undrawn_s += dt * self._speed
        if self._turn % max(1, round(PICTURE_S / dt)) == 0:
            shapes = views.is_seen(COLLISION_SHAPES)
            scene.draw(snapshot, self._undrawn_s, shapes=shapes)
            self._undrawn_s = 0.0

    def _obey(self, command: Command) -> None:
        """Carry out a command: the clock's speed is the loop's own, all else the world's."""
        if isinstance(command, commands.SetSpeed):
            self._speed = command.factor
        else:
            self._world.apply(command)
