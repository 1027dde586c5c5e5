"""What one visitor hides stays in every other visitor's scene."""

import pytest

from app.live.factory import new_world
from app.sim.cells.cell import load_cell
from tests.support.waiting import wait_until
from tests.web.conftest import node
from tests.web.viewer_client import ViewerClient
from web.viewer.scene.cell_scene import CellScene
from web.viewer.server import ViewerServer
from web.viewer.view_settings import COLLISION_SHAPES, PREFIX, ViewSettings, settings_of

CELLS = ("pick-and-place", "sorting-e1", "shared-workspace")


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
        below = {one for one in nodes if one.startswith(f"{setting.node}/")}
        assert below, setting
        assert node(server, setting.node).visible is setting.shown


def test_what_a_visitor_hides_stays_in_the_scene_of_another(server: ViewerServer) -> None:
    cell = load_cell()
    ViewSettings(server, cell)
    labels = {f"{PREFIX}{one.label}" for one in settings_of(cell)}
    door = server.address
    with ViewerClient(door) as one, ViewerClient(door) as other:
        wait_until(lambda: boxes(one) == boxes(other) == labels)
        one.check(f"{PREFIX}Values", value=False)
        other.check(f"{PREFIX}Target line", value=False)
        wait_until(lambda: one.shown() == {"/labels": False})
        wait_until(lambda: other.shown() == {"/path": False})
        one.check(f"{PREFIX}Values", value=True)
        wait_until(lambda: one.shown() == {"/labels": True})
        assert other.shown() == {"/path": False}
        assert node(server, "/labels").visible


def test_shapes_are_drawn_while_any_visitor_looks_at_them(server: ViewerServer) -> None:
    views = ViewSettings(server, load_cell())
    box = f"{PREFIX}{COLLISION_SHAPES.label}"
    assert not views.is_seen(COLLISION_SHAPES)
    with ViewerClient(server.address) as one:
        wait_until(lambda: box in boxes(one))
        assert not views.is_seen(COLLISION_SHAPES)
        one.check(box, value=True)
        wait_until(lambda: views.is_seen(COLLISION_SHAPES))
        wait_until(lambda: one.shown() == {"/shapes": True})
    wait_until(lambda: not views.is_seen(COLLISION_SHAPES))
