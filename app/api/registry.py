"""Cache of loaded policies, and names of stored checkpoints.

Task selection, sorting and reaching have a registry each, over the same checkpoint names. Live
worlds and routes share the loaded objects, so that equal states give equal decisions.
"""

import logging
import threading
from collections import OrderedDict
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Any, Generic, TypeVar

from starlette.concurrency import run_in_threadpool

from app.errors import CheckpointMismatch, Damaged, InvalidInput, NotFound
from app.store.checkpoints import (
    list_aliases,
    put_checkpoint,
    remove_alias,
    set_alias,
    stored_among,
)
from app.store.engine import Store
from app.store.records import CheckpointRecord, NewCheckpoint
from jobs.checkpoints import read_sound

logger = logging.getLogger(__name__)

MAX_POLICIES = 32
"""Largest number of policies in a registry, and of checkpoints that it knows not to fit."""
DEFAULT_ALIAS = "pick"
"""Default policy for task selection."""
SORTING_ALIASES = ("sorting-e0", "sorting-e1")
"""Shipped policies for sorting; each has the name of its work cell."""
REACH_ALIAS = "reach"
"""Default policy for reaching."""


P = TypeVar("P")
Q = TypeVar("Q")


class CheckpointNames:
    """Aliases, damage and use of the stored checkpoints, kept in memory; thread-safe.

    Args:
        store: The database; it needs no tables until a method is called.
    """

    def __init__(self, store: Store) -> None:
        self.store = store
        """The database."""
        self.registries: list[PolicyRegistry[Any]] = []
        """The registries of loaded policies."""
        self.acting: Callable[[], Iterable[str]] = tuple
        """Returns the SHA-256 of each checkpoint that acts."""
        self.unstored: frozenset[str] = frozenset()
        """SHA-256 of those that act and are no longer stored."""
        self._lock = threading.Lock()
        self._aliases: dict[str, str] | None = None
        self._damaged: dict[str, str] = {}

    def put(self, checkpoint: NewCheckpoint) -> CheckpointRecord:
        """Store a checkpoint without a job; a damaged one is replaced.

        Raises:
            InvalidInput: It is too large.
        """
        record = put_checkpoint(self.store, checkpoint)
        self._damaged.pop(record.sha256, None)
        return record

    def publish(self, alias: str, checkpoint: NewCheckpoint) -> None:
        """Store a shipped checkpoint under its alias."""
        self.put(checkpoint)
        self.point(alias, checkpoint.sha256)

    def point(self, alias: str, sha256: str) -> None:
        """Set the checkpoint of an alias.

        Raises:
            NotFound: There is no such checkpoint.
            InvalidInput: The alias is not a valid name.
        """
        if list_aliases(self.store).get(alias) != sha256:  # another server may have set it
            set_alias(self.store, alias, sha256)
        self.refresh()

    def remove(self, alias: str) -> None:
        """Remove an alias; its checkpoint stays.

        Raises:
            NotFound: There is no such alias.
        """
        remove_alias(self.store, alias)
        self.refresh()

    def refresh(self) -> None:
        """Read the aliases again, which another server may have changed."""
        with self._lock:
            self._aliases = list_aliases(self.store)

    @property
    def aliases(self) -> Mapping[str, str]:
        """SHA-256 of each alias."""
        if self._aliases is None:
            self.refresh()
        return self._aliases or {}

    def read(self, name: str) -> tuple[CheckpointRecord, bytes]:
        """Return a checkpoint with its tensors.

        Raises:
            InvalidInput: Nothing has that name.
            Damaged: It is damaged, and not shipped.
        """
        try:
            record, tensors = read_sound(self.store, self.aliases.get(name, name))
        except Damaged as error:
            self.mark_damaged(error)
            raise
        except NotFound:
            rule = "is not a stored checkpoint: neither its SHA-256 nor an alias"
            raise InvalidInput("checkpoint", name, rule, tuple(self.aliases)) from None
        self._damaged.pop(record.sha256, None)
        return record, tensors

    def mark_damaged(self, damage: Damaged) -> None:
        """Remember that a checkpoint is damaged, until it is read undamaged or deleted."""
        if damage.sha256 not in self._damaged:
            logger.error("%s", damage.message)
        self._damaged[damage.sha256] = damage.name
        self.forget_unstored()

    def forget(self, removed: Collection[str]) -> None:
        """Drop damage and policies of deleted checkpoints, by SHA-256."""
        for sha256 in removed:
            self._damaged.pop(sha256, None)
        for registry in self.registries:
            registry.forget(removed)

    def forget_unstored(self) -> None:
        """Drop damage and policies of checkpoints that are no longer stored.

        Attempts that repeat steps and other servers delete checkpoints, too. Each addition
        calls it: the checkpoint may have been deleted since it was read.
        """
        acting = set(self.acting())
        held = acting.union(self._damaged, *(one.held for one in self.registries))
        if held := held.difference(self.aliases.values()):  # those with an alias are stored
            held -= stored_among(self.store, held)
            self.forget(held)
        self.unstored = frozenset(acting & held)

    @property
    def damaged(self) -> tuple[str, ...]:
        """Names of the checkpoints found damaged."""
        return tuple(sorted(self._damaged.values()))


