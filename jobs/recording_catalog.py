"""Stored recordings by name: files in, runs of the 18-DoF human model out."""

import hashlib
import re
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import PurePath

from app.errors import Conflict, InvalidInput, NotFound
from app.sim.mocap.importer import Motion, format_of
from app.sim.mocap.read_options import NOTHING_STATED, ReadOptions
from app.store import recordings as stored
from app.store.engine import Store
from app.store.records import NewRecording, StoredRecording
from jobs.import_process import import_here
from jobs.recording_format import unpacked

MAX_CACHED_FRAMES = 500_000
"""Frames of the recordings that stay in memory (80 MB); the newest always stays."""
MAX_FILE_NAME = 255
"""Longest file name [characters]."""

Importer = Callable[[bytes, str, str, str, ReadOptions], NewRecording]
"""Imports a file: its content, its name, name of the recording, SHA-256, reading options."""

_NAME = re.compile(r"[a-z0-9][a-z0-9-]{0,63}")


class RecordingCatalog:
    """Finds recordings by name; safe to use from any thread."""

    def __init__(self, store: Store, importer: Importer = import_here) -> None:
        self._store = store
        self._import = importer
        self._lock = threading.Lock()
        self._importing = threading.Lock()
        self._cached: OrderedDict[int, tuple[Motion, ...]] = OrderedDict()

    def names(self) -> tuple[str, ...]:
        """Return the names of all recordings."""
        return stored.recording_names(self._store)

    def all(self) -> tuple[StoredRecording, ...]:
        """Return all recordings, by name, without their runs."""
        return stored.list_recordings(self._store)

    def with_runs(self, name: str) -> tuple[StoredRecording, bytes]:
        """Return a recording with its runs as safetensors bytes.

        Raises:
            NotFound: No recording has that name.
        """
        with self._known_names_in_error(name):
            return stored.read_runs(self._store, name)

    def get(self, name: str) -> tuple[Motion, ...]:
        """Return the runs of a recording, from memory where they are there.

        Raises:
            NotFound: No recording has that name.
            InvalidInput: The stored recording does not fit this version.
        """
        with self._known_names_in_error(name):
            # The number differs where another process gave the name to another recording.
            number = stored.recording_number(self._store, name)
            with self._lock:
                if number in self._cached:
                    self._cached.move_to_end(number)
                    return self._cached[number]
            record, tensors = stored.read_runs(self._store, name)
        runs = unpacked(record, tensors)
        with self._lock:
            self._cached[record.number] = runs
            while len(self._cached) > 1 and self._n_cached() > MAX_CACHED_FRAMES:
                self._cached.popitem(last=False)
        return runs

    def check(self, names: Sequence[str]) -> None:
        """Check that recordings are stored.

        Raises:
            InvalidInput: One is not; names its place and the stored ones.
        """
        known = self.names()
        for place, name in enumerate(names):
            if name not in known:
                rule = "is not a stored recording" + ("" if known else ": there is none")
                raise InvalidInput(f"recordings[{place}]", name, rule, known)

    def runs_of(self, names: Sequence[str]) -> tuple[Motion, ...]:
        """Return the runs of several recordings, each with the name of its recording.

        Raises:
            InvalidInput: One is not stored, or does not fit this version.
        """
        self.check(names)
        return tuple(replace(run, name=name) for name in names for run in self.get(name))

    def add(
        self,
        content: bytes,
        file_name: str,
        name: str | None = None,
        options: ReadOptions = NOTHING_STATED,
    ) -> tuple[StoredRecording, bool]:
        """Import a file and store its recording.

        Args:
            file_name: Its name; the suffix gives the format.
            name: Name of the recording; made from the file's name if None.

        Returns:
            The recording, and whether it is new: the same file under the same name again has
            no effect.

        Raises:
            BadRecording: The file is unsound; each fault names line or column and rule.
            InvalidInput: The name is invalid.
            Conflict: Another file, or this one with other options, has that name, or the limits
                are reached.
        """
        file_name, name = checked_names(file_name, name)
        sha256 = hashlib.sha256(content).hexdigest()
        suffix = format_of(file_name)
        if stored.is_stored(self._store, name, sha256):
            same, _ = stored.read_runs(self._store, name)
            if suffix == f".{same.summary['format']}":
                return _read_alike(same, options), False
        with self._importing:  # one at a time: its memory is a multiple of the file's
            new = self._import(content, file_name, name, sha256, options)
        is_new = stored.put_recording(self._store, new)
        return _read_alike(stored.read_runs(self._store, name)[0], options), is_new

    def remove(self, name: str) -> None:
        """Remove a recording; live worlds go on playing it.

        Raises:
            NotFound: No recording has that name.
            WrongState: A job that has not ended evaluates with it.
        """
        with self._known_names_in_error(name):
            stored.remove_recording(self._store, name)

    def _n_cached(self) -> int:
        return sum(len(run.times) for runs in self._cached.values() for run in runs)

    @contextmanager
    def _known_names_in_error(self, name: str) -> Iterator[None]:
        try:
            if not _NAME.fullmatch(name):
                raise NotFound("recording", name)
            yield
        except NotFound:
            raise NotFound("recording", name, self.names()) from None


def checked_names(file_name: str, name: str | None) -> tuple[str, str]:
    """Return a file's name without folders, and the given or derived name of its recording.

    Raises:
        BadRecording: The suffix is that of no supported format.
        InvalidInput: A name is invalid.
    """
    file_name = _checked_file_name(file_name)
    format_of(file_name)
    if name is None:
        return file_name, recording_name(file_name)
    if not _NAME.fullmatch(name):
        rule = "must have 1 to 64 of the characters a-z 0-9 - and start with a-z or 0-9"
        raise InvalidInput("name", name[:80], rule)
    return file_name, name


def _checked_file_name(file_name: str) -> str:
    """Return a file's name without folders; refuse one that cannot be shown."""
    shown = file_name[:60]
    if len(file_name) > MAX_FILE_NAME:
        rule = f"must have at most {MAX_FILE_NAME} characters, not {len(file_name)}"
        raise InvalidInput("file_name", shown, rule)
    if not file_name.isprintable():
        raise InvalidInput("file_name", shown, "must have only characters that can be shown")
    if not (last := PurePath(file_name).name):
        raise InvalidInput("file_name", shown, "must name a file, such as clip.bvh")
    return last


def recording_name(file_name: str) -> str:
    """Return the recording's name for a file's name: ``clip-3`` for ``"Clip 3.bvh"``.

    Raises:
        InvalidInput: The file's name has none of the characters ``a-z 0-9``.
    """
    stem = PurePath(file_name).stem
    name = re.sub(r"[^a-z0-9]+", "-", stem.lower()).strip("-")[:64].strip("-")
    if not name:
        rule = "must be given: the file's name has none of the characters a-z 0-9"
        raise InvalidInput("name", "", rule)
    return name


def _read_alike(record: StoredRecording, options: ReadOptions) -> StoredRecording:
    """Return a stored recording, if its file was read with the same options."""
    before = record.summary.get("options", {})
    if before != options.stated():
        given = ", ".join(f"{name} = {value}" for name, value in before.items())
        raise Conflict(
            f"recording {record.name!r} was read from this file with {given or 'no options'}: "
            "remove it first, or give another name"
        )
    return record
