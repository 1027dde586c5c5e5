"""Importing a file in a process of its own: ``python -m jobs.import_process``.

Parsing tens of megabytes holds Python's lock for a second at a time; in the server's process
the live cell would stand still as long. A process costs a second of start-up and stalls nobody;
it may run out of memory alone, and gives way to the live cell. One that lost its server ends
with its file.

What goes in and what comes out is a head in JSON, with its length before it, and bytes behind.
"""

import json
import logging
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Mapping
from dataclasses import asdict, fields
from typing import Any

from app.errors import BadRecording, Fault, InvalidInput, NotReady, SimulationError
from app.sim.mocap.importer import read_motion
from app.sim.mocap.read_options import NOTHING_STATED, ReadOptions
from app.store.records import NewRecording
from jobs.executor import PROJECT_ROOT, search_path
from jobs.stored_motion import packed

logger = logging.getLogger(__name__)

MAX_IMPORT_S = 120.0
"""Longest that an import may take [s]; the largest file takes about a tenth of that."""
NICENESS = 10
"""By how much an import gives way to the live cell."""
_LENGTH = 8


class ImportProcess:
    """Imports files, each in a process of its own; safe to use from any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._running: set[subprocess.Popen[bytes]] = set()
        self._stopped = False

    def __call__(
        self,
        content: bytes,
        file_name: str,
        name: str,
        sha256: str,
        options: ReadOptions = NOTHING_STATED,
    ) -> NewRecording:
        """Return a file's motion as it is stored; waits until it is imported.

        Args:
            content: The file, of whatever kind.
            file_name: Its name; the ending says which format is meant.
            name: Name under which the motion will be stored.
            sha256: Of the file.
            options: What is stated about the file.

        Raises:
            BadRecording: It is no sound motion; each fault names line or column and rule.
            InvalidInput: It takes too long.
            NotReady: The server stops.
            SimulationError: The process ended without an answer.
        """
        process = self._start()
        head = {
            "file_name": file_name,
            "name": name,
            "sha256": sha256,
            "options": options.stated(),
        }
        try:
            output, words = process.communicate(_framed(head, content), MAX_IMPORT_S)
        except subprocess.TimeoutExpired as error:
            rule = f"takes more than {MAX_IMPORT_S:g} s to import: cut it into parts"
            raise InvalidInput("file", f"<{len(content)} bytes>", rule) from error
        finally:
            self._end(process)
        if self._stopped:
            raise NotReady("stopping")
        if process.returncode != 0:
            logger.error("an import ended: %s", words.decode(errors="replace")[-4000:].strip())
            raise SimulationError(
                f"the import of {file_name!r} ended without an answer (exit status "
                f"{process.returncode}); the server's log has its last words"
            )
        return _answered(output)

    def stop(self) -> None:
        """End what runs; later imports are refused."""
        with self._lock:
            self._stopped = True
            for process in self._running:
                process.kill()

    def _start(self) -> subprocess.Popen[bytes]:
        with self._lock:
            if self._stopped:
                raise NotReady("stopping")
            process = subprocess.Popen(
                (sys.executable, "-m", "jobs.import_process"),
                cwd=PROJECT_ROOT,
                env={**os.environ, "PYTHONPATH": search_path(os.environ)},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                start_new_session=True,  # Ctrl-C is for the server, which then stops it
            )
            self._running.add(process)
            return process

    def _end(self, process: subprocess.Popen[bytes]) -> None:
        with self._lock:
            self._running.discard(process)
            if process.returncode is None:
                process.kill()
                process.communicate()


def import_here(
    content: bytes,
    file_name: str,
    name: str,
    sha256: str,
    options: ReadOptions = NOTHING_STATED,
) -> NewRecording:
    """Return a file's motion as it is stored, imported in this process.

    Raises:
        BadRecording: It is no sound motion; each fault names line or column and rule.
    """
    found = read_motion(content, file_name, options)
    return packed(found, name, file_name, sha256, options)


def main() -> None:
    """Import the file of the standard input; the answer goes to the standard output."""
    os.nice(NICENESS)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    asked, content = _unframed(sys.stdin.buffer.read())
    asked["options"] = ReadOptions(**asked["options"])
    try:
        new = import_here(content, **asked)
    except BadRecording as error:
        answer = _framed({"faults": [asdict(fault) for fault in error.faults]}, b"")
    else:
        told = {entry.name: getattr(new, entry.name) for entry in fields(NewRecording)}
        answer = _framed({"motion": told}, told.pop("tensors"))
    sys.stdout.buffer.write(answer)


def _answered(output: bytes) -> NewRecording:
    head, tensors = _unframed(output)
    if "faults" in head:
        raise BadRecording([Fault(**fault) for fault in head["faults"]])
    return NewRecording(**head["motion"], tensors=tensors)


def _framed(head: Mapping[str, Any], payload: bytes) -> bytes:
    text = json.dumps(head, allow_nan=False).encode()
    return b"".join((len(text).to_bytes(_LENGTH, "little"), text, payload))


def _unframed(content: bytes) -> tuple[dict[str, Any], bytes]:
    start = _LENGTH + int.from_bytes(content[:_LENGTH], "little")
    return json.loads(content[_LENGTH:start]), content[start:]


if __name__ == "__main__":
    main()
