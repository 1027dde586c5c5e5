"""Interface of a live world for other threads."""

import queue
import threading

from app.live.command_checks import Command, check, check_state, people_after
from app.live.commands import SetPolicy
from app.live.reach.commands import SetInferenceMode
from app.live.snapshot import WorldSnapshot
from app.live.sorting.commands import SetSortingPolicy, TableCommand
from app.sim.cells.cell import Cell


class WorldHandle:
    """Commands in, immutable snapshots out; for use from any thread.

    Args:
        cell: Work cell, against which commands are checked.
        first: Initial snapshot.
    """

    def __init__(self, id: str, cell: Cell, first: WorldSnapshot) -> None:
        self._id, self._cell, self._last = id, cell, first
        self._queue: queue.SimpleQueue[Command] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._submitted = 0
        self._choices = 0
        # People after all queued commands.
        self._people = tuple(person.id for person in first.people)
        # Commands for the table that no snapshot contains yet: queued, and being applied.
        self._unseen = [0, 0]

    @property
    def id(self) -> str:
        """Name of the world in URLs."""
        return self._id

    def submit(self, command: Command) -> int:
        """Queue one command and return its number; never waits.

        A snapshot with ``commands`` >= this number contains its effect.

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
            self._choices += isinstance(command, SetPolicy | SetSortingPolicy)
            self._queue.put(command)
            self._submitted += 1
            return self._submitted

    @property
    def choices(self) -> int:
        """Number of submitted commands that choose a policy."""
        return self._choices

    def snapshot(self) -> WorldSnapshot:
        """Return the last snapshot; never waits."""
        return self._last

    def publish(self, snapshot: WorldSnapshot) -> None:
        """Replace the last snapshot; for the thread of the world only."""
        with self._lock:
            self._last = snapshot
            self._unseen[1] = 0

    def drain(self) -> list[Command]:
        """Return and remove all queued commands; for the thread of the world only."""
        waiting = []
        with self._lock:
            while not self._queue.empty():
                waiting.append(self._queue.get())
            self._unseen = [0, self._unseen[0] + self._unseen[1]]
        return waiting
