"""Every imported motion by name, from the database: files in, runs of the 18-DoF person out."""

import hashlib
import re
import threading
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import PurePath

from app.errors import Conflict, InvalidInput, NotFound
from app.sim.mocap.importer import Motion
from app.sim.mocap.read_options import NOTHING_STATED, ReadOptions
from app.store import motions as kept
from app.store.engine import Store
from app.store.records import NewRecording, StoredRecording
from jobs.import_process import import_here
from jobs.stored_motion import unpacked

MAX_CACHED_FRAMES = 500_000
"""Frames of the motions that stay in memory (80 MB); the newest always stays."""
MAX_FILE_NAME = 255
"""Longest file name [characters]."""

Importer = Callable[[bytes, str, str, str, ReadOptions], NewRecording]
"""Turns a file, its name, the motion's name, the file's SHA-256 and what is stated about the
file into what is stored."""

_NAME = re.compile(r"[a-z0-9][a-z0-9-]{0,63}")


class RecordingCatalog:
    """Finds motions by name; safe to use from any thread.

    Args:
        store: Where the motions are kept.
        importer: Imports files.
    """

    def __init__(self, store: Store, importer: Importer = import_here) -> None:
        self._store = store
        self._import = importer
        self._lock = threading.Lock()
        self._importing = threading.Lock()
        self._cached: OrderedDict[int, tuple[Motion, ...]] = OrderedDict()

    def names(self) -> tuple[str, ...]:
        """Return the names of all motions."""
        return kept.recording_names(self._store)

    def all(self) -> tuple[StoredRecording, ...]:
        """Return what is known of all motions, by name, without their runs."""
        return kept.list_recordings(self._store)

    def record(self, name: str) -> StoredRecording:
        """Return what is known of one motion, without its runs.

        Raises:
            NotFound: No motion has that name.
        """
        try:
            return kept.read_runs(self._store, _possible(name))[0]
        except NotFound:
            raise NotFound("motion", name, self.names()) from None

    def get(self, name: str) -> tuple[Motion, ...]:
        """Return the runs of a motion, from memory where they are there.

        Raises:
            NotFound: No motion has that name.
            InvalidInput: The stored motion does not fit this version.
        """
        try:
            # The number tells whether another one took the name, by whatever process.
            number = kept.recording_number(self._store, _possible(name))
            with self._lock:
                if number in self._cached:
                    self._cached.move_to_end(number)
                    return self._cached[number]
            record, tensors = kept.read_runs(self._store, name)
        except NotFound:
            raise NotFound("motion", name, self.names()) from None
        runs = unpacked(record, tensors)
        with self._lock:
            self._cached[record.number] = runs
            while len(self._cached) > 1 and self._n_cached() > MAX_CACHED_FRAMES:
                self._cached.popitem(last=False)
        return runs

    def check(self, names: Sequence[str]) -> None:
        """Check that motions are stored which a caller named.

        Raises:
            InvalidInput: One is not; names its place and the stored ones.
        """
        known = self.names()
        for place, name in enumerate(names):
            if name not in known:
                rule = "is no stored motion" if known else "is no stored motion: there is none"
                raise InvalidInput(f"motions[{place}]", name, rule, known)

    def runs_of(self, names: Sequence[str]) -> tuple[Motion, ...]:
        """Return the runs of several motions, each called as it is stored.

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
        """Import a file and keep its motion.

        Args:
            content: The file, of whatever kind.
            file_name: Its name; the ending says which format is meant.
            name: Name of the motion; made from the file's name if None.
            options: What is stated about the file.

        Returns:
            What is known of the motion, and whether it is new: the same file under the same
            name again is harmless.

        Raises:
            BadRecording: The file is no sound motion; each fault names line or column and rule.
            InvalidInput: The name cannot be one.
            Conflict: Another file, or this one with other options, has that name, or there are
                too many motions.
        """
        file_name = checked_file_name(file_name)
        name = recording_name(file_name) if name is None else checked_name(name)
        sha256 = hashlib.sha256(content).hexdigest()
        same = kept.find_same(self._store, name, sha256)
        ending = PurePath(file_name).suffix.lower()
        if same is not None:
            same, _ = kept.read_runs(self._store, name)
        if same is not None and ending == f".{same.summary['format']}":
            return _read_alike(same, options), False
        with self._importing:  # one at a time: its memory is a multiple of the file's
            new = self._import(content, file_name, name, sha256, options)
        is_new = kept.put_recording(self._store, new)
        return _read_alike(kept.read_runs(self._store, name)[0], options), is_new

    def remove(self, name: str) -> None:
        """Forget a motion; whoever has its runs keeps them.

        Raises:
            NotFound: No motion has that name.
        """
        try:
            kept.remove_recording(self._store, _possible(name))
        except NotFound:
            raise NotFound("motion", name, self.names()) from None

    def _n_cached(self) -> int:
        return sum(len(run.times) for runs in self._cached.values() for run in runs)


def checked_file_name(file_name: str) -> str:
    """Return a file's name without folders.

    Raises:
        InvalidInput: It is empty, too long or has characters that cannot be shown.
    """
    shown = file_name[:60]
    if len(file_name) > MAX_FILE_NAME:
        rule = f"must have at most {MAX_FILE_NAME} characters, not {len(file_name)}"
        raise InvalidInput("file_name", shown, rule)
    if not file_name.isprintable():
        raise InvalidInput("file_name", shown, "must have only characters that can be shown")
    if not (last := PurePath(file_name).name):
        raise InvalidInput("file_name", shown, "must name a file, such as clip.bvh")
    return last


def checked_name(name: str) -> str:
    """Return the name of a motion.

    Raises:
        InvalidInput: It has other than 1 to 64 of the characters ``a-z 0-9 -``.
    """
    if not _NAME.fullmatch(name):
        rule = "must have 1 to 64 of the characters a-z 0-9 - and start with a-z or 0-9"
        raise InvalidInput("name", name[:80], rule)
    return name


def recording_name(file_name: str) -> str:
    """Return the name of a motion whose file is called so: ``"Clip 3.bvh"`` is ``clip-3``.

    Raises:
        InvalidInput: The file's name has no character for one.
    """
    stem = PurePath(file_name).stem
    name = re.sub(r"[^a-z0-9]+", "-", stem.lower()).strip("-")[:64].strip("-")
    if not name:
        rule = "must be given: the file's name has none of the characters a-z 0-9"
        raise InvalidInput("name", "", rule)
    return name


def _read_alike(record: StoredRecording, options: ReadOptions) -> StoredRecording:
    """Return a stored motion, unless its file was read with other options."""
    before = record.summary.get("options", {})
    if before != options.stated():
        said = ", ".join(f"{name} = {value}" for name, value in before.items())
        raise Conflict(
            f"motion {record.name!r} was read from this file with {said or 'no options'}: "
            "remove it first, or give another name"
        )
    return record


def _possible(name: str) -> str:
    """Return a name that was asked for, unless none can be called so."""
    if not _NAME.fullmatch(name):
        raise NotFound("motion", name)
    return name
