"""People of a live cell by id: the base of its workers and of its pedestrians."""

from collections.abc import Iterator
from concurrent.futures import Executor
from typing import Generic, TypeVar

P = TypeVar("P")


class PeopleById(Generic[P]):
    """People of one live cell, in the order of their ids."""

    executor: Executor | None = None
    """Builds what people need for their work; None: the caller of a command waits for it."""
    _people: dict[int, P]

    def __iter__(self) -> Iterator[P]:
        return iter(self._people.values())

    def __len__(self) -> int:
        return len(self._people)

    def __getitem__(self, id: int) -> P:
        return self._people[id]

    @property
    def ids(self) -> tuple[int, ...]:
        """Ids of the people, ascending."""
        return tuple(self._people)
