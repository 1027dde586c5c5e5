"""Live worlds that follow a training: its newest checkpoint acts as soon as it is stored."""

import logging
import threading
from collections.abc import Sequence

from app.api.schemas.worlds import FollowPublic
from app.api.services import LiveWorld, Services
from app.api.world_policies import (
    reach_policy_for,
    sorting_policy_for,
    submit_loaded,
    task_policy_for,
)
from app.errors import ServiceError, WrongState
from app.live.commands import SetPolicy
from app.live.reach.commands import is_reaching
from app.live.sorting.commands import SetSortingPolicy
from app.policies.checkpoints.checkpoint import SORTING, purpose_of
from app.policies.inference.live_reach_policy import TrainedReachPolicy
from app.sim.cells.cell import Cell
from app.sim.pick.task_policy import TaskPolicy
from app.storage_errors import StorageFull, StorageUnavailable
from app.store.checkpoints import list_checkpoints
from app.store.jobs import find_job
from app.store.records import JobRecord

logger = logging.getLogger(__name__)

PolicyCommand = SetPolicy | SetSortingPolicy
PERIOD_S = 1.0
"""Period of the check for a newer checkpoint [s]."""


def start(world_id: str, job: JobRecord, services: Services) -> FollowPublic:
    """Let a world follow a training; its newest checkpoint acts at once.

    Raises:
        NotFound: There is no such world.
        WrongState: The job is no training, or has ended.
        Conflict: Another policy was chosen meanwhile.
        InvalidInput: The policy does not fit the cell.
        CheckpointMismatch: Likewise.
    """
    if job.kind != "train":
        rule = f"of job {job.number}: only trainings are followed"
        raise WrongState("kind", job.kind, rule, ("train",))
    if job.is_final:
        rule = f"of job {job.number}, which has ended: deploy its last checkpoint instead"
        raise WrongState("state", job.state, rule, ("queued", "running"))
    world, follows = services.world(world_id), services.follows
    follow = FollowPublic(
        job=job.id, number=job.number, active=True, step=None, checkpoint=None, reason=None
    )
    with follows.lock:
        choices = world.handle.choices
        now, choices = _updated(follow, world, choices, services)
        follows.by_world[world_id] = now, world, choices
        if follows.thread is None or not follows.thread.is_alive():
            follows.thread = threading.Thread(
                target=_run, args=(services,), name="following", daemon=True
            )
            follows.thread.start()
    return now


def deploy_newest(services: Services) -> bool:
    """Let newer checkpoints act; return whether a world still follows a training.

    A world stops following when another policy is chosen by any command.
    """
    follows = services.follows
    with follows.lock:
        for world_id, (follow, world, choices) in list(follows.by_world.items()):
            if not follow.active:
                continue
            if services.worlds.get(world_id) is not world:
                now = _ended(follow, "the cell was started again")
            elif world.handle.choices != choices:
                now = _ended(follow, "another policy was chosen")
            else:
                now, choices = _refreshed(follow, world, choices, services)
            follows.by_world[world_id] = now, world, choices
        active = any(one[0].active for one in follows.by_world.values())
        follows.thread = follows.thread if active else None
        return active


def _run(services: Services) -> None:
    """Check the follows until none is active, or another thread took over."""
    me = threading.current_thread()
    while not services.stopping.wait(PERIOD_S):
        try:
            if services.follows.thread is not me or not deploy_newest(services):
                return
        except Exception:
            logger.exception("a followed training could not be checked")


def _refreshed(
    follow: FollowPublic, world: LiveWorld, choices: int, services: Services
) -> tuple[FollowPublic, int]:
    """Return a follow and its ``choices`` after a check; it has ended where its job has."""
    try:
        job = find_job(services.store, follow.job)
        if job is None:
            return _ended(follow, f"job {follow.number} was deleted"), choices
        now, choices = _updated(follow, world, choices, services)
    except (StorageFull, StorageUnavailable) as error:
        text, about = "job %d cannot be looked at for now: %s", {"job_id": follow.job}
        logger.warning(text, follow.number, error.message, extra=about)
        return follow, choices
    except ServiceError as error:
        return _ended(follow, error.message), choices
    if job.is_final:
        acts = "its last checkpoint acts" if now.checkpoint else "it has no checkpoint"
        now = _ended(now, f"job {job.number} is {job.state}: {acts}")
    return now, choices


def _updated(
    follow: FollowPublic, world: LiveWorld, choices: int, services: Services
) -> tuple[FollowPublic, int]:
    """Let the newest checkpoint of the job act, if it does not yet.

    A job that is resumed without a state has dropped all: the policies of the cell act until
    its next checkpoint.

    Returns:
        The follow, and the choices that the world has had afterwards.

    Raises:
        Conflict: The world has had other than so many ``choices``.
    """
    items = list_checkpoints(services.store, job_id=follow.job, limit=1).items
    if not items and follow.checkpoint is not None:
        n_commands = _fall_back(world, choices, services)
        now = follow.model_copy(update={"step": None, "checkpoint": None})
        return now, choices + n_commands
    if not items or items[0].sha256 == follow.checkpoint:
        return follow, choices
    newest = items[0]
    command = SetSortingPolicy if purpose_of(newest.manifest) == SORTING else SetPolicy
    submit_loaded(command(checkpoint=newest.sha256), world, services, choices)
    update = {"step": newest.step, "checkpoint": newest.sha256}
    return follow.model_copy(update=update), choices + 1


def _ended(follow: FollowPublic, reason: str) -> FollowPublic:
    text, about = "job %d is followed no longer: %s", {"job_id": follow.job}
    logger.info(text, follow.number, reason, extra=about)
    return follow.model_copy(update={"active": False, "reason": reason})


def _fall_back(world: LiveWorld, choices: int, services: Services) -> int:
    """Let the policies act that the cell starts with; return the number of commands."""

    def submit(commands: Sequence[PolicyCommand]) -> int:
        for place, command in enumerate(commands):
            world.handle.submit(command, choices + place)
        return len(commands)

    return services.retention.deploy(lambda: _own_policies(world.cell, services), submit)


def _own_policies(cell: Cell, services: Services) -> tuple[PolicyCommand, ...]:
    """Return the commands that choose the policies of a cell."""
    if is_reaching(cell):
        return (_choice_of(reach_policy_for(cell, services)),)
    first = _choice_of(task_policy_for(cell, services))
    if (sorting := sorting_policy_for(cell, services)) is None:
        return (first,)
    return first, SetSortingPolicy(checkpoint=sorting.checkpoint).with_loaded(sorting)


def _choice_of(policy: TaskPolicy | TrainedReachPolicy | None) -> SetPolicy:
    name = None if policy is None else policy.checkpoint
    return SetPolicy(checkpoint=name).with_loaded(policy)
