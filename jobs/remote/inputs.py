"""Inputs of a job from the service."""

from collections.abc import Collection, Sequence
from dataclasses import replace
from urllib.parse import quote

from pydantic import TypeAdapter

from app.errors import InvalidInput
from app.policies.checkpoints.checkpoint import Checkpoint, load
from app.policies.checkpoints.upload import split
from app.policies.configs.presets import Preset
from app.policies.training.file_store import FileStore
from app.sim.cells.cell import Cell, cell_names, load_cell, parse_definition
from app.sim.mocap.importer import Motion
from app.store.records import StoredRecording
from jobs.recording_format import unpacked
from jobs.remote.connection import ServiceConnection

MAX_RECORD = 4 * 1024 * 1024
"""Longest description of a recording: its measures, runs and artifacts [bytes]."""
_RECORDING = TypeAdapter(StoredRecording)


class ServiceInputs:
    """Inputs from the routes of the service; see :class:`jobs.inputs.JobInputs`."""

    def __init__(self, service: ServiceConnection) -> None:
        self._service = service
        self.memory: FileStore = ServiceFiles(service)

    def cell(self, preset: Preset) -> Cell:
        """Return the cell that a preset is trained in."""
        definition = self._service.send("GET", f"{self._service.attempt}/cell").json()
        if preset.cell in cell_names():
            return load_cell(preset.cell)
        return parse_definition(definition)

    def checkpoint(self, reference: str) -> Checkpoint:
        """Return a checkpoint by SHA-256 or alias."""
        path = f"/v1/checkpoints/{quote(reference, safe='')}"
        manifest = self._service.send("GET", f"{path}/manifest").json()
        return load(manifest, self._service.send("GET", f"{path}/tensors").content)

    def motions(self, names: Sequence[str]) -> tuple[Motion, ...]:
        """Return the runs of recordings."""
        return tuple(
            replace(run, name=name)
            for place, name in enumerate(names)
            for run in self._runs(place, name)
        )

    def _runs(self, place: int, name: str) -> tuple[Motion, ...]:
        path = f"{self._service.attempt}/recordings/{quote(name, safe='')}"
        content = self._service.find(path)
        if content is None:
            raise InvalidInput(f"recordings[{place}]", name, "is not a stored recording")
        record, tensors = split(content, MAX_RECORD)
        return unpacked(_RECORDING.validate_python(record), tensors)


class ServiceFiles:
    """Files of a replay memory at the service, which deletes what no state lists."""

    def __init__(self, service: ServiceConnection) -> None:
        self._service = service

    def write(self, sha256: str, content: bytes) -> None:
        """Send a file."""
        self._service.send("PUT", self._path(sha256), content=content)

    def read(self, sha256: str) -> bytes:
        """Return a file, which may be damaged.

        Raises:
            FileNotFoundError: It is missing.
        """
        content = self._service.find(self._path(sha256))
        if content is None:
            raise FileNotFoundError(sha256)
        return content

    def keep(self, names: Collection[str]) -> None:
        """Do nothing: the service deletes files with each checkpoint."""

    def _path(self, sha256: str) -> str:
        return f"{self._service.attempt}/files/{sha256}"
