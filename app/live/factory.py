"""Live world of a cell: sorting, reaching or pick-and-place, by its stations."""

from app.live.command_checks import scenario_of
from app.live.pick.world import LivePickWorld
from app.live.reach.commands import lacks_for_reaching
from app.live.reach.interfaces import LiveReachPolicy
from app.live.reach.world import LiveReachWorld
from app.live.sorting.world import LiveSortingWorld
from app.sim.cells.cell import Cell, lacks_for_pick
from app.sim.pick.task_policy import TaskPolicy
from app.sim.sorting.layout import lacks_for_sorting
from app.sim.sorting.sorting_values import SortingValues

AnyWorld = LivePickWorld | LiveReachWorld | LiveSortingWorld


def new_world(
    cell: Cell,
    policy: TaskPolicy | None,
    seed: int,
    id: str = "main",
    sorting_policy: SortingValues | None = None,
    reach_policy: LiveReachPolicy | None = None,
) -> AnyWorld:
    """Return the live world of a cell.

    Args:
        cell: Work cell that :func:`lacks_for_live` accepts.
        policy: Moves the robot of a pick or sorting cell, and selects its target or among equal
            moves; None: the robot is idle.
        seed: Seed of people, tasks and grasps.
        sorting_policy: Policy of a sorting cell; None: the planner selects every move.
        reach_policy: Policy of a reach cell; None: straight motion to the goals.
    """
    match scenario_of(cell):
        case "reach":
            return LiveReachWorld(cell, reach_policy, seed, id)
        case "sorting":
            return LiveSortingWorld(cell, policy, seed, id, sorting_policy)
        case "pick":
            return LivePickWorld(cell, policy, seed, id)


def lacks_for_live(cell: Cell) -> str | None:
    """Return what a live world of a cell still needs, as a sentence part; None if nothing."""
    lacks = {"pick": lacks_for_pick, "reach": lacks_for_reaching, "sorting": lacks_for_sorting}
    return lacks[scenario_of(cell)](cell)
