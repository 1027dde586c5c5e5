from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import viser
from viser.infra import WebsockServer

from app.live.command_checks import Command
from app.live.pick.world import LivePickWorld
from app.live.snapshot import WorldSnapshot
from app.live.sorting.commands import ToggleGoal
from app.live.sorting.snapshot import HELD, SortingSnapshot
from app.sim.cells.cell import Cell, load_cell
from app.sim.cells.colours import BLOCKS, FAILURES
from tests.support.waiting import wait_until
from tests.web.conftest import node
from tests.web.sorting_views import a_view, block, centre
from tests.web.viewer_client import ViewerClient
from web.viewer.scene.cell_scene import CellScene
from web.viewer.scene.sorting_bodies import failure_color


@pytest.fixture(scope="module")
def cell() -> Cell:
    return load_cell("sorting-e0")


@pytest.fixture(scope="module")
def still() -> WorldSnapshot:
    return LivePickWorld(load_cell(), None, seed=2).snapshot()


def test_cells_are_coloured_by_how_often_grasps_fail(
    scene: CellScene, server: viser.ViserServer, still: WorldSnapshot, cell: Cell
) -> None:
    view = a_view(cell)
    scene.draw(replace(still, sorting=view), 0.05)
    for index, chance in enumerate(view.failure):
        assert tuple(node(server, f"/clutter/{index}").color) == failure_color(chance)
        assert node(server, f"/chances/{index}").text == f"{100 * chance:.0f} %"


def test_failures_grow_darker_and_never_look_like_a_block() -> None:
    light = [sum(color) for _, color in FAILURES]
    assert light == sorted(light, reverse=True)
    for chance in np.linspace(0.0, 1.0, 50):
        gaps = [
            np.abs(np.subtract(failure_color(chance), one)).max() for one in BLOCKS.values()
        ]
        assert min(gaps) > 40


def test_blocks_stand_where_they_are_and_follow(
    scene: CellScene, server: viser.ViserServer, still: WorldSnapshot, cell: Cell
) -> None:
    view = a_view(cell)
    scene.draw(replace(still, sorting=view), 0.05)
    for one in view.blocks:
        assert np.allclose(node(server, f"/blocks/{one.id}").position, one.position)
    first, *others = view.blocks
    up = replace(first, place=HELD, held=True, position=first.position + [0.1, 0.0, 0.3])
    scene.draw(replace(still, sorting=replace(view, blocks=(up, *others[1:]))), 0.05)
    assert np.allclose(node(server, f"/blocks/{first.id}").position, up.position)
    assert server.scene.get_handle_by_name(f"/blocks/{others[0].id}") is None


def test_wanted_blocks_are_ghosts_until_they_stand_there(
    scene: CellScene, server: viser.ViserServer, still: WorldSnapshot, cell: Cell
) -> None:
    view = a_view(cell)
    scene.draw(replace(still, sorting=view), 0.05)
    ghost = node(server, "/goal/red/1")
    assert tuple(ghost.color) == BLOCKS["red"]
    assert np.allclose(ghost.position, centre(cell, "red", 1))
    assert server.scene.get_handle_by_name("/goal/blue/0") is None
    done = tuple(replace(one, done=True) for one in view.goal)
    scene.draw(replace(still, sorting=replace(view, goal=done)), 0.05)
    assert server.scene.get_handle_by_name("/goal/red/1") is None


def test_rings_mark_the_block_and_the_top_of_its_tower(
    scene: CellScene, server: viser.ViserServer, still: WorldSnapshot, cell: Cell
) -> None:
    view = a_view(cell)
    low = block(cell, "block6", "red-large", "red")
    scene.draw(replace(still, sorting=replace(view, blocks=(*view.blocks, low))), 0.05)
    bottom = centre(cell, "slot2", 0) - [0.0, 0.0, 0.015]
    assert np.allclose(node(server, "/marks/pick").position, bottom)
    above = centre(cell, "red", 1) - [0.0, 0.0, 0.015]
    assert np.allclose(node(server, "/marks/place").position, above)
    line = node(server, "/move/arc").points
    assert np.linalg.norm(line[0, 0] - bottom) < 0.08
    assert np.linalg.norm(line[-1, 1] - above) < 0.08


def test_nothing_is_marked_while_nothing_is_carried_out(
    scene: CellScene, server: viser.ViserServer, still: WorldSnapshot, cell: Cell
) -> None:
    idle: SortingSnapshot = replace(a_view(cell), move=None, phase="idle")
    scene.draw(replace(still, sorting=idle), 0.05)
    for name in ("/marks/pick", "/marks/place", "/move/arc"):
        assert not node(server, name).visible


def test_magnet_shows_that_it_holds(
    scene: CellScene, server: viser.ViserServer, still: WorldSnapshot, cell: Cell
) -> None:
    view = a_view(cell)
    scene.draw(replace(still, sorting=view, gripping=True), 0.05)
    assert node(server, "/robot/tool/lamp").visible
    scene.draw(replace(still, sorting=view, gripping=False), 0.05)
    assert not node(server, "/robot/tool/lamp").visible


def test_same_snapshot_again_sends_nothing(
    scene: CellScene, still: WorldSnapshot, cell: Cell, monkeypatch: pytest.MonkeyPatch
) -> None:
    snapshot = replace(still, sorting=a_view(cell))
    scene.draw(snapshot, 0.0)
    sent: list[str] = []
    send = WebsockServer.queue_message

    def counted(self: WebsockServer, message: Any) -> None:
        sent.append(type(message).__name__)
        send(self, message)

    monkeypatch.setattr(WebsockServer, "queue_message", counted)
    scene.draw(snapshot, 0.0)
    assert [one for one in sent if "Atomic" not in one] == []


def test_click_on_a_block_puts_it_into_the_goal_or_out(
    scene: CellScene,
    server: viser.ViserServer,
    still: WorldSnapshot,
    cell: Cell,
    queued: list[Command],
) -> None:
    scene.draw(replace(still, sorting=a_view(cell)), 0.05)
    with ViewerClient(server.address) as visitor:
        visitor.click("/blocks/block3")
        wait_until(lambda: queued)
    assert queued == [ToggleGoal(id="block3")]
