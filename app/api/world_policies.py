"""Policies and recordings that commands to a live world name.

A policy that selects tasks is valid in the cell it was trained in, and in cells that differ
from it only in stations and assumptions of the safety layer (``layout.require_workspace``).
"""

import logging

from starlette.concurrency import run_in_threadpool

from app.api.registry import REACH_ALIAS, SORTING_ALIASES, P, PolicyRegistry
from app.api.services import LiveWorld, Services
from app.errors import CheckpointMismatch, Damaged, InvalidInput, NotFound
from app.live.commands import SetMotion, SetPolicy
from app.live.playback import Recording
from app.live.reach.commands import is_reaching
from app.live.sorting.commands import SetSortingPolicy
from app.policies.checkpoints.checkpoint import CHOOSING, REACHING, purpose_of
from app.policies.checkpoints.trained_cell import is_for
from app.policies.inference.live_reach_policy import TrainedReachPolicy
from app.sim.cells.cell import Cell, cell_names, require_cell
from app.sim.pick.task_policy import TaskPolicy
from app.sim.sorting.batch import shape_of
from app.sim.sorting.layout import is_sorting, require_workspace
from app.sim.sorting.sorting_values import SortingValues
from app.store.checkpoints import list_checkpoints

logger = logging.getLogger(__name__)

NamingCommand = SetMotion | SetPolicy | SetSortingPolicy
"""A command that names a stored object."""
MAX_CHOICES = 20
"""Maximum number of choices in an error."""
MAX_SEARCHED = 200
"""Number of the newest checkpoints that are searched for one of a cell."""


def submit_loaded(
    command: NamingCommand, world: LiveWorld, services: Services, choices: int | None = None
) -> int:
    """Queue a command together with the stored object that it names; return its number.

    Args:
        choices: As for :meth:`WorldHandle.submit`.

    Raises:
        InvalidInput: Nothing has that name, or the recording has no such run.
        CheckpointMismatch: The policy is of another kind or cell.
        Conflict: As for :meth:`WorldHandle.submit`.
    """
    return services.retention.deploy(
        lambda: command.with_loaded(_object_of(command, world.cell, services)),
        lambda loaded: world.handle.submit(loaded, choices),
    )


def _object_of(command: NamingCommand, cell: Cell, services: Services) -> object:
    """Return the stored object that a command names; None without a name."""
    match command:
        case SetMotion():
            return _recording(command, services)
        case SetPolicy(checkpoint=str(name)) if is_reaching(cell):
            return named_reach_policy(name, cell, services)
        case SetPolicy(checkpoint=str(name)):
            policy = services.task_policies.load(name)
            if policy.cell != cell.name and not may_select_tasks(policy, cell, services):
                rule = f"must decide in the cell {cell.name}, not in {policy.cell}"
                raise InvalidInput("checkpoint", name, rule)
            require_task_policy(policy, cell, services)
            return policy
        case SetSortingPolicy(checkpoint=str(name)):
            sorting_policy = services.sorting_policies.load(name)
            require_sorting_policy(sorting_policy, cell)
            return sorting_policy
    return None


def _recording(command: SetMotion, services: Services) -> Recording:
    if command.name not in (known := services.recordings.names()):
        raise InvalidInput(
            "name", command.name, "is not a stored recording", known[:MAX_CHOICES]
        )
    runs = services.recordings.get(command.name)
    if command.run >= len(runs):
        choices = [str(run) for run in range(min(len(runs), MAX_CHOICES))]
        rule = f"is not a run of this recording: it has {len(runs)}, counted from 0"
        raise InvalidInput("run", command.run, rule, choices)
    return Recording(runs[command.run], command.name, command.run, len(runs))


