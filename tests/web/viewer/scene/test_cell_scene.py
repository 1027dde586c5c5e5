from dataclasses import replace

import numpy as np
import pytest
import viser

from app.live import commands
from app.live.pick.world import LivePickWorld
from app.live.snapshot import ContactSnapshot
from app.sim.cells.cell import Cell, load_cell
from app.sim.cells.parts import Obstacle
from app.sim.human import model as human
from app.sim.robot.ur10 import LINK_NAMES, Robot
from tests.support.straight_policy import StraightPolicy
from tests.web.conftest import node
from web.viewer.capsules_view import HIT
from web.viewer.scene.arc import dashes
from web.viewer.scene.cell_scene import PATH_LIFT, CellScene
from web.viewer.scene.stations_view import GOALS, IDLE, StationsView


@pytest.fixture(scope="module")
def cell() -> Cell:
    return load_cell()


@pytest.fixture
def world(cell: Cell) -> LivePickWorld:
    return LivePickWorld(cell, StraightPolicy(cell), seed=2)


def test_links_are_placed_where_pinocchio_says(
    scene: CellScene, server: viser.ViserServer, world: LivePickWorld, cell: Cell
) -> None:
    for _ in range(20):
        world.step()
    snapshot = world.snapshot()
    scene.draw(snapshot, 0.05)
    poses = Robot(cell.robot.tool_length).link_poses(snapshot.robot_q)
    for name, pose in zip(LINK_NAMES, poses, strict=True):
        assert np.allclose(node(server, f"/robot/{name}").position, pose[:3, 3], atol=1e-9)


def test_chosen_station_is_ringed_and_goals_have_their_own_colours(
    scene: CellScene, server: viser.ViserServer, world: LivePickWorld, cell: Cell
) -> None:
    world.apply(commands.SetCandidates(ids=("cube0", "cube4")))
    snapshot = world.snapshot()
    scene.draw(snapshot, 0.05)
    assert snapshot.chosen is not None
    x, y, _ = cell.station(snapshot.chosen).position
    assert tuple(node(server, "/chosen").position) == (x, y, 0.0)
    assert tuple(node(server, "/stations/cube0").color) == GOALS[0]
    assert tuple(node(server, "/stations/cube4").color) == GOALS[4]
    assert tuple(node(server, "/stations/cube2").color) == IDLE
    text = node(server, f"/labels/{snapshot.chosen}").text
    assert f"{snapshot.values[snapshot.chosen]:.1f}" in text
    ranked = sorted(snapshot.values, key=lambda name: -snapshot.values[name])
    for rank, name in enumerate(ranked, start=1):
        assert f"{rank}. {cell.station(name).label}" in node(server, f"/labels/{name}").text
    assert not node(server, "/labels/cube2").visible


def test_gizmos_are_seen_in_manual_mode_only_and_sit_on_the_hands(
    scene: CellScene, server: viser.ViserServer, world: LivePickWorld, cell: Cell
) -> None:
    scene.draw(world.snapshot(), 0.05)
    assert not node(server, "/gizmos/0/right").visible
    world.apply(commands.SetMode(mode="manual"))
    scene.draw(world.snapshot(), 0.05)
    palms = human.joint_points(world.snapshot().people[0].q, cell.body)
    assert node(server, "/gizmos/0/right").visible
    assert np.allclose(node(server, "/gizmos/0/right").position, palms["hand_r"], atol=1e-3)


def test_contact_shows_what_touched_in_red(
    scene: CellScene, server: viser.ViserServer, world: LivePickWorld, cell: Cell
) -> None:
    world.apply(commands.SetSafety(on=False))
    world.apply(commands.SetCandidates(ids=("cube2",)))
    world.apply(commands.MovePerson(pelvis=(0.0, 1.15, -1.57), right=(-0.1, 0.62, 0.2)))
    for _ in range(300):
        world.step()
        if world.snapshot().status == "contact":
            break
    snapshot = world.snapshot()
    assert snapshot.contact is not None
    scene.draw(snapshot, 0.05)
    touched = node(server, f"/touched/people/0/{snapshot.contact.body}")
    assert tuple(touched.color) == HIT
    ends = human.capsules(snapshot.people[0].q, cell.body, cell.floor_z)
    body = human.CAPSULE_NAMES.index(snapshot.contact.body)
    assert np.allclose(touched.position, ends[body].mean(axis=0), atol=1e-9)
    assert server.scene.get_handle_by_name("/touched/people/0/head") is None
    assert not node(server, "/shapes/people/0/head").visible
    world.apply(commands.Reset())
    scene.draw(world.snapshot(), 0.05)
    assert server.scene.get_handle_by_name(touched.name) is None


