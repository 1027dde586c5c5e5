"""States of one training in a folder, for trainings without a server.

The two newest states are kept; a damaged one is detected by its digest and the one before it
is used. ``memory/`` holds the files of the replay memory.
"""

import json
import logging
import shutil
from pathlib import Path

from app.digests import has_digest
from app.durable_files import read_stored, write_durably
from app.errors import Damaged, InvalidInput
from app.policies.training.file_store import FileFolder
from app.policies.training.memory_files import MemoryFiles
from app.policies.training.state import TrainingState, load

logger = logging.getLogger(__name__)

KEPT = 2
"""Number of states that are kept, against damage to one."""


class StateFolder:
    """States of one training.

    Args:
        folder: Folder of the states; no other files are in it.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.memory = MemoryFiles(FileFolder(folder / "memory"))
        """Files of the replay memory."""

    def write(self, state: TrainingState) -> None:
        """Store a state and delete those that are no longer needed.

        Raises:
            StorageFull: No room is left; the earlier states stay.
        """
        path = self._folder / f"step-{state.step:012d}.json"
        write_durably(_tensors_of(path), state.tensors)
        content = {"sha256": state.sha256, "manifest": state.manifest}
        write_durably(path, json.dumps(content).encode())
        kept = [one for one in self._newest_first() if one.name <= path.name][:KEPT]
        for old in set(self._folder.glob("step-*")) - {*kept, *(_tensors_of(p) for p in kept)}:
            old.unlink(missing_ok=True)

    def newest(self) -> TrainingState | None:
        """Return the newest undamaged state; None where there is none.

        Raises:
            StorageUnavailable: A file cannot be read for now.
        """
        for path in self._newest_first():
            try:
                content = json.loads(read_stored(path))
                tensors = read_stored(_tensors_of(path))
                if not has_digest(content["sha256"], content["manifest"], tensors):
                    raise ValueError("its content does not match its checksum")
                state = load(content["manifest"], tensors)
                self.memory.check(state.manifest["memory"])
            except (
                FileNotFoundError,
                ValueError,
                KeyError,
                TypeError,
                Damaged,
                InvalidInput,
            ) as error:
                logger.warning("%s cannot be used, an earlier state is: %s", path, error)
            else:
                return state
        return None

    def remove(self) -> None:
        """Delete all states, once the training has ended."""
        shutil.rmtree(self._folder, ignore_errors=True)

    def _newest_first(self) -> list[Path]:
        return sorted(self._folder.glob("step-*.json"), reverse=True)


def _tensors_of(path: Path) -> Path:
    return path.with_suffix(".safetensors")
