"""Interface of a live world for other threads."""

from typing import Any, Protocol


class WorldHandle(Protocol):
    """One live world, seen from other threads: commands in, immutable snapshots out."""

    @property
    def id(self) -> str:
        """Name of the world in URLs."""

    def submit(self, command: Any) -> int:
        """Queue one command of ``app.live.commands``; returns its number at once."""

    def snapshot(self) -> Any:
        """Return the last ``WorldSnapshot``; never waits."""
