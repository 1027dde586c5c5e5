"""The live world of a cell: sorting, reaching or pick and place, whatever it has things for."""

from typing import Protocol

from app.errors import InvalidInput
from app.live.commands import Command
from app.live.pick.world import World
from app.live.reach.commands import SetWay, is_reaching, lacks_for_reaching
from app.live.reach.interfaces import ReachPilot
from app.live.reach.world import ReachWorld, check_way
from app.live.snapshot import WorldSnapshot
from app.live.sorting import commands as sorting_commands
from app.live.sorting.commands import SORTING_COMMANDS
from app.live.sorting.perceived_state import table_of
from app.live.sorting.world import SortingWorld
from app.sim.cells.cell import Cell, lacks_for_pick
from app.sim.pick.task_policy import TaskPolicy
from app.sim.sorting.batch import shape_of
from app.sim.sorting.benchmark_tasks import TESTS, SortingTest
from app.sim.sorting.layout import is_sorting, lacks_for_sorting
from app.sim.sorting.sorting_values import SortingValues


class LiveWorld(Protocol):
    """One live cell of any scenario."""

    def apply(self, command: Command) -> None:
        """Carry out one command.

        Raises:
            ServiceError: The command does not fit this cell; nothing has changed.
        """

    def step(self) -> None:
        """Advance by one control period; while paused only dragged people move."""

    def snapshot(self) -> WorldSnapshot:
        """Return what is known now, frozen."""


def new_world(
    cell: Cell,
    policy: TaskPolicy | None,
    seed: int,
    id: str = "main",
    sorter: SortingValues | None = None,
    pilot: ReachPilot | None = None,
) -> LiveWorld:
    """Return the world of a cell.

    Args:
        cell: Work cell that :func:`lacks_for_live` accepts.
        policy: Moves the arm; None lets the robot rest.
        seed: Seed of people and tasks.
        id: Name of the world in URLs.
        sorter: Values the moves of a sorting cell; None leaves them to the exact planner.
        pilot: Moves the arm of a reach cell; None goes straight.
    """
    if is_reaching(cell):
        return ReachWorld(cell, pilot, seed, id)
    if is_sorting(cell):
        return SortingWorld(cell, policy, seed, id, sorter)
    return World(cell, policy, seed, id)


def lacks_for_live(cell: Cell) -> str | None:
    """Say what a cell lacks to be shown live; None where nothing."""
    if is_reaching(cell):
        return lacks_for_reaching(cell)
    return lacks_for_sorting(cell) if is_sorting(cell) else lacks_for_pick(cell)


def tests_of(cell: Cell) -> tuple[SortingTest, ...]:
    """Return the sorting tests that can be started in a cell."""
    if not is_sorting(cell) or lacks_for_sorting(cell) is not None:
        return ()
    shape = shape_of(cell)
    return tuple(one for one in TESTS if one.fits(shape))


def check_on_table(command: Command, cell: Cell, snapshot: WorldSnapshot) -> None:
    """Refuse a command that does not fit the blocks, the goal or the policy of a snapshot.

    The world may have gone on since; it looks again.

    Raises:
        InvalidInput: No such block, a taken place, too many blocks, a goal they cannot meet, or
            no such way to ask the policy.
    """
    if snapshot.reach is not None and isinstance(command, SetWay):
        check_way(command.way, snapshot.reach.ways)
    if snapshot.sorting is None or not isinstance(command, SORTING_COMMANDS):
        return
    if isinstance(command, sorting_commands.StartTest):
        names = tuple(one.name for one in tests_of(cell))
        if command.id not in names:
            rule = "needs more cells or colours than this cell has"
            raise InvalidInput("id", command.id, rule, names)
    else:
        sorting_commands.carry_out(command, table_of(cell, snapshot.sorting))
