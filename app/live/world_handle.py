"""Interface of a live world for other threads."""

import queue
import threading
import time

from app.errors import Conflict
from app.live.command_checks import Command, check, check_state, people_after
from app.live.commands import Reset, SetPolicy
from app.live.reach.commands import SetInferenceMode
from app.live.snapshot import WorldSnapshot
from app.live.sorting.commands import SetSortingPolicy, StartTest, TableCommand
from app.sim.cells.cell import Cell


class WorldHandle:
    """Commands in, immutable snapshots out; for use from any thread."""

    def __init__(self, id: str, cell: Cell, first: WorldSnapshot) -> None:
        self.id = id
        """Name of the world in URLs."""
        self._cell, self._last = cell, first
        self._published_at = time.monotonic()
        self._queue: queue.SimpleQueue[Command] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._is_open = True
        self._submitted = 0
        self.choices = 0
        """Number of submitted commands that choose a policy."""
        # People after all queued commands.
        self._people = tuple(person.id for person in first.people)
        # Numbers of the last commands that change the table, and the policy.
        self._table_changed = self._policy_changed = 0
        # Checkpoints of commands that no snapshot shows yet, with the numbers of the commands.
        self._chosen: list[tuple[int, str]] = []

    def submit(self, command: Command, choices: int | None = None) -> int:
        """Queue one command and return its number; never waits.

        A snapshot with ``commands`` >= this number contains its effect. What a command changes
        is compared with the last snapshot unless an earlier command that it does not show yet
        may change the same.

        Args:
            choices: The number of choices that the command may replace; None: any.

        Raises:
            InvalidInput: The command does not fit this cell.
            Conflict: The world has been stopped, or another policy was chosen since.
        """
        with self._lock:
            if not self._is_open:
                raise Conflict(f"the world {self.id!r} was stopped before it took the command")
            if choices not in (None, self.choices):
                raise Conflict("another policy was chosen")
            last = self._last
            if last.commands == self._submitted:
                self._people = tuple(person.id for person in last.people)
            check(command, self._cell, self._people)
            if isinstance(command, SetInferenceMode) and last.commands >= self._policy_changed:
                check_state(command, self._cell, last)
            if isinstance(command, TableCommand) and last.commands >= self._table_changed:
                check_state(command, self._cell, last)
            self._submitted += 1
            self._note(command)
            self._queue.put(command)
            return self._submitted

    def _note(self, command: Command) -> None:
        """Note what a command that is being queued will change."""
        self._people = people_after(command, self._people)
        if isinstance(command, TableCommand | Reset | StartTest):
            self._table_changed = self._submitted
        if isinstance(command, SetPolicy | SetSortingPolicy):
            self.choices += 1
            self._policy_changed = self._submitted
            if command.loaded is not None:
                self._chosen.append((self._submitted, command.loaded.checkpoint))

    def close(self) -> None:
        """Refuse further commands: the world has been stopped."""
        with self._lock:
            self._is_open = False

    @property
    def acting(self) -> frozenset[str]:
        """SHA-256 of the checkpoints that act, or will after the queued commands."""
        with self._lock:
            last, sorting = self._last, self._last.sorting
            self._chosen = [one for one in self._chosen if one[0] > last.commands]
            acts = (last.checkpoint, sorting.sorting_policy if sorting else None)
            queued = (sha256 for _, sha256 in self._chosen)
            return frozenset(one for one in (*acts, *queued) if one is not None)

    def snapshot(self) -> WorldSnapshot:
        """Return the last snapshot; never waits."""
        return self._last

    def publish(self, snapshot: WorldSnapshot) -> None:
        """Replace the last snapshot; for the thread of the world only."""
        self._last, self._published_at = snapshot, time.monotonic()

    def since_snapshot_s(self) -> float:
        """Return the time since the last snapshot was published [s]."""
        return time.monotonic() - self._published_at

    def drain(self) -> list[Command]:
        """Return and remove all queued commands; for the thread of the world only."""
        waiting = []
        while not self._queue.empty():
            waiting.append(self._queue.get())
        return waiting
