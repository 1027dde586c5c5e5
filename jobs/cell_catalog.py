"""Work cells by name: the shipped ones, and the user's own from the database."""

import logging

from app.errors import InvalidInput, NotFound, WrongState
from app.policies.configs.presets import Preset
from app.policies.configs.reach import ReachPreset
from app.policies.configs.sorting import SortingPreset
from app.sim.cells.cell import (
    Cell,
    cell_names,
    lacks_for_pick,
    lacks_for_reach,
    load_cell,
    parse_definition,
)
from app.sim.sorting.layout import lacks_for_tasks
from app.store.cells import get_cell, list_cells, list_names, put_cell, remove_cell
from app.store.engine import Store

logger = logging.getLogger(__name__)


def lacks_for_training(preset: Preset, cell: Cell) -> str | None:
    """Return the cell's missing requirement for training a preset; None where complete."""
    if isinstance(preset, SortingPreset):
        return lacks_for_tasks(cell)
    return lacks_for_reach(cell) if isinstance(preset, ReachPreset) else lacks_for_pick(cell)


class CellCatalog:
    """Finds cells by name; safe to use from any thread."""

    def __init__(self, store: Store) -> None:
        self._store = store

    def get(self, name: str) -> Cell:
        """Return a cell.

        Raises:
            NotFound: No cell has that name.
            InvalidInput: The stored cell does not fit this version.
        """
        if name in cell_names():
            return load_cell(name)
        try:
            return parse_definition(get_cell(self._store, name).definition)
        except NotFound:
            raise NotFound("cell", name, self.names()) from None

    def names(self) -> tuple[str, ...]:
        """Return the names of all cells, shipped ones first."""
        return (*cell_names(), *list_names(self._store))

    def all(self) -> list[Cell]:
        """Return all cells of this version, shipped ones first."""
        found = [load_cell(name) for name in cell_names()]
        for record in list_cells(self._store):
            try:
                found.append(parse_definition(record.definition))
            except InvalidInput as error:
                logger.warning("cell %s is left out: %s", record.name, error.message)
        return found

    def to_train_in(self, preset: Preset) -> Cell:
        """Return the cell of a preset.

        Raises:
            InvalidInput: No cell has that name, or the preset cannot be trained in it.
        """
        name = preset.cell
        try:
            cell = self.get(name)
        except NotFound as error:
            rule = "is not a known work cell"
            raise InvalidInput("overrides.cell", name, rule, error.known) from None
        if (lack := lacks_for_training(preset, cell)) is not None:
            raise InvalidInput("overrides.cell", name, f"cannot be trained in: it {lack}")
        return cell

    def add(self, cell: Cell) -> bool:
        """Store a checked cell of the user's own.

        Returns:
            Whether it is new; the same one again has no effect.

        Raises:
            WrongState: The name is taken.
        """
        self._require_own(cell.name)
        return put_cell(self._store, cell.name, cell.definition())

    def remove(self, name: str) -> None:
        """Remove a cell of the user's own.

        Raises:
            NotFound: No cell has that name.
            WrongState: It is shipped, or a job that has not ended trains in it.
        """
        self._require_own(name)
        remove_cell(self._store, name)

    def _require_own(self, name: str) -> None:
        if name in cell_names():
            raise WrongState("name", name, "is reserved for a cell shipped with Tandem")
