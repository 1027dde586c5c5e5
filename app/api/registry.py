"""Cache of loaded policies, and names of stored checkpoints.

Task selection, sorting and reaching have a registry each, over the same checkpoint names. Live
worlds and routes share the loaded objects, so that equal states give equal decisions.
"""

import logging
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Generic, Protocol, TypeVar

from starlette.concurrency import run_in_threadpool

from app.errors import Damaged, InvalidInput, NotFound
from app.store.checkpoints import list_aliases, put_checkpoint, remove_alias, set_alias
from app.store.engine import Store
from app.store.records import CheckpointRecord, NewCheckpoint
from jobs.checkpoints import read_sound

logger = logging.getLogger(__name__)

MAX_POLICIES = 32
"""Largest number of policies in a registry."""
DEFAULT_ALIAS = "pick"
"""Default policy for task selection."""
SORTING_ALIASES = ("sorting-e0", "sorting-e1")
"""Shipped policies for sorting; each has the name of its work cell."""
REACH_ALIAS = "reach"
"""Default policy for reaching."""


class Loaded(Protocol):
    """A loaded policy."""

    @property
    def checkpoint(self) -> str:
        """SHA-256 of its checkpoint."""


P = TypeVar("P", bound=Loaded)
Build = Callable[[Mapping[str, Any], bytes], P]
"""Makes a policy from a manifest and safetensors bytes."""


class CheckpointNames:
    """The aliases of stored checkpoints, in memory; safe to use from any thread."""

    def __init__(self, store: Store) -> None:
        self.store = store
        """The database."""
        self._lock = threading.Lock()
        self._aliases: dict[str, str] = list_aliases(store)
        self._damaged: dict[str, str] = {}

    def publish(self, alias: str, checkpoint: NewCheckpoint) -> None:
        """Store a shipped checkpoint under its alias."""
        put_checkpoint(self.store, checkpoint)
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
        return self._aliases

    def read(self, name: str) -> tuple[CheckpointRecord, bytes]:
        """Return a checkpoint with its tensors.

        Raises:
            InvalidInput: Nothing has that name.
            Damaged: It is damaged, and not shipped.
        """
        try:
            record, tensors = read_sound(self.store, self._aliases.get(name, name))
        except Damaged as error:
            self.mark_damaged(error)
            raise
        except NotFound:
            rule = "is no stored checkpoint: neither its SHA-256 nor an alias"
            raise InvalidInput("checkpoint", name, rule, tuple(self._aliases)) from None
        self._damaged.pop(record.sha256, None)
        return record, tensors

    def mark_damaged(self, damage: Damaged) -> None:
        """Remember that a checkpoint is damaged, until it is read undamaged."""
        if damage.sha256 not in self._damaged:
            logger.error("%s", damage.message)
        self._damaged[damage.sha256] = damage.name

    def forget(self, removed: Iterable[str]) -> None:
        """Drop the damage of deleted checkpoints, by SHA-256."""
        for sha256 in removed:
            self._damaged.pop(sha256, None)

    @property
    def damaged(self) -> tuple[str, ...]:
        """Names of the checkpoints found damaged."""
        return tuple(sorted(self._damaged.values()))


class PolicyRegistry(Generic[P]):
    """Loaded policies of one kind; safe to use from any thread.

    Args:
        names: The stored checkpoints.
        build: Makes a policy from a manifest and safetensors bytes; refuses other kinds.
        default: Alias of the default policy.
    """

    def __init__(self, names: CheckpointNames, build: Build[P], default: str) -> None:
        self._names = names
        self._build = build
        self._default = default
        self._lock = threading.Lock()
        self._policies: OrderedDict[str, P] = OrderedDict()
        self._removals = 0

    def _loaded(self, reference: str | None) -> P | None:
        """Return a policy by SHA-256 or alias if it is in memory, without disk access."""
        sha256 = self._names.aliases.get(reference or self._default, reference)
        with self._lock:
            policy = self._policies.get(sha256 or "")
            if policy is not None:
                self._policies.move_to_end(policy.checkpoint)
            return policy

    def forget(self, removed: Iterable[str]) -> None:
        """Drop the policies of deleted checkpoints, by SHA-256."""
        with self._lock:
            self._removals += 1
            for sha256 in removed:
                self._policies.pop(sha256, None)

    def check(self, manifest: Mapping[str, Any], tensors: bytes) -> None:
        """Check that a checkpoint can be loaded as a policy of this kind.

        Raises:
            InvalidInput: The manifest breaks a rule.
            CheckpointMismatch: It is of another kind, or its tensors do not fit.
        """
        self._build(manifest, tensors)

    def load(self, reference: str | None) -> P:
        """Return a policy by SHA-256 or alias, from the store if it is not in memory.

        Args:
            reference: SHA-256 or alias; the default policy if None.

        Raises:
            InvalidInput: Nothing has that name.
            CheckpointMismatch: It is a policy of another kind.
            Damaged: It is damaged, and not shipped.
        """
        policy = self._loaded(reference)
        if policy is not None:
            return policy
        removals = self._removals
        record, tensors = self._names.read(reference or self._default)
        policy = self._build(record.manifest, tensors)
        with self._lock:
            if removals == self._removals:  # it may be among the removed ones
                self._policies[record.sha256] = policy
            while len(self._policies) > MAX_POLICIES:
                self._policies.popitem(last=False)
        return policy

    async def get(self, reference: str | None) -> P:
        """Return a policy as :meth:`load` does; one that is not in memory is read on a thread.

        Args:
            reference: SHA-256 or alias; the default policy if None.

        Raises:
            ServiceError: As for :meth:`load`.
        """
        policy = self._loaded(reference)
        return await run_in_threadpool(self.load, reference) if policy is None else policy
