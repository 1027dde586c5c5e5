"""Replay memory on disk: files of transitions named by their SHA-256, written incrementally.

Each file holds consecutive rows, one row per step of all environments. A state of a training
lists the files whose rows the replay buffer still holds; a new state adds only files of the
rows since the state before it. The next observation of a transition is nearly always the
observation of the next row, so that only the others are stored.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from hashlib import sha256
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import load as load_arrays
from safetensors.numpy import save as save_arrays
from stable_baselines3.common.buffers import ReplayBuffer

from app.errors import Damaged
from app.policies.training.file_store import FileStore

FILE_BYTES = 32 * 1024 * 1024
"""Size of a file of transitions, approximately [bytes]."""
STORED = ("observations", "actions", "rewards", "dones", "timeouts")
"""Arrays of a replay buffer that are stored row by row."""
Files = list[dict[str, Any]]
"""Files of a replay memory: ``first`` and ``last`` (exclusive) row and ``sha256`` of each."""


class MemoryFiles:
    """Files of one training's replay memory.

    Args:
        store: Holds the files.
        access: Executes a read or write of the store, and may repeat it while the disk is full
            or fails.
    """

    def __init__(
        self,
        store: FileStore,
        access: Callable[[Callable[[], None]], None] = lambda action: action(),
    ) -> None:
        self._store, self._access = store, access
        self._files: Files = []

    def write(self, memory: ReplayBuffer, n_rows: int, following: NDArray[Any]) -> Files:
        """Write the rows since the last call; return the files with all present rows.

        Args:
            n_rows: Rows added since the start of the training.
            following: Present observations, (n_envs, obs_size).

        Raises:
            StorageFull: No room is left.
        """
        oldest = max(0, n_rows - memory.buffer_size)
        self._files = [one for one in self._files if one["last"] > oldest]
        first = self._files[-1]["last"] if self._files else oldest
        per_row = sum(getattr(memory, name)[0].nbytes for name in STORED)
        length = max(1, FILE_BYTES // per_row)
        for row in range(first, n_rows, length):
            last = min(row + length, n_rows)
            after = memory.observations[last % memory.buffer_size]
            content = save_arrays(
                _rows_of(memory, row, last, following if last == n_rows else after)
            )
            entry = {"first": row, "last": last, "sha256": sha256(content).hexdigest()}
            self._access(partial(self._store.write, entry["sha256"], content))
            self._files.append(entry)
        return [dict(one) for one in self._files]

    def read(self, memory: ReplayBuffer, n_rows: int, files: Files) -> None:
        """Fill a replay buffer with the rows of files.

        Raises:
            Damaged: A file is missing or changed, or rows are missing.
            StorageUnavailable: A file cannot be read for now.
        """
        row = max(0, n_rows - memory.buffer_size)
        for entry in files:
            if not entry["first"] <= row < entry["last"]:
                raise _damaged(entry["sha256"])
            arrays = load_arrays(self._content(entry))
            skipped = row - entry["first"]
            rows = np.arange(row, entry["last"]) % memory.buffer_size
            for name in STORED:
                getattr(memory, name)[rows] = arrays[name][skipped:]
            memory.next_observations[rows] = _next_observations(arrays)[skipped:]
            row = entry["last"]
        if row != n_rows:
            raise _damaged(f"row {row}")
        memory.full, memory.pos = n_rows >= memory.buffer_size, n_rows % memory.buffer_size
        self._files = [dict(one) for one in files]

    def check(self, files: Files) -> None:
        """Compare files with their digests.

        Raises:
            Damaged: A file is missing or changed.
            StorageUnavailable: A file cannot be read for now.
        """
        for entry in files:
            self._content(entry)

    def keep(self, states: Sequence[Mapping[str, Any] | None]) -> None:
        """Delete all files that the manifests of some states do not list."""
        self._store.keep(
            {one["sha256"] for state in states if state for one in state["memory"]}
        )

    def _content(self, entry: Mapping[str, Any]) -> bytes:
        found: list[bytes] = []
        try:
            self._access(lambda: found.append(self._store.read(entry["sha256"])))
        except FileNotFoundError as error:
            raise _damaged(entry["sha256"]) from error
        if sha256(found[-1]).hexdigest() != entry["sha256"]:
            raise _damaged(entry["sha256"])
        return found[-1]


def _damaged(name: str) -> Damaged:
    return Damaged("replay memory", name, "an earlier state is used")


def _rows_of(
    memory: ReplayBuffer, first: int, last: int, after: NDArray[Any]
) -> dict[str, NDArray[Any]]:
    """Return the arrays of some rows; ``after`` are the observations of row ``last``."""
    rows = np.arange(first, last) % memory.buffer_size
    arrays = {name: getattr(memory, name)[rows] for name in STORED}
    following = np.concatenate([arrays["observations"][1:], after[None]])
    reached = memory.next_observations[rows]
    changed = (_bits(following) != _bits(reached)).any(axis=-1)
    ends = np.flatnonzero(changed)
    return {**arrays, "after": after.copy(), "ends": ends, "reached": reached[changed]}


def _next_observations(arrays: Mapping[str, NDArray[Any]]) -> NDArray[Any]:
    found = np.concatenate([arrays["observations"][1:], arrays["after"][None]])
    found.reshape(-1, found.shape[-1])[arrays["ends"]] = arrays["reached"]
    return found


def _bits(array: NDArray[Any]) -> NDArray[np.uint8]:
    return np.ascontiguousarray(array).view(np.uint8)
