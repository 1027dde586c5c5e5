from dataclasses import dataclass
from typing import Any

import pytest
import sqlalchemy as sa
from fastapi.testclient import TestClient

from app.api.registry import CheckpointNames, PolicyRegistry
from app.errors import CheckpointMismatch, Damaged, InvalidInput
from app.policies.checkpoints.upload import join
from app.store import attempts, checkpoints, completion, retention
from app.store.database import tables
from app.store.engine import Store
from app.store.records import ResumeState
from tests.api.conftest import services_of
from tests.store.test_attempts import policy
from tests.support.databases import claimed, started
from tests.support.idle_service import own_policy
from tests.support.waiting import wait_until


@dataclass(frozen=True)
class OnlyName:
    """A policy that knows its checkpoint only."""

    checkpoint: str


def test_checkpoint_deleted_while_it_is_loaded_answers_no_later_request(store: Store) -> None:
    new = policy(b"1")
    checkpoints.put_checkpoint(store, new)

    def build(*_: object) -> OnlyName:
        if checkpoints.list_checkpoints(store).items:
            retention.delete_checkpoint(store, new.sha256, {})
            names.forget((new.sha256,))
        return OnlyName(new.sha256)

    names = CheckpointNames(store)
    registry = PolicyRegistry(names, build, "pick")
    assert registry.load(new.sha256).checkpoint == new.sha256
    with pytest.raises(InvalidInput, match="is not a stored checkpoint"):
        registry.load(new.sha256)


def test_checkpoint_that_does_not_fit_is_read_once_until_it_is_deleted(store: Store) -> None:
    new, built = policy(b"1"), list[object]()
    checkpoints.put_checkpoint(store, new)

    def build(*content: object) -> OnlyName:
        built.append(content)
        raise CheckpointMismatch("purpose", "reaching goals", "choosing tasks")

    names = CheckpointNames(store)
    registry = PolicyRegistry(names, build, "pick")
    for _ in range(3):
        with pytest.raises(
            CheckpointMismatch, match="'choosing tasks', expected 'reaching goals'"
        ):
            registry.load(new.sha256)
    assert len(built) == 1
    retention.delete_checkpoint(store, new.sha256, {})
    names.forget_unstored()
    with pytest.raises(InvalidInput, match="is not a stored checkpoint"):
        registry.load(new.sha256)


def test_damage_found_while_a_checkpoint_is_deleted_is_not_kept(store: Store) -> None:
    new, names = policy(b"1"), CheckpointNames(store)
    checkpoints.put_checkpoint(store, new)
    with store.writing() as connection:
        connection.execute(sa.update(tables.checkpoints).values(tensors=b"2"))
    found = checkpoints.find_damaged(store)
    damage = next(found)
    assert isinstance(damage, Damaged)
    retention.delete_checkpoint(store, new.sha256, {})
    names.forget((new.sha256,))
    names.mark_damaged(damage)
    assert names.damaged == ()


def test_damaged_checkpoint_that_is_uploaded_again_is_named_no_longer(
    client: TestClient,
) -> None:
    services, new = services_of(client), own_policy()
    content = join(new.manifest, new.tensors)
    assert client.post("/v1/checkpoints", content=content).status_code == 201
    broken = sa.update(tables.checkpoints).where(tables.checkpoints.c.sha256 == new.sha256)
    with services.store.writing() as connection:
        connection.execute(broken.values(tensors=b"2"))
    with pytest.raises(Damaged):
        services.checkpoints.read(new.sha256)
    assert client.get("/readyz").json()["damaged"] == [new.sha256]
    assert client.post("/v1/checkpoints", content=content).status_code == 200
    assert client.get("/readyz").json() == {"status": "ready"}


def test_checkpoint_that_a_repeated_attempt_drops_answers_no_longer(store: Store) -> None:
    claim = started(store)
    kept, dropped = policy(b"1"), policy(b"2")
    state = ResumeState(step=10, manifest={}, tensors=b"state")
    attempts.record_checkpoint(store, claim, 10, kept, state)
    attempts.record_checkpoint(store, claim, 20, dropped)
    names = CheckpointNames(store)
    by_tensors = {one.tensors: OnlyName(one.sha256) for one in (kept, dropped)}
    registry = PolicyRegistry(names, lambda _, tensors: by_tensors[tensors], "pick")
    for one in (kept, dropped):
        registry.load(one.sha256)
    completion.give_back(store, claim)
    claimed(store)
    names.forget_unstored()
    assert registry.held == {kept.sha256}
    with pytest.raises(InvalidInput, match="is not a stored checkpoint"):
        registry.load(dropped.sha256)


def test_checkpoint_that_another_process_deletes_answers_no_longer(
    client: TestClient, state: dict[str, Any]
) -> None:
    store = services_of(client).store
    sha256 = checkpoints.put_checkpoint(store, own_policy()).sha256
    asked = {**state, "previous": None, "checkpoint": sha256}
    assert client.post("/v1/task-selection", json=asked).json()["checkpoint"] == sha256
    retention.delete_checkpoint(store, sha256, {})
    wait_until(lambda: client.post("/v1/task-selection", json=asked).status_code == 422)
