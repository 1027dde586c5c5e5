"""Interfaces of the people of a live world."""

from collections.abc import Iterator
from typing import Protocol

from app.live import commands
from app.live.arm import PeopleInCell
from app.live.snapshot import PersonSnapshot
from app.sim.human.person import Person


class PersonLike(Protocol):
    """One person of a live cell."""

    @property
    def id(self) -> int:
        """Number of the person."""

    def as_observed(self) -> Person:
        """Return the person as observed by a policy."""

    def drag(self, command: commands.MovePerson) -> None:
        """Set dragged targets."""

    def enter(self, mode: commands.Mode) -> None:
        """Set the motion source."""

    def play(self, command: commands.SetMotion) -> None:
        """Play a recording."""

    def resize(self, command: commands.SetAnthropometry) -> None:
        """Change the body dimensions."""

    def snapshot(self, clearance_m: float, *, nearest: bool) -> PersonSnapshot:
        """Return the read model of the person."""


class MovingPeople(PeopleInCell, Protocol):
    """The people of a live cell, as a world moves them."""

    def __iter__(self) -> Iterator[PersonLike]: ...

    def __getitem__(self, id: int) -> PersonLike: ...

    def move(self, dt: float) -> None:
        """Move all people for ``dt`` [s]."""

    def move_while_paused(self, dt: float) -> bool:
        """Move dragged people for ``dt`` [s]; return whether one moved."""

    def change(self, command: commands.AddPerson | commands.RemovePerson) -> None:
        """Add or remove a person."""