class PolicyRegistry(Generic[P]):
    """Loaded policies of one kind; safe to use from any thread.

    Args:
        build: Makes a policy from a manifest and safetensors bytes; refuses other kinds.
        default: Alias of the default policy.
    """

    def __init__(
        self,
        names: CheckpointNames,
        build: Callable[[Mapping[str, Any], bytes], P],
        default: str,
    ) -> None:
        self._names = names
        self._build = build
        self._default = default
        self._lock = threading.Lock()
        self._policies: OrderedDict[str, P] = OrderedDict()
        self._mismatches: OrderedDict[str, CheckpointMismatch] = OrderedDict()
        names.registries.append(self)

    @property
    def held(self) -> set[str]:
        """SHA-256 of the policies in memory, and of the checkpoints known not to fit."""
        with self._lock:
            return {*self._policies, *self._mismatches}

    def _loaded(self, reference: str | None) -> P | None:
        """Return a policy by SHA-256 or alias if it is in memory, without disk access.

        Raises:
            CheckpointMismatch: It is known not to fit.
        """
        name = self._or_default(reference)
        sha256 = self._names.aliases.get(name, name)
        with self._lock:
            policy = self._policies.get(sha256)
            if policy is not None:
                self._policies.move_to_end(sha256)
            known = self._mismatches.get(sha256)
        if known is not None:
            raise CheckpointMismatch(known.field, known.expected, known.actual)
        return policy

    def _or_default(self, reference: str | None) -> str:
        return self._default if reference is None else reference

    def forget(self, removed: Iterable[str]) -> None:
        """Drop the policies of deleted checkpoints, by SHA-256."""
        with self._lock:
            for sha256 in removed:
                self._policies.pop(sha256, None)
                self._mismatches.pop(sha256, None)

    def check(self, manifest: Mapping[str, Any], tensors: bytes) -> None:
        """Check that a checkpoint can be loaded as a policy of this kind.

        Raises:
            InvalidInput: The manifest breaks a rule.
            CheckpointMismatch: It is of another kind, its tensors do not fit, or its numbers
                overflow.
        """
        self._build(manifest, tensors)

    def load(self, reference: str | None) -> P:
        """Return a policy by SHA-256 or alias, from the store if it is not in memory.

        Args:
            reference: SHA-256 or alias; the default policy if None.

        Raises:
            InvalidInput: Nothing has that name.
            CheckpointMismatch: It is a policy of another kind, or its numbers overflow.
            Damaged: It is damaged, and not shipped.
        """
        policy = self._loaded(reference)
        if policy is not None:
            return policy
        record, tensors = self._names.read(self._or_default(reference))
        try:
            policy = self._build(record.manifest, tensors)
        except CheckpointMismatch as error:
            known = CheckpointMismatch(error.field, error.expected, error.actual)
            self._keep(self._mismatches, record.sha256, known)
            raise
        self._keep(self._policies, record.sha256, policy)
        return policy

    def _keep(self, kept: OrderedDict[str, Q], sha256: str, one: Q) -> None:
        """Keep what became of a stored checkpoint, in place of the oldest one."""
        with self._lock:
            kept[sha256] = one
            while len(kept) > MAX_POLICIES:
                kept.popitem(last=False)
        self._names.forget_unstored()

    async def get(self, reference: str | None) -> P:
        """Return a policy as :meth:`load`; one that is not in memory is read on a thread."""
        policy = self._loaded(reference)
        return await run_in_threadpool(self.load, reference) if policy is None else policy
