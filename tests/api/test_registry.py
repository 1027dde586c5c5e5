from dataclasses import dataclass

import pytest

from app.api.registry import CheckpointNames, PolicyRegistry
from app.errors import InvalidInput
from app.store import checkpoints, retention
from app.store.engine import Store
from tests.store.test_checkpoints import policy


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
            registry.forget((new.sha256,))
        return OnlyName(new.sha256)

    registry = PolicyRegistry(CheckpointNames(store), build, "pick")
    assert registry.load(new.sha256).checkpoint == new.sha256
    with pytest.raises(InvalidInput, match="is no stored checkpoint"):
        registry.load(new.sha256)
