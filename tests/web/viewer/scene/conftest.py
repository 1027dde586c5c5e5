"""One scene for all tests of a module, which says for which cell."""

from collections.abc import Iterator

import pytest

from app.live.command_checks import Command
from app.sim.cells.cell import Cell
from web.viewer.scene.cell_scene import CellScene
from web.viewer.server import ViewerServer


@pytest.fixture(scope="module")
def server() -> Iterator[ViewerServer]:
    server = ViewerServer()
    yield server
    server.stop()


@pytest.fixture(scope="module")
def queued() -> list[Command]:
    """The commands of visitors."""
    return []


@pytest.fixture(scope="module")
def scene(server: ViewerServer, cell: Cell, queued: list[Command]) -> CellScene:
    return CellScene(server, cell, queued.append)
