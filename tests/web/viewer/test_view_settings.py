"""What one visitor hides stays in every other visitor's scene."""

import time
from collections.abc import Callable, Iterator

import pytest

from app.live.factory import new_world
from app.sim.cells.cell import load_cell
from tests.web.viewer_client import ViewerClient
from web.viewer.scene.cell_scene import CellScene
from web.viewer.server import ViewerServer
from web.viewer.view_settings import COLLISION_SHAPES, PREFIX, ViewSettings, settings_of

WAIT_S = 20.0
CELLS = ("pick-and-place", "sorting-e1", "shared-workspace")


@pytest.fixture
def server() -> Iterator[ViewerServer]:
    server = ViewerServer()
    yield server
    server.stop()


def wait_for(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + WAIT_S
    while not condition():
        assert time.monotonic() < end, "it never happened"
        time.sleep(0.01)


def boxes(visitor: ViewerClient) -> set[str]:
    return {one["props"]["label"] for one in visitor.heard("GuiCheckboxMessage")}


@pytest.mark.parametrize("name", CELLS)
def test_every_setting_hides_what_is_drawn_below_its_node(
    server: ViewerServer, name: str
) -> None:
    cell = load_cell(name)
    ViewSettings(server, cell)
    scene = CellScene(server, cell, lambda _: None)
    scene.draw(new_world(cell, None, 1).snapshot(), 0.0)
    nodes = {one.name for one in server.scene._handle_from_node_name.values()}
    for setting in settings_of(cell):
        below = {node for node in nodes if node.startswith(f"{setting.node}/")}
        assert below, setting
        assert node_shown(server, setting.node) is setting.shown


def node_shown(server: ViewerServer, name: str) -> bool:
    handle = server.scene.get_handle_by_name(name)
    assert handle is not None
    return bool(handle.visible)


def test_what_a_visitor_hides_stays_in_the_scene_of_another(server: ViewerServer) -> None:
    cell = load_cell()
    ViewSettings(server, cell)
    labels = {f"{PREFIX}{one.label}" for one in settings_of(cell)}
    door = server.address
    with ViewerClient(door) as one, ViewerClient(door) as other:
        wait_for(lambda: boxes(one) == boxes(other) == labels)
        one.check(f"{PREFIX}Values", value=False)
        other.check(f"{PREFIX}Target line", value=False)
        wait_for(lambda: one.shown() == {"/labels": False})
        wait_for(lambda: other.shown() == {"/path": False})
        one.check(f"{PREFIX}Values", value=True)
        wait_for(lambda: one.shown() == {"/labels": True})
        assert other.shown() == {"/path": False}
        assert node_shown(server, "/labels")


def test_shapes_are_drawn_while_any_visitor_looks_at_them(server: ViewerServer) -> None:
    views = ViewSettings(server, load_cell())
    box = f"{PREFIX}{COLLISION_SHAPES.label}"
    assert not views.is_seen(COLLISION_SHAPES)
    with ViewerClient(server.address) as one:
        wait_for(lambda: box in boxes(one))
        assert not views.is_seen(COLLISION_SHAPES)
        one.check(box, value=True)
        wait_for(lambda: views.is_seen(COLLISION_SHAPES))
        wait_for(lambda: one.shown() == {"/shapes": True})
    wait_for(lambda: not views.is_seen(COLLISION_SHAPES))
