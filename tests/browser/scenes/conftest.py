from collections.abc import Iterator

import pytest

from app.sim.cells.cell import load_cell
from tests.browser.conftest import show

REACH, SORT = "shared-workspace", "sorting-e0"


@pytest.fixture
def shown(server: str) -> Iterator[str]:
    """The server, which shows its first cell with one person at work, before and after."""
    show(server, load_cell().name)
    yield server
    show(server, load_cell().name)
