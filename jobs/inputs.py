"""Inputs of a job: its cell, checkpoint and recordings, and the files of its replay memory.

``StoreInputs`` reads them from the database and the data folder; ``jobs.remote.inputs`` from
the service.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from app.policies.checkpoints.checkpoint import Checkpoint, load
from app.policies.configs.presets import Preset
from app.policies.training.file_store import FileFolder, FileStore
from app.sim.cells.cell import Cell
from app.sim.mocap.importer import Motion
from app.store.engine import Store
from jobs.cell_catalog import CellCatalog
from jobs.checkpoints import read_sound
from jobs.recording_catalog import RecordingCatalog
from jobs.resume_files import folder_of


class JobInputs(Protocol):
    """Inputs of one job."""

    @property
    def memory(self) -> FileStore:
        """Files of the replay memory."""

    def cell(self, preset: Preset) -> Cell:
        """Return the cell that a preset is trained in.

        Raises:
            ServiceError: No cell has that name, or the preset cannot be trained in it.
        """

    def checkpoint(self, reference: str) -> Checkpoint:
        """Return a checkpoint by SHA-256 or alias.

        Raises:
            ServiceError: There is none, or it is damaged.
        """

    def motions(self, names: Sequence[str]) -> tuple[Motion, ...]:
        """Return the runs of recordings.

        Raises:
            ServiceError: One is not stored, or does not fit this version.
        """


class StoreInputs:
    """Inputs from the database and the data folder."""

    def __init__(self, store: Store, data_dir: Path, job_id: str) -> None:
        self._store = store
        self.memory: FileStore = FileFolder(folder_of(data_dir, job_id))

    def cell(self, preset: Preset) -> Cell:
        """Return the cell that a preset is trained in."""
        return CellCatalog(self._store).to_train_in(preset)

    def checkpoint(self, reference: str) -> Checkpoint:
        """Return a checkpoint by SHA-256 or alias."""
        record, tensors = read_sound(self._store, reference)
        return load(dict(record.manifest), tensors)

    def motions(self, names: Sequence[str]) -> tuple[Motion, ...]:
        """Return the runs of recordings."""
        return RecordingCatalog(self._store).runs_of(names)
