"""Names of colours, sizes and positions of a sorting task, and states written in them.

The API uses ``red``, ``large``, ``slot3``; kernels and networks use codes and positions
(``state.py``). Errors name values in the caller's terms.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from app.errors import InvalidInput
from app.sim.cells.cell import Cell
from app.sim.cells.parts import MAX_FAILURE
from app.sim.core.arrays import Vec
from app.sim.sorting.batch import shape_of
from app.sim.sorting.layout import lacks_for_tasks
from app.sim.sorting.state import (
    NULL,
    SIZE_NAMES,
    SortingShape,
    SortingState,
    check_state,
    empty_state,
    missing,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class SortingNames:
    """The words of one sorting task."""

    shape: SortingShape
    """Size."""
    slots: tuple[str, ...]
    """Clutter slots, in the order of their positions."""
    towers: tuple[str, ...]
    """Towers, in the order of their colours."""
    colours: tuple[str, ...]
    """Colours, one per tower."""
    sizes: tuple[str, ...]
    """Sizes, from the smallest."""

    @property
    def stations(self) -> tuple[str, ...]:
        """All places, by position."""
        return self.slots + self.towers

    def kind(self, code: int) -> str:
        """Return the name of an object: ``large red``."""
        size, colour = self.shape.size_of(code), self.shape.colour_of(code)
        return f"{self.sizes[size]} {self.colours[colour]}"


@dataclass(frozen=True, slots=True, kw_only=True)
class NamedObject:
    """Names of one object."""

    colour: str
    """One of the task's colours."""
    size: str
    """One of its sizes."""
    at: str
    """Clutter slot or tower it is on."""
    level: int | None = None
    """Level on a tower, 0 the lowest; None in the clutter."""
    id: str | None = None
    """The caller's name for it."""


def names_of(cell: Cell) -> SortingNames:
    """Return the words of a work cell's sorting task.

    Raises:
        InvalidInput: The cell has nothing to sort, or towers of too few levels.
    """
    shape = shape_of(cell)
    if (lack := lacks_for_tasks(cell)) is not None:
        raise InvalidInput("cell", cell.name, f"cannot be used for sorting: it {lack}")
    towers = cell.stations_of("cluster")
    return SortingNames(
        shape=shape,
        slots=tuple(one.id for one in cell.stations_of("clutter")),
        towers=tuple(one.id for one in towers),
        colours=tuple(one.colour or one.id for one in towers),
        sizes=SIZE_NAMES[shape.n_sizes],
    )


def plain_names(
    n_slots: int, colours: Sequence[str], sizes: Sequence[str] = SIZE_NAMES[3]
) -> SortingNames:
    """Return the words of a task without a work cell: ``slot0``, ...; towers go by colour.

    Raises:
        InvalidInput: Too many of something, or a name given twice.
    """
    shape = SortingShape(n_slots=n_slots, n_colours=len(colours), n_sizes=len(sizes))
    names = SortingNames(
        shape=shape,
        slots=tuple(f"slot{k}" for k in range(n_slots)),
        towers=tuple(colours),
        colours=tuple(colours),
        sizes=tuple(sizes),
    )
    for field, words in (("colours", names.stations), ("sizes", names.sizes)):
        for index, word in enumerate(words):
            if word in words[:index]:
                raise InvalidInput(field, word, "must be the name of one thing only")
    return names


def state_from_names(
    names: SortingNames,
    objects: Sequence[NamedObject],
    goal: Mapping[str, Sequence[tuple[str | None, str]]],
    fail: Vec,
) -> SortingState:
    """Return the state that a caller describes.

    Args:
        names: The words of the task.
        objects: Positions of the objects.
        goal: Colour (None: the tower's own) and size by level, from the bottom, by tower.
            Towers that are not named are empty.
        fail: Failure probability of a pick from each clutter slot, shape (K,).

    Raises:
        InvalidInput: The state is impossible; the error names the field as the caller wrote it.
    """
    n_slots = names.shape.n_slots
    if len(objects) > n_slots:
        rule = f"must be at most {n_slots}, as many as there are clutter slots"
        raise InvalidInput("objects", len(objects), rule)
    state = empty_state(names.shape)
    state.fail[:] = fail
    _check_ids(objects)
    for index, one in enumerate(objects):
        _put(state, names, one, f"objects[{index}]")
    _check_gaps(state, names, objects)
    for tower, wanted in goal.items():
        _ask(state, names, tower, wanted)
    _check_goal_is_met(state, names)
    check_state(state, names.shape)
    return state


