"""No way to change the people of a cell takes a skinned mesh out of the scene.

viser's client ends its drawing in every window when a skinned mesh is removed.
"""

from collections.abc import Iterator, Sequence

import numpy as np
import pytest

from app.live import commands
from app.live.command_checks import Command
from app.live.factory import new_world
from app.sim.cells.cell import load_cell
from app.sim.people.kernels.people import MAX_PEOPLE
from tests.web.conftest import node
from tests.web.viewer_client import ViewerClient
from web.viewer.scene.cell_scene import CellScene
from web.viewer.server import ViewerServer

STEPS = 15
"""Steps after a new size: it is reached within them, and the skin is fitted."""

LIVES: dict[str, Sequence[Command]] = {
    "somebody leaves": [commands.AddPerson(), commands.RemovePerson(person=1)],
    "everybody leaves and two come back": [
        commands.RemovePerson(person=0),
        commands.AddPerson(),
        commands.AddPerson(),
    ],
    "the first leaves before the second": [
        commands.AddPerson(),
        commands.RemovePerson(person=0),
        commands.RemovePerson(person=1),
        commands.AddPerson(),
    ],
    "as many as there can be, all gone, all back": [
        *[commands.AddPerson()] * (MAX_PEOPLE - 1),
        *[commands.RemovePerson(person=id) for id in range(MAX_PEOPLE)],
        *[commands.AddPerson()] * MAX_PEOPLE,
    ],
    "a person grows and shrinks": [
        commands.SetAnthropometry(stature=95.0),
        commands.SetAnthropometry(stature=5.0, arms=90.0),
    ],
    "a tall person leaves and a median one comes": [
        commands.AddPerson(),
        commands.SetAnthropometry(person=1, stature=99.0),
        commands.RemovePerson(person=1),
        commands.AddPerson(),
    ],
    "the world is reset": [commands.AddPerson(), commands.Reset()],
}


def cases() -> Iterator[object]:
    """Yield cells and lives; the reach cell's people are cylinders, which keep their size."""
    for cell in ("pick-and-place", "shared-workspace", "sorting-e0"):
        for name, life in LIVES.items():
            sized = any(isinstance(one, commands.SetAnthropometry) for one in life)
            if not (sized and cell == "shared-workspace"):
                yield pytest.param(cell, life, id=f"{cell}: {name}")


@pytest.mark.parametrize(("cell", "life"), list(cases()))
def test_skinned_meshes_stay(server: ViewerServer, cell: str, life: Sequence[Command]) -> None:
    work_cell = load_cell(cell)
    world = new_world(work_cell, None, 0, "main", None, None)
    scene = CellScene(server, work_cell, lambda _: None)
    scene.draw(world.snapshot(), 0.0)
    with ViewerClient(server.address) as visitor:
        visitor.wait_until_heard(server)
        for k, command in enumerate(life):
            world.apply(command)
            for _ in range(STEPS if isinstance(command, commands.SetAnthropometry) else 1):
                world.step()
                scene.draw(world.snapshot(), work_cell.robot.dt)
            # A mesh that is removed before its time window ends is never sent.
            server.scene.add_frame(f"/done/{k}")
            visitor.wait_for("FrameMessage", f"/done/{k}")
        kinds: dict[str, set[str]] = {}
        for message in visitor.received:
            kinds.setdefault(message["type"], set()).add(message.get("name", ""))
    skinned = kinds["SkinnedMeshMessage"]
    assert "/people/0/jacket" in skinned
    above = {name.rsplit("/", n)[0] for name in skinned for n in range(3)}
    assert not above & kinds.get("RemoveSceneNodeMessage", set())
    people = {person.id for person in world.snapshot().people}
    for name in skinned:
        id = int(name.split("/")[2])
        assert node(server, f"/people/{id}").visible == (id in people)


def test_person_of_a_reused_number_has_its_own_size_place_and_feet(
    server: ViewerServer,
) -> None:
    cell = load_cell()
    world = new_world(cell, None, 0, "main", None, None)
    scene = CellScene(server, cell, lambda _: None)

    def act(*all: Command) -> None:
        for command in all:
            world.apply(command)
        for _ in range(STEPS):
            world.step()
            scene.draw(world.snapshot(), cell.robot.dt)

    def height() -> float:
        return float(np.ptp(node(server, "/people/1/jacket").vertices[:, 2]))

    act(commands.AddPerson())
    median = height()
    act(
        commands.SetAnthropometry(person=1, stature=99.0),
        commands.SetMode(person=1, mode="manual"),
    )
    assert height() > 1.04 * median
    act(commands.RemovePerson(person=1), commands.AddPerson())
    assert height() == pytest.approx(median)
    shoe, person = node(server, "/people/1/shoe_l"), world.snapshot().people[1]
    assert float(np.hypot(*(shoe.position[:2] - person.posture[:2]))) < 0.5
