"""Checkpoints that are deleted while they are loaded for a live world."""

import asyncio
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import replace
from pathlib import Path

import pytest

from app.api.routes.worlds import command_world, set_world_cell
from app.api.schemas.worlds import CommandAccepted, WorldCell
from app.api.services import Services
from app.errors import Conflict, InvalidInput
from app.live.commands import PauseClock, SetPolicy
from app.main import acting_in
from app.sim.cells.cell import Cell
from app.sim.pick.task_policy import TaskPolicy
from app.store import checkpoints
from app.store.engine import Store
from tests.support.databases import SQLITE_ONLY
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
    with pytest.raises(InvalidInput, match="is no stored checkpoint"):
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
        with pytest.raises(InvalidInput, match="is no stored checkpoint"):
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
    with pytest.raises(InvalidInput, match="is no stored checkpoint"):
        set_world_cell("main", body, replace(services, start_world=start))
    assert services.worlds["main"] is before
    with pytest.raises(Conflict, match="was stopped"):
        started[0].handle.submit(PauseClock())