def fail_with(names: SortingNames, own: Vec, changes: Mapping[str, float]) -> Vec:
    """Return the failure probabilities of a cell, shape (K,), with changes by clutter slot.

    Raises:
        InvalidInput: No such clutter slot, or no probability below 1.
    """
    fail = own.copy()
    for slot, chance in changes.items():
        field = f"failure_map.{slot}"
        if slot not in names.slots:
            raise InvalidInput(field, chance, "is of no clutter slot", names.slots)
        if not 0.0 <= chance <= MAX_FAILURE:
            rule = f"must lie in [0, {MAX_FAILURE}]: a pick that always fails has no plan"
            raise InvalidInput(field, chance, rule)
        fail[names.slots.index(slot)] = chance
    return fail


def _index(field: str, word: str, words: tuple[str, ...], what: str) -> int:
    if word not in words:
        raise InvalidInput(field, word, f"is no {what}", words)
    return words.index(word)


def _code(names: SortingNames, colour: str, size: str, place: str) -> int:
    return names.shape.code(
        _index(f"{place}.colour", colour, names.colours, "colour of this task"),
        _index(f"{place}.size", size, names.sizes, "size of this task"),
    )


def _check_ids(objects: Sequence[NamedObject]) -> None:
    seen: set[str] = set()
    for index, one in enumerate(objects):
        if one.id in seen:
            rule = "must be unique among the objects"
            raise InvalidInput(f"objects[{index}].id", one.id, rule)
        if one.id is not None:
            seen.add(one.id)


def _put(state: SortingState, names: SortingNames, one: NamedObject, place: str) -> None:
    code = _code(names, one.colour, one.size, place)
    position = _index(f"{place}.at", one.at, names.stations, "place of this task")
    if position < names.shape.n_slots:
        if one.level is not None:
            raise InvalidInput(f"{place}.level", one.level, "must be null in a clutter slot")
        if state.clutter[position] != NULL:
            rule = f"is taken: {_other(names, int(state.clutter[position]))} is there already"
            raise InvalidInput(f"{place}.at", one.at, rule)
        state.clutter[position] = code
        return
    tower = position - names.shape.n_slots
    n_levels = names.shape.n_slots
    if one.level is None or not 0 <= one.level < n_levels:
        rule = f"must lie in [0, {n_levels - 1}] on the tower {one.at}, 0 the lowest"
        raise InvalidInput(f"{place}.level", one.level, rule)
    if (there := int(state.towers[tower, one.level])) != NULL:
        rule = f"is taken: {_other(names, there)} is at this level of {one.at} already"
        raise InvalidInput(f"{place}.level", one.level, rule)
    state.towers[tower, one.level] = code


def _other(names: SortingNames, code: int) -> str:
    return f"another object ({names.kind(code)})"


def _check_gaps(
    state: SortingState, names: SortingNames, objects: Sequence[NamedObject]
) -> None:
    for index, one in enumerate(objects):
        if one.level:
            tower = names.towers.index(one.at)
            if state.towers[tower, one.level - 1] == NULL:
                rule = f"leaves a gap: nothing is at level {one.level - 1} of {one.at}"
                raise InvalidInput(f"objects[{index}].level", one.level, rule)


def _ask(
    state: SortingState,
    names: SortingNames,
    tower: str,
    wanted: Sequence[tuple[str | None, str]],
) -> None:
    c = _index("goal", tower, names.towers, "tower of this task")
    if len(wanted) > names.shape.n_slots:
        rule = f"must have at most {names.shape.n_slots} objects, one per level"
        raise InvalidInput(f"goal.{tower}", len(wanted), rule)
    for level, (colour, size) in enumerate(wanted):
        place = f"goal.{tower}[{level}]"
        own = names.colours[c] if colour is None else colour
        state.goal[c, level] = _code(names, own, size, place)


def _check_goal_is_met(state: SortingState, names: SortingNames) -> None:
    lack = missing(state, names.shape)
    if lack.any():
        parts = [f"{lack[code]} x {names.kind(int(code))}" for code in np.flatnonzero(lack)]
        rule = "must be met by the objects: these are missing"
        raise InvalidInput("goal", ", ".join(parts), rule)
