"""The pick-and-place cell, in which most live worlds of these tests run."""

import pytest

from app.sim.cells.cell import Cell, load_cell


@pytest.fixture
def cell() -> Cell:
    return load_cell()
