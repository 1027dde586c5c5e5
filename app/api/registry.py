"""Checkpoints as objects that decide, kept once loaded.

The live world and ``POST /v1/task-selection`` get the very same :class:`TaskPolicy` objects
from here, so that one state gives one choice.
"""

import threading
from collections import OrderedDict
from collections.abc import Callable, Mapping
from typing import Any

from app.errors import InvalidInput, NotFound
from app.sim.ports import TaskPolicy
from app.store.checkpoints import (
    get_checkpoint,
    list_aliases,
    put_checkpoint,
    read_tensors,
    set_alias,
)
from app.store.engine import Store
from app.store.records import CheckpointRecord, NewCheckpoint

MAX_POLICIES = 32
DEFAULT_ALIAS = "pick"

Build = Callable[[Mapping[str, Any], bytes], TaskPolicy]


class PolicyRegistry:
    """The policies that are loaded; safe to use from any thread.

    Args:
        store: Where checkpoints are kept.
        build: Makes a policy from a manifest and safetensors bytes.
    """

    def __init__(self, store: Store, build: Build) -> None:
        self._store = store
        self._build = build
        self._lock = threading.Lock()
        self._policies: OrderedDict[str, TaskPolicy] = OrderedDict()
        self._aliases: dict[str, str] = list_aliases(store)

    def publish(self, alias: str, checkpoint: NewCheckpoint) -> None:
        """Store a checkpoint that came with the service and point its alias to it."""
        put_checkpoint(self._store, checkpoint)
        self.point(alias, checkpoint.sha256)

    def point(self, alias: str, sha256: str) -> None:
        """Let an alias name another checkpoint from now on.

        Raises:
            NotFound: There is no such checkpoint.
            InvalidInput: The alias is no name.
        """
        if self._aliases.get(alias) != sha256:
            set_alias(self._store, alias, sha256)
            with self._lock:
                self._aliases = list_aliases(self._store)

    @property
    def aliases(self) -> Mapping[str, str]:
        """The SHA-256 behind every alias."""
        return self._aliases

    def loaded(self, reference: str | None) -> TaskPolicy | None:
        """Return a policy by SHA-256 or alias if it is in memory; never waits for a disk."""
        sha256 = self._aliases.get(reference or DEFAULT_ALIAS, reference)
        with self._lock:
            policy = self._policies.get(sha256 or "")
            if policy is not None:
                self._policies.move_to_end(policy.checkpoint)
            return policy

    def load(self, reference: str | None) -> TaskPolicy:
        """Return a policy by SHA-256 or alias, reading it from the store if need be.

        Args:
            reference: SHA-256 or alias; the default policy if None.

        Raises:
            InvalidInput: Nothing has that name.
            CheckpointMismatch: It is no policy that chooses tasks.
        """
        policy = self.loaded(reference)
        if policy is not None:
            return policy
        record = self.check(reference)
        tensors = read_tensors(self._store, record.sha256)
        policy = self._build(record.manifest, tensors)
        with self._lock:
            self._policies[record.sha256] = policy
            while len(self._policies) > MAX_POLICIES:
                self._policies.popitem(last=False)
        return policy

    def check(self, reference: str | None) -> CheckpointRecord:
        """Return what the store knows of a checkpoint that a caller named.

        Raises:
            InvalidInput: Nothing has that name.
        """
        name = reference or DEFAULT_ALIAS
        try:
            return get_checkpoint(self._store, name)
        except NotFound:
            rule = "is no stored checkpoint: neither its SHA-256 nor an alias"
            raise InvalidInput("checkpoint", name, rule, tuple(self._aliases)) from None
