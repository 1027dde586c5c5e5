"""Live sorting cells with given blocks, nobody in the robot's way."""

from collections.abc import Callable, Mapping, Sequence

from app.live import commands
from app.live.snapshot import WorldSnapshot
from app.live.sorting.commands import AddBlock, RemoveBlock, SetGoal
from app.live.sorting.world import LiveSortingWorld
from app.sim.cells.cell import load_cell
from app.sim.pick.task_policy import TaskPolicy
from app.sim.sorting.sorting_values import SortingValues
from tests.support.straight_policy import StraightPolicy

LOOK = 3
"""Ticks between two looks."""
Goal = Mapping[str, Sequence[str]]


def empty_world(
    policy: TaskPolicy | None = None, seed: int = 1, sorting_policy: SortingValues | None = None
) -> LiveSortingWorld:
    """Return a world without blocks, whose person stands back."""
    cell = load_cell("sorting-e0")
    world = LiveSortingWorld(
        cell, policy or StraightPolicy(cell), seed, sorting_policy=sorting_policy
    )
    world.apply(commands.MovePerson(pelvis=(0.0, 2.4, -1.57)))
    world.apply(SetGoal(towers={}))
    for block in world.snapshot().sorting.blocks:
        world.apply(RemoveBlock(id=block.id))
    for _ in range(40):
        world.step()
    return world


def lay(world: LiveSortingWorld, blocks: Mapping[str, str], goal: Goal) -> dict[str, str]:
    """Add blocks (kind by place) and set the goal; return the blocks' ids by place."""
    for place, kind in blocks.items():
        colour, size = kind.split("-")
        world.apply(AddBlock(colour=colour, size=size, at=place))
    world.apply(SetGoal(towers={name: tuple(sizes) for name, sizes in goal.items()}))
    return {one.place: one.id for one in world.snapshot().sorting.blocks}


def until(
    world: LiveSortingWorld, holds: Callable[[WorldSnapshot], bool], limit: int = 3000
) -> WorldSnapshot:
    """Step until ``holds``; return the snapshot of then."""
    for _ in range(limit // LOOK):
        for _ in range(LOOK):
            world.step()
        if holds(snapshot := world.snapshot()):
            return snapshot
    raise AssertionError(f"it never happened: {snapshot.message}")


def solved(snapshot: WorldSnapshot) -> bool:
    return snapshot.status == "solved"


def towers(snapshot: WorldSnapshot) -> dict[str, list[str]]:
    """Return the kinds on the towers from the bottom."""
    found: dict[str, list[str]] = {"red": [], "blue": []}
    for one in sorted(snapshot.sorting.blocks, key=lambda block: block.level):
        if one.place in found:
            found[one.place].append(f"{one.colour}-{one.size}")
    return found
