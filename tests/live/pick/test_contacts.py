"""Contacts of the robot of a live pick cell with people, cell and itself."""

from dataclasses import replace
from typing import Any

import numpy as np

from app.live import commands
from app.live.pick.world import LivePickWorld
from app.sim.cells.cell import Cell, load_cell
from app.sim.cells.parts import Obstacle
from app.sim.human import model as human
from app.sim.pick.task_policy import Decision
from tests.live.pick.pick_scenes import until
from tests.support.straight_policy import StraightPolicy

CELL = load_cell()


class FoldingPolicy(StraightPolicy):
    """Bends the elbow until the robot touches itself."""

    def decide(self, *state: Any, **terms: Any) -> Decision:
        found = super().decide(*state, **terms)
        bend = np.array([0.0, 0.0, 1.0, 0.0, 0.0], dtype=np.float32)
        return replace(found, actions=np.tile(bend, (len(found.values), 1)))


def world_without_people(cell: Cell, policy: StraightPolicy) -> LivePickWorld:
    world = LivePickWorld(cell, policy, seed=1)
    world.apply(commands.RemovePerson(person=0))
    return world


def test_contact_with_a_person_is_reported_and_the_robot_restarts_from_home() -> None:
    world = LivePickWorld(CELL, StraightPolicy(CELL), seed=3)
    world.apply(commands.SetSafety(on=False))
    world.apply(commands.SetCandidates(ids=("cube2",)))
    world.apply(commands.MovePerson(pelvis=(0.0, 1.15, -1.57), right=(-0.1, 0.62, 0.2)))
    hit = until(world, "contact")
    assert hit.contact is not None
    assert hit.contact.kind == "human"
    assert hit.contact.body in human.CAPSULE_NAMES
    world.apply(commands.MovePerson(pelvis=(0.0, 2.4, -1.57)))
    again = until(world, "moving")
    assert np.allclose(again.robot_q, CELL.robot.home_q)
    assert again.counters.contacts == 1


def test_contact_with_an_obstacle_names_it() -> None:
    rack = Obstacle(
        id="rack", label="Rack", center=(0.0, 0.62, 0.2), half_size=(0.02, 0.2, 0.15)
    )
    cell = CELL.model_copy(update={"obstacles": (rack,)})
    hit = until(world_without_people(cell, StraightPolicy(cell)), "contact", limit=600)
    assert hit.contact is not None
    assert (hit.contact.kind, hit.contact.body) == ("cell", "obstacle")
    assert "touched an obstacle." in hit.message


def test_contact_of_the_robot_with_itself_names_both_capsules() -> None:
    hit = until(world_without_people(CELL, FoldingPolicy(CELL)), "contact")
    assert hit.contact is not None
    assert hit.contact.kind == "self"
    assert (hit.contact.link, hit.contact.body) == ("upper_arm_low", "tool")
    assert hit.message.startswith("Contact: upper arm low touched the robot's tool.")
