"""Import of a file in its own process: ``python -m jobs.import_process``.

Parsing tens of megabytes holds Python's global lock for a second at a time, which would stall
the live cell in the server's process. The import process has a lower priority and limits of
memory and processor time. It reads one file, and ends with its server.

Input and output are a JSON head, preceded by its length, and bytes.
"""

import json
import logging
import os
import resource
import signal
import subprocess
import sys
import threading
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from app.errors import BadRecording, Fault, InvalidInput, NotReady, SimulationError
from app.sim.mocap.importer import read_motion
from app.sim.mocap.read_options import NOTHING_STATED, ReadOptions
from app.store.records import NewRecording
from jobs.executor import PROJECT_ROOT, search_path
from jobs.recording_format import packed
from jobs.start import child_command

logger = logging.getLogger(__name__)

MAX_IMPORT_S = 180.0
"""Longest time for an import [s]; the largest file takes about a tenth of it."""
MAX_CPU_S = 120
"""Longest processor time for an import [s]."""
MAX_MEMORY_BYTES = 1 << 30
"""Largest memory for an import, beyond that of the imported libraries (Linux); the largest file
takes about 0.5 GB [bytes]."""
NICENESS = 10
"""Niceness of the process, below the priority of the live cell."""
_LENGTH = 8


class ImportProcess:
    """Imports files, each in its own process; safe to use from any thread."""

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
        """Import a file; waits for the result.

        Args:
            file_name: Its name; the suffix gives the format.
            name: Name of the recording.
            sha256: Of the file.

        Raises:
            BadRecording: It is unsound; each fault names line or column and rule.
            InvalidInput: It takes too long or too much memory.
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
            output, log = process.communicate(_framed(head, content), MAX_IMPORT_S)
        except subprocess.TimeoutExpired as error:
            rule = f"takes more than {MAX_IMPORT_S:g} s to import: cut it into parts"
            raise InvalidInput("file", f"<{len(content)} bytes>", rule) from error
        finally:
            with self._lock:
                self._running.discard(process)
                if process.returncode is None:
                    process.kill()
                    process.communicate()
        if self._stopped:
            raise NotReady("stopping")
        if process.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
            rule = f"takes more than {MAX_CPU_S} s of processor time or all memory to import"
            raise InvalidInput("file", f"<{len(content)} bytes>", f"{rule}: cut it into parts")
        if process.returncode != 0:
            logger.error("an import ended: %s", log.decode(errors="replace")[-4000:].strip())
            raise SimulationError(
                f"the import of {file_name!r} ended without an answer (exit status "
                f"{process.returncode}); the server's log has its output"
            )
        answer, tensors = _unframed(output)
        if "faults" in answer:
            raise BadRecording([Fault(**fault) for fault in answer["faults"]])
        return NewRecording(**answer["recording"], tensors=tensors)

    def stop(self) -> None:
        """End all imports; later ones are refused."""
        with self._lock:
            self._stopped = True
            for process in self._running:
                process.kill()

    def _start(self) -> subprocess.Popen[bytes]:
        with self._lock:
            if self._stopped:
                raise NotReady("stopping")
            process = subprocess.Popen(
                child_command("jobs.import_process"),
                cwd=PROJECT_ROOT,
                env={
                    **os.environ,
                    "PYTHONPATH": search_path(),
                    "OMP_NUM_THREADS": "1",
                    "OPENBLAS_NUM_THREADS": "1",
                },
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                start_new_session=True,  # Ctrl-C is for the server, which then stops it
            )
            self._running.add(process)
            return process


def import_here(
    content: bytes,
    file_name: str,
    name: str,
    sha256: str,
    options: ReadOptions = NOTHING_STATED,
) -> NewRecording:
    """Import a file in this process.

    Raises:
        BadRecording: It is unsound; each fault names line or column and rule.
    """
    found = read_motion(content, file_name, options)
    return packed(found, name, file_name, sha256, options)


def main() -> None:
    """Import the file on standard input; write the answer to standard output."""
    os.nice(NICENESS)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _limit()
    try:
        request, content = _unframed(sys.stdin.buffer.read())
        request["options"] = ReadOptions(**request["options"])
        new = import_here(content, **request)
    except BadRecording as error:
        answer = _framed({"faults": [asdict(fault) for fault in error.faults]}, b"")
    except MemoryError:
        rule = f"takes more than {MAX_MEMORY_BYTES >> 20} MiB of memory to import"
        fault = Fault(place="file", value="", rule=rule, hint="cut it into parts")
        answer = _framed({"faults": [asdict(fault)]}, b"")
    else:
        members = asdict(new)
        answer = _framed({"recording": members}, members.pop("tensors"))
    sys.stdout.buffer.write(answer)


def _limit() -> None:
    """Limit processor time and, on Linux, memory of this process."""
    resource.setrlimit(resource.RLIMIT_CPU, (MAX_CPU_S, MAX_CPU_S + 5))
    if sys.platform == "linux":
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        limit = pages * resource.getpagesize() + MAX_MEMORY_BYTES
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


def _framed(head: Mapping[str, Any], payload: bytes) -> bytes:
    text = json.dumps(head, allow_nan=False).encode()
    return b"".join((len(text).to_bytes(_LENGTH, "little"), text, payload))


def _unframed(content: bytes) -> tuple[dict[str, Any], bytes]:
    start = _LENGTH + int.from_bytes(content[:_LENGTH], "little")
    return json.loads(content[_LENGTH:start]), content[start:]
