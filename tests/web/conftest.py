"""A viewer for the tests of this folder, and what its scene holds."""

from collections.abc import Iterator
from typing import Any

import pytest
import viser

from web.viewer.server import ViewerServer


@pytest.fixture
def server() -> Iterator[ViewerServer]:
    server = ViewerServer()
    yield server
    server.stop()


def node(server: viser.ViserServer, name: str) -> Any:
    """Return a node of the scene, which must be there."""
    handle = server.scene.get_handle_by_name(name)
    assert handle is not None, name
    return handle
