"""Live cell: the thread that owns a live world and draws its scene.

The thread drains the command queue, steps the world at its control rate and draws. Other
threads (HTTP routes, viser's callbacks) queue commands and read the last snapshot.

Simulated time follows the wall clock. After a stall the loop catches up by at most
``MAX_BEHIND_S``, so that a busy machine slows the cell down without jumps. At higher speeds
several steps are drawn as one frame. Without a viewer nothing is drawn.
"""

import logging
import math
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path

import rich

from app.errors import ServiceError
from app.live import commands
from app.live.command_checks import Command
from app.live.factory import new_world
from app.live.lateness import Lateness
from app.live.pick.risk_worker import PersonRisk, RiskWorker
from app.live.pick.world import LivePickWorld
from app.live.reach.interfaces import LiveReachPolicy
from app.live.snapshot import MAX_REFUSED, RefusedCommand, WorldSnapshot
from app.live.world_handle import WorldHandle
from app.sim.cells.cell import Cell
from app.sim.pick.task_policy import TaskPolicy
from app.sim.sorting.sorting_values import SortingValues
from web.viewer.scene.cell_scene import CellScene
from web.viewer.server import ViewerServer
from web.viewer.view_settings import COLLISION_SHAPES, RISK_MAP, ViewSettings

logger = logging.getLogger(__name__)

MAX_BEHIND_S = 0.2
"""Greatest delay that is caught up [s]."""
FAULT_LOG_S = 10.0
"""Least time between two messages about a scene that cannot be drawn [s]."""
ERROR_PAUSE_S = 1.0
"""Pause after an unexpected error [s]."""
FRAME_S = 0.04
"""Shortest time between two frames [s]; limits the backlog of slow clients."""


class LiveCell:
    """A live work cell with its viewer; the arguments are those of :func:`new_world`."""

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
        self.cell = cell
        """Its work cell."""
        # Compile the kernels that are not cached.
        new_world(cell, policy, seed, id, sorting_policy, reach_policy).step()
        self._world = new_world(cell, policy, seed, id, sorting_policy, reach_policy)
        self._builder = ThreadPoolExecutor(1, thread_name_prefix="work-loop")
        self._world.people.executor = self._builder
        self.handle = WorldHandle(id, cell, self._world.snapshot())
        """Commands in, snapshots out."""
        self.lateness = Lateness()
        """Lateness of its ticks."""
        self._speed = 1
        self._ticks, self._undrawn_s = 0, 0.0
        self._fault_logged_at = -math.inf
        self._n_commands = 0
        self._refused: deque[RefusedCommand] = deque(maxlen=MAX_REFUSED)
        self._risk = RiskWorker()
        self._stop = threading.Event()
        self._server: ViewerServer | None = None
        self._thread: threading.Thread | None = None

    @property
    def viewer_address(self) -> Path:
        """Unix socket of the viewer."""
        if self._server is None:
            raise RuntimeError("the viewer has not been started")
        return self._server.address

    def start(self) -> None:
        """Start viewer and thread."""
        rich.get_console().quiet = True  # viser would print its own address
        self._server = ViewerServer()
        views = ViewSettings(self._server, self.cell)
        scene = CellScene(self._server, self.cell, self._submit)
        scene.draw(self.handle.snapshot(), 0.0)
        draw = partial(self._draw, self._server, scene, views)
        self._thread = threading.Thread(
            target=self._run, args=(draw,), name=f"world-{self.handle.id}", daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """Stop thread and viewer; may be called twice."""
        self.handle.close()
        self._stop.set()
        if self._thread is not None:
            self._thread.join(timeout=5.0)
            self._thread = None
        self._risk.close()
        self._builder.shutdown(wait=False, cancel_futures=True)
        if self._server is not None:
            self._server.stop()
            self._server = None

    def _run(self, draw: Callable[[WorldSnapshot], None]) -> None:
        dt = self.cell.robot.dt
        due = time.monotonic() + dt
        while not self._stop.wait(max(due - time.monotonic(), 0.0)):
            self.lateness.add(max(0.0, time.monotonic() - due))
            try:
                self._tick(draw, dt)
            except Exception:
                logger.exception("the live cell failed at tick %d", self.handle.snapshot().tick)
                self._stop.wait(ERROR_PAUSE_S)
            due = max(due + dt, time.monotonic() - MAX_BEHIND_S)

    def _tick(self, draw: Callable[[WorldSnapshot], None], dt: float) -> None:
        for command in self.handle.drain():
            self._n_commands += 1
            try:
                self._apply(command)
            except ServiceError as error:
                self._refuse(error.message)
                logger.warning("command %s was refused: %s", command.tag, error.message)
            except Exception as error:  # The commands after it are carried out all the same.
                self._refuse(f"{command.tag} failed: {error}")
                logger.exception("command %s failed", command.tag)
        for _ in range(1 if self._world.paused else self._speed):
            self._world.step()
        snapshot = replace(
            self._world.snapshot(),
            speed=self._speed,
            commands=self._n_commands,
            refused=tuple(self._refused),
        )
        self.handle.publish(snapshot)
        self._ticks += 1
        self._undrawn_s += dt * self._speed
        if self._ticks % max(1, round(FRAME_S / dt)) == 0:
            self._draw_safely(draw, snapshot)

    def _draw_safely(
        self, draw: Callable[[WorldSnapshot], None], snapshot: WorldSnapshot
    ) -> None:
        """Draw a snapshot; a fault of the viewer does not delay the world."""
        try:
            draw(snapshot)
        except Exception:
            now = time.monotonic()
            if now - self._fault_logged_at > FAULT_LOG_S:
                self._fault_logged_at = now
                logger.exception("the scene could not be drawn at tick %d", snapshot.tick)

    def _refuse(self, reason: str) -> None:
        """List the present command as refused in the next snapshots, with the reason."""
        self._refused.append(RefusedCommand(number=self._n_commands, reason=reason))

    def _draw(
        self,
        server: ViewerServer,
        scene: CellScene,
        views: ViewSettings,
        snapshot: WorldSnapshot,
    ) -> None:
        """Draw a snapshot if a viewer is connected."""
        if not server.has_viewers:
            server.is_current.clear()
            self._risk.forget()
            scene.note(snapshot)
            return
        shapes, risk = views.is_seen(COLLISION_SHAPES), self._risk_map(views)
        scene.draw(snapshot, self._undrawn_s, shapes=shapes, risk=risk)
        self._undrawn_s = 0.0
        server.is_current.set()

    def _risk_map(self, views: ViewSettings) -> PersonRisk | None:
        """Return the newest risk map; None if no visitor shows it."""
        if not isinstance(self._world, LivePickWorld) or not views.is_seen(RISK_MAP):
            self._risk.forget()
            return None
        self._risk.offer(self._world.risk_query)
        return self._risk.newest

    def _submit(self, command: Command) -> None:
        """Queue a command of the scene; drop it if its person, block or station is gone."""
        try:
            self.handle.submit(command)
        except ServiceError as error:
            logger.debug("command %s of the scene is left out: %s", command.tag, error.message)

    def _apply(self, command: Command) -> None:
        """Apply a command; the speed of the clock belongs to the loop."""
        if isinstance(command, commands.SetSpeed):
            self._speed = command.factor
        else:
            self._world.apply(command)