def test_both_capsules_are_red_where_the_robot_touches_itself(
    scene: CellScene, server: viser.ViserServer, world: LivePickWorld
) -> None:
    contact = ContactSnapshot(kind="self", link="upper_arm_low", body="tool")
    scene.draw(replace(world.snapshot(), status="contact", contact=contact), 0.05)
    for name in ("upper_arm_low", "tool"):
        assert tuple(node(server, f"/touched/robot/{name}").color) == HIT
    scene.draw(world.snapshot(), 0.05)
    assert server.scene.get_handle_by_name("/touched/robot/tool") is None


def test_collision_shapes_lie_over_the_person_when_asked_for(
    scene: CellScene, server: viser.ViserServer, world: LivePickWorld, cell: Cell
) -> None:
    snapshot = world.snapshot()
    scene.draw(snapshot, 0.05, shapes=True)
    ends = human.capsules(snapshot.people[0].q, cell.body, cell.floor_z)
    for name, pair in zip(human.CAPSULE_NAMES, ends, strict=True):
        capsule = node(server, f"/shapes/people/0/{name}")
        assert capsule.visible
        assert np.allclose(capsule.position, pair.mean(axis=0), atol=1e-9)
    scene.draw(snapshot, 0.05)
    assert not node(server, "/shapes/people/0/head").visible


def test_path_runs_from_the_tool_to_the_target() -> None:
    start, end = np.array([0.0, 0.3, 0.5]), np.array([0.3, 0.7, 0.12])
    line = dashes(start, end, PATH_LIFT)
    assert np.linalg.norm(line[0, 0] - start) < 0.05
    assert np.linalg.norm(line[-1, 1] - end) < 0.05


def test_two_people_are_drawn_and_one_who_leaves_is_taken_out(
    scene: CellScene, server: viser.ViserServer, world: LivePickWorld
) -> None:
    world.apply(commands.AddPerson())
    world.apply(commands.SetMode(mode="manual", person=1))
    scene.draw(world.snapshot(), 0.05)
    vests = {tuple(node(server, f"/people/{id}/vest").color) for id in (0, 1)}
    assert len(vests) == 2
    assert node(server, "/gizmos/1/right").visible
    assert not node(server, "/gizmos/0/right").visible
    world.apply(commands.RemovePerson(person=1))
    scene.draw(world.snapshot(), 0.05)
    assert not node(server, "/people/1").visible
    assert server.scene.get_handle_by_name("/gizmos/1/right") is None


def test_mannequin_and_capsules_grow_with_the_person(
    scene: CellScene, server: viser.ViserServer, world: LivePickWorld
) -> None:
    scene.draw(world.snapshot(), 0.05)
    before = np.ptp(node(server, "/people/0/head").vertices[:, 2])
    sleeves = np.ptp(node(server, "/people/0/jacket").vertices[:, 1])
    world.apply(commands.SetAnthropometry(stature=95.0))
    for _ in range(14):
        world.step()
        scene.draw(world.snapshot(), 0.05)
    person = world.snapshot().people[0]
    assert np.ptp(node(server, "/people/0/head").vertices[:, 2]) > 1.07 * before
    assert np.ptp(node(server, "/people/0/jacket").vertices[:, 1]) > 1.07 * sleeves
    forearm = np.ptp(node(server, "/shapes/people/0/forearm_r").vertices[:, 2])
    girth = human.capsule_radii(person.size)[human.CAPSULE_NAMES.index("forearm_r")]
    assert forearm == pytest.approx(person.size[6] + 2.0 * girth, abs=2e-3)


def test_objects_stand_on_the_obstacle_below_their_station(
    server: viser.ViserServer, cell: Cell
) -> None:
    x, y, z = cell.stations[0].position
    shelf = Obstacle(id="shelf", label="Shelf", center=(x, y, 0.1), half_size=(0.1, 0.1, 0.1))
    high = cell.stations[0].model_copy(update={"id": "high", "position": (x, y, z + 0.2)})
    with_shelf = cell.model_copy(update={"obstacles": (shelf,), "stations": (high,)})
    StationsView(server, with_shelf, lambda command: None)
    assert tuple(node(server, "/stations/high").position) == pytest.approx((x, y, 0.2))
    assert node(server, "/labels/high").position[2] > 0.2
