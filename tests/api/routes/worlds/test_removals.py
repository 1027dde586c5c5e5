"""Checkpoints that are deleted while they are loaded for a live world."""

import asyncio
import logging
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import replace
from pathlib import Path

import pytest
import sqlalchemy as sa

from app.api.routes.cells import delete_cell
from app.api.routes.worlds import command_world, list_worlds, set_world_cell
from app.api.schemas.worlds import CommandAccepted, WorldCell
from app.api.services import Services
from app.api.world_policies import newest_for
from app.errors import Conflict, InvalidInput
from app.live.commands import PauseClock, SetPolicy
from app.main import acting_in
from app.policies.checkpoints.checkpoint import CHOOSING
from app.sim.cells.cell import Cell, load_cell
from app.sim.pick.task_policy import TaskPolicy
from app.store import attempts, checkpoints, completion
from app.store.database import tables
from app.store.engine import Store
from jobs.checkpoints import shipped, to_store
from tests.policies.untrained import overflowing
from tests.support import workshop
from tests.support.databases import SQLITE_ONLY, claimed, started
from tests.support.idle_service import add_world, idle_service, loading, own_policy
from web.viewer.loop import LiveCell

pytestmark = SQLITE_ONLY


@pytest.fixture
def services(store: Store, tmp_path: Path) -> Services:
    """A service with an idle world."""
    found = idle_service(store, tmp_path)
    add_world(found)
    return found


@pytest.fixture
def own(store: Store) -> str:
    """A checkpoint that was uploaded."""
    return checkpoints.put_checkpoint(store, own_policy()).sha256


def choose(services: Services, sha256: str) -> CommandAccepted:
    """Choose a policy as a request does."""
    world, command = services.worlds["main"], SetPolicy(checkpoint=sha256)
    return asyncio.run(command_world(world, command, services))


def test_policy_that_is_deleted_while_it_is_loaded_is_not_chosen(
    services: Services, own: str
) -> None:
    services = loading(services, lambda: services.retention.delete_checkpoint(own))
    with pytest.raises(InvalidInput, match="is not a stored checkpoint"):
        choose(services, own)
    assert services.worlds["main"].handle.acting == frozenset()


def test_policy_is_not_chosen_while_it_is_deleted(services: Services, own: str) -> None:
    services.task_policies.load(own)
    requests: list[Future[CommandAccepted]] = []
    with ThreadPoolExecutor(1) as thread:

        def acting() -> dict[str, str]:
            found = acting_in(services.worlds)
            requests.append(thread.submit(choose, services, own))
            wait(requests, 0.5)
            return found

        services.retention.acting = acting
        services.retention.delete_checkpoint(own)
        with pytest.raises(InvalidInput, match="is not a stored checkpoint"):
            requests[0].result(30.0)
    assert services.worlds["main"].handle.acting == frozenset()


def test_world_does_not_start_with_a_policy_that_is_deleted_meanwhile(
    services: Services, own: str
) -> None:
    before, started = services.worlds["main"], []

    def start(id: str, cell: Cell, policy: TaskPolicy | None, *_: object) -> LiveCell:
        services.retention.delete_checkpoint(own)
        started.append(LiveCell(cell, policy, id=id))
        return started[0]

    body = WorldCell(cell="pick-and-place", checkpoint=own)
    with pytest.raises(InvalidInput, match="is not a stored checkpoint"):
        set_world_cell("main", body, replace(services, start_world=start))
    assert services.worlds["main"] is before
    with pytest.raises(Conflict, match="was stopped"):
        started[0].handle.submit(PauseClock())


def test_policy_that_acts_is_named_once_its_training_has_dropped_it(
    services: Services, store: Store
) -> None:
    claim = started(store)
    made = own_policy()
    attempts.record_checkpoint(store, claim, 20, made)
    choose(services, made.sha256)

    def unstored() -> list[str]:
        services.checkpoints.forget_unstored()
        (world,) = asyncio.run(list_worlds(services)).items
        return world.unstored

    assert unstored() == []
    completion.give_back(store, claim)
    claim, _ = claimed(store)
    assert unstored() == [made.sha256]
    attempts.record_checkpoint(store, claim, 20, made)
    assert unstored() == []


def test_cell_is_not_removed_while_a_world_starts_in_it(services: Services) -> None:
    services.checkpoints.publish("pick", shipped("pick"))
    services.cells.add(workshop.cell())
    removals: list[Future[None]] = []
    with ThreadPoolExecutor(1) as thread:

        def start(id: str, cell: Cell, policy: TaskPolicy | None, *_: object) -> LiveCell:
            removals.append(thread.submit(delete_cell, "workshop", services))
            wait(removals, 0.5)
            return LiveCell(cell, policy, id=id)

        set_world_cell("main", WorldCell(cell="workshop"), replace(services, start_world=start))
        with pytest.raises(Conflict, match="is shown by the live world 'main'"):
            removals[0].result(30.0)
    assert services.cells.get("workshop") == services.worlds["main"].cell


def test_newest_policy_of_a_cell_is_left_out_if_it_is_deleted_meanwhile(
    services: Services, store: Store
) -> None:
    deleted, damaged = (checkpoints.put_checkpoint(store, own_policy()).sha256 for _ in "ab")
    with store.writing() as connection:
        connection.execute(
            sa.update(tables.checkpoints)
            .where(tables.checkpoints.c.sha256 == damaged)
            .values(tensors=b"damaged")
        )

    class Deletes(logging.Handler):
        """Deletes a checkpoint once the one before it is found to be damaged."""

        def emit(self, record: logging.LogRecord) -> None:
            services.retention.delete_checkpoint(deleted)

    handler = Deletes()
    logging.getLogger("app.api.registry").addHandler(handler)
    try:
        cell = load_cell("pick-and-place")
        assert newest_for(cell, CHOOSING, services.task_policies, services) is None
    finally:
        logging.getLogger("app.api.registry").removeHandler(handler)
    assert [one.sha256 for one in checkpoints.list_checkpoints(store).items] == [damaged]


def test_newest_policy_of_a_cell_is_one_whose_numbers_are_finite(
    services: Services, store: Store, own: str
) -> None:
    checkpoints.put_checkpoint(store, to_store(overflowing("pick")))
    cell = load_cell("pick-and-place")
    newest = newest_for(cell, CHOOSING, services.task_policies, services)
    assert newest is not None and newest.checkpoint == own
