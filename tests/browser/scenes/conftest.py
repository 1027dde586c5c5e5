from collections.abc import Iterator

import pytest

from app.sim.cells.cell import load_cell
from tests.support import patient_http

REACH, SORT = "shared-workspace", "sorting-e0"
LIMIT_S = 180.0


def show(server: str, cell: str) -> None:
    """Let the live world of a server be another cell."""
    answer = patient_http.put(f"{server}/v1/worlds/main/cell", json={"cell": cell})
    assert answer.status_code == 200, answer.text


@pytest.fixture
def shown(server: str) -> Iterator[str]:
    """The server, which shows its first cell with one person at work, before and after."""
    show(server, load_cell().name)
    yield server
    show(server, load_cell().name)
