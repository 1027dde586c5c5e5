import time
from dataclasses import replace

import numpy as np
import pytest
import viser

from app.live import commands
from app.live.command_checks import Command
from app.live.commands import SetSafety
from app.live.reach.commands import MoveGoal, goal_box
from app.live.reach.world import LiveReachWorld
from app.live.snapshot import WorldSnapshot
from app.sim.cells.cell import Cell, load_cell
from app.sim.cells.colours import VESTS, blend
from tests.web.conftest import node
from tests.web.viewer_client import ViewerClient
from web.viewer.capsules_view import HIT
from web.viewer.scene.cell_scene import CellScene
from web.viewer.scene.reach_scene import N_GAUGE, OFF, OVERRIDES, override_color

CELL = load_cell("shared-workspace")
WAIT_S = 10.0


@pytest.fixture(scope="module")
def cell() -> Cell:
    return CELL


@pytest.fixture
def world() -> LiveReachWorld:
    return LiveReachWorld(CELL, None, seed=3)


def slowed(snapshot: WorldSnapshot, override: float) -> WorldSnapshot:
    """Return the same a moment later, with another override."""
    safety = replace(snapshot.safety, override=override)
    return replace(snapshot, t_s=snapshot.t_s + 1.0, safety=safety)


def test_cylinder_is_where_the_person_counts_and_as_wide(
    scene: CellScene, server: viser.ViserServer, world: LiveReachWorld
) -> None:
    for _ in range(30):
        world.step()
    now = world.snapshot()
    scene.draw(now, 0.02)
    one = now.people[0].cylinder
    assert np.allclose(node(server, "/cylinders/0").position, (one.x, one.y, 0.0), atol=2e-3)
    side = node(server, "/cylinders/0/side")
    assert np.allclose(side.scale, (one.radius, one.radius, 1.0), atol=2e-3)
    assert tuple(side.color) == VESTS[0]
    assert node(server, "/people/0") is not None


def test_touched_cylinder_turns_red(
    scene: CellScene, server: viser.ViserServer, world: LiveReachWorld
) -> None:
    now = world.snapshot()
    hit = (replace(now.people[0], clearance_m=-0.01),)
    scene.draw(replace(now, people=hit), 0.02)
    assert tuple(node(server, "/cylinders/0/side").color) == HIT
    scene.draw(now, 0.02)
    assert tuple(node(server, "/cylinders/0/side").color) == VESTS[0]


def test_people_come_and_leave_with_their_cylinders(
    scene: CellScene, server: viser.ViserServer, world: LiveReachWorld
) -> None:
    world.apply(commands.AddPerson())
    scene.draw(world.snapshot(), 0.02)
    assert node(server, "/cylinders/1/side") is not None
    world.apply(commands.RemovePerson(person=1))
    scene.draw(world.snapshot(), 0.02)
    assert server.scene.get_handle_by_name("/cylinders/1/side") is None


def test_goal_is_drawn_with_its_tolerance_and_the_handle_follows(
    scene: CellScene, server: viser.ViserServer, world: LiveReachWorld
) -> None:
    world.apply(MoveGoal(position=(0.25, 0.7, 0.2)))
    now = world.snapshot()
    scene.draw(now, 0.02)
    assert np.allclose(node(server, "/goal/place").position, now.reach.goal)
    assert np.allclose(node(server, "/goal/handle").position, now.reach.goal)
    assert node(server, "/goal/place/tolerance").scale == now.reach.tolerance


def test_targets_and_goal_region_are_shown(
    scene: CellScene, server: viser.ViserServer, world: LiveReachWorld
) -> None:
    now, (low, high) = world.snapshot(), goal_box(CELL)
    scene.draw(now, 0.02)
    dots, box = node(server, "/goals/targets"), node(server, "/goals/box")
    assert len(dots.points) == 54
    assert box.points.shape == (12, 2, 3)
    assert np.allclose(box.points.reshape(-1, 3).min(axis=0), low)
    assert np.allclose(box.points.reshape(-1, 3).max(axis=0), high)


def test_gauge_is_as_full_as_the_override_and_the_zone_has_its_colour(
    scene: CellScene, server: viser.ViserServer, world: LiveReachWorld
) -> None:
    now = slowed(world.snapshot(), 0.4)
    scene.draw(now, 0.02)
    color = blend(OVERRIDES, 0.4)
    ring = node(server, "/gauge/ring").colors
    assert (ring == np.array(color)).all(axis=(1, 2)).sum() == round(0.4 * N_GAUGE)
    assert node(server, "/gauge/text").text == "40 %"
    area = node(server, "/zone/area")
    assert tuple(area.color) == color
    assert np.allclose(area.vertices[:-1, :2], now.safety.zone, atol=1e-6)
    assert np.allclose(area.vertices[:, 2], CELL.floor_z, atol=0.02)


def test_scene_says_that_the_layer_is_off(
    scene: CellScene, server: viser.ViserServer, world: LiveReachWorld
) -> None:
    world.apply(SetSafety(on=False))
    now = slowed(world.snapshot(), 1.0)
    scene.draw(now, 0.02)
    assert override_color(now.safety) == OFF
    assert node(server, "/gauge/text").text == "no safety layer"


def test_zone_is_hidden_without_people(
    scene: CellScene, server: viser.ViserServer, world: LiveReachWorld
) -> None:
    world.apply(commands.RemovePerson(person=0))
    scene.draw(slowed(world.snapshot(), 1.0), 0.02)
    assert not node(server, "/zone/area").visible


def test_trail_holds_what_was_noted_without_drawing(
    scene: CellScene, server: viser.ViserServer, world: LiveReachWorld
) -> None:
    for _ in range(40):
        world.step()
        scene.note(world.snapshot())
    scene.draw(world.snapshot(), 0.8)
    trail = node(server, "/trail/lines")
    steps = np.linalg.norm(np.diff(trail.points[-5:, 1], axis=0), axis=1)
    assert np.all((steps > 3e-3) & (steps < 0.1))


def test_trail_follows_the_tool(
    scene: CellScene, server: viser.ViserServer, world: LiveReachWorld
) -> None:
    world.apply(commands.RemovePerson(person=0))
    for _ in range(40):
        world.step()
        scene.draw(world.snapshot(), 0.02)
    trail = node(server, "/trail/lines")
    assert trail.visible
    last = world.snapshot().tcp
    assert np.linalg.norm(trail.points[-1, 1] - last) < 0.1


@pytest.mark.usefixtures("scene")
def test_goal_that_is_dragged_out_of_its_region_stays_at_the_edge(
    server: viser.ViserServer, queued: list[Command]
) -> None:
    with ViewerClient(server.address) as visitor:
        end = time.monotonic() + WAIT_S
        while not any(isinstance(one, MoveGoal) for one in queued):
            assert time.monotonic() < end, "the drag never arrived"
            visitor.drag("/goal/handle", [(2.0, 0.7, 0.2)])
            time.sleep(0.1)
    moved = next(one for one in queued if isinstance(one, MoveGoal))
    assert moved.position == pytest.approx((0.5, 0.7, 0.2))
