"""Checkpoints and the store: a damaged shipped one is restored where it is read."""

import logging

from app.errors import Damaged
from app.policies.checkpoints import pretrained
from app.policies.checkpoints.checkpoint import Checkpoint
from app.store.checkpoints import put_checkpoint, read_checkpoint
from app.store.engine import Store
from app.store.records import CheckpointRecord, NewCheckpoint

logger = logging.getLogger(__name__)


def read_sound(store: Store, reference: str) -> tuple[CheckpointRecord, bytes]:
    """Return a checkpoint, by SHA-256 or alias, with its safetensors bytes.

    A damaged shipped one is stored again from the package.

    Raises:
        NotFound: No checkpoint has that name.
        Damaged: It is damaged, and not shipped.
    """
    try:
        return read_checkpoint(store, reference)
    except Damaged as error:
        for alias, sha256 in pretrained.SHA256.items():
            if sha256 == error.sha256:
                put_checkpoint(store, shipped(alias))
                return read_checkpoint(store, sha256)
        raise


def shipped(alias: str) -> NewCheckpoint:
    """Return a shipped checkpoint.

    Raises:
        NotFound: None is shipped under that alias.
        Damaged: The package's file is damaged.
    """
    return to_store(pretrained.load(alias))


def to_store(checkpoint: Checkpoint) -> NewCheckpoint:
    """Return a checkpoint as the store takes it."""
    return NewCheckpoint(
        sha256=checkpoint.sha256, manifest=checkpoint.manifest, tensors=checkpoint.tensors
    )