def require_task_policy(policy: TaskPolicy, cell: Cell, services: Services) -> None:
    """Check that a policy is valid in a cell.

    Raises:
        CheckpointMismatch: It was trained elsewhere, or before a cell was changed.
    """
    if policy.cell == cell.name:
        require_cell(cell, policy.cell, policy.cell_sha256)
        return
    try:
        trained = services.cells.get(policy.cell)
    except NotFound:
        raise CheckpointMismatch("cell", cell.name, policy.cell) from None
    require_cell(trained, policy.cell, policy.cell_sha256)
    require_workspace(cell, trained)


async def require_policy_for_decision(
    policy: TaskPolicy, cell: Cell, services: Services
) -> None:
    """Check a policy as :func:`require_task_policy`, on the event loop.

    A cell of the user's own that is not the one of the decision is read on a thread.
    """
    if policy.cell in (cell.name, *cell_names()):
        require_task_policy(policy, cell, services)
    else:
        await run_in_threadpool(require_task_policy, policy, cell, services)


def may_select_tasks(policy: TaskPolicy, cell: Cell, services: Services) -> bool:
    """Return whether a policy is valid in a cell."""
    try:
        require_task_policy(policy, cell, services)
    except CheckpointMismatch:
        return False
    return True


def task_policy_for(cell: Cell, services: Services) -> TaskPolicy | None:
    """Return the policy of a cell: the default one where trained in it, else the newest."""
    default = services.task_policies.load(None)
    if default.cell == cell.name and may_select_tasks(default, cell, services):
        return default
    newest = newest_for(cell, CHOOSING, services.task_policies, services)
    return newest or (default if may_select_tasks(default, cell, services) else None)


def newest_for(
    cell: Cell, purpose: str, policies: PolicyRegistry[P], services: Services
) -> P | None:
    """Return the newest usable policy that was trained in a cell for a purpose."""
    for record in list_checkpoints(services.store, limit=MAX_SEARCHED).items:
        if purpose_of(record.manifest) == purpose and is_for(record.manifest, cell):
            try:
                return policies.load(record.sha256)
            except (CheckpointMismatch, Damaged, InvalidInput) as error:  # or deleted since
                logger.warning("left out for cell %s: %s", cell.name, error.message)
    return None


def require_sorting_policy(
    policy: SortingValues, cell: Cell, member: str = "checkpoint"
) -> None:
    """Check that a sorting policy was trained for tasks of the size of a cell.

    Args:
        member: Member of the request that names the policy.

    Raises:
        InvalidInput: The cell is no sorting cell.
        CheckpointMismatch: It was trained for another size.
    """
    here, known = shape_of(cell), policy.shape
    if here != known:
        raise CheckpointMismatch("shape", str(here), str(known), member=member)


def sorting_policy_for(cell: Cell, services: Services) -> SortingValues | None:
    """Return the shipped sorting policy of a cell; None: the planner selects every move."""
    if cell.name not in SORTING_ALIASES or cell.name not in services.checkpoints.aliases:
        return None
    policy = services.sorting_policies.load(cell.name)
    return policy if is_sorting(cell) and policy.shape == shape_of(cell) else None


def named_reach_policy(reference: str, cell: Cell, services: Services) -> TrainedReachPolicy:
    """Return a reach policy by name, for a live world.

    Raises:
        InvalidInput: Nothing has that name.
        CheckpointMismatch: It does not reach goals, or was trained elsewhere.
    """
    actor = services.reach_policies.load(reference).actor
    require_cell(cell, actor.cell, actor.cell_sha256)
    return TrainedReachPolicy(actor)


def reach_policy_for(cell: Cell, services: Services) -> TrainedReachPolicy | None:
    """Return the reach policy of a cell: the shipped one, else the newest trained in it."""
    if REACH_ALIAS in services.checkpoints.aliases:
        actor = services.reach_policies.load(REACH_ALIAS).actor
        if (actor.cell, actor.cell_sha256) == (cell.name, cell.sha256):
            return TrainedReachPolicy(actor)
    newest = newest_for(cell, REACHING, services.reach_policies, services)
    return None if newest is None else TrainedReachPolicy(newest.actor)
