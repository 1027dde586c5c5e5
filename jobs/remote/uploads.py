"""Checkpoints and states of workers on other machines, checked before storing.

A file is the policy, a line of JSON and its safetensors bytes, followed by the state to resume
from in the same form; the state may be missing. Nothing is unpickled. Files of the replay
memory are stored beside the database (``jobs.resume_files``).
"""

import re
import threading
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

from safetensors import SafetensorError
from safetensors.numpy import load as load_arrays

from app.errors import InvalidInput, NotFound
from app.policies.checkpoints.upload import MAX_FILE as MAX_POLICY
from app.policies.checkpoints.upload import join, read_upload, split
from app.policies.training.file_store import FileFolder
from app.store import attempts, fencing
from app.store.engine import Store
from app.store.records import Claim, JobRecord, NewCheckpoint, ResumeState
from jobs.checkpoints import to_store
from jobs.resume_files import folder_of

MAX_STATE_MANIFEST = 4 * 1024 * 1024
"""Longest manifest of a state, which has the values that are no arrays [bytes]."""
MAX_UPLOAD = MAX_POLICY + MAX_STATE_MANIFEST + 1 + attempts.MAX_RESUME
"""Largest file of a policy and a state [bytes]."""
MAX_MEMORY_FILE = 96 * 1024 * 1024
"""Largest file of a replay memory; three times the size at which a file is closed [bytes]."""
MAX_MEMORY = 8 * 1024**3
"""Limit of the files of one replay memory [bytes]."""
SHA256 = re.compile(r"[0-9a-f]{64}")


def pack_upload(policy: NewCheckpoint, resume: ResumeState | None) -> tuple[bytes, int]:
    """Return the file of a policy and a state, and the length of the policy's part."""
    first = join(policy.manifest, policy.tensors)
    return first + (b"" if resume is None else pack_state(resume)), len(first)


def pack_state(state: ResumeState) -> bytes:
    """Return the file of a state."""
    return join({"step": state.step, "manifest": state.manifest}, state.tensors)


def read_state(content: bytes) -> ResumeState:
    """Return the state of a file.

    Raises:
        InvalidInput: A part is missing, too large, or not what it must be.
    """
    head, tensors = split(content, MAX_STATE_MANIFEST)
    step = head.get("step") if isinstance(head, dict) else None
    manifest = head.get("manifest") if isinstance(head, dict) else None
    if not isinstance(step, int) or isinstance(step, bool) or not isinstance(manifest, dict):
        rule = "must be an object with an integer, step, and an object, manifest"
        raise InvalidInput("state", type(head).__name__, rule)
    if len(tensors) > attempts.MAX_RESUME:
        rule = f"bytes exceed the limit of {attempts.MAX_RESUME} bytes"
        raise InvalidInput("state.tensors", len(tensors), rule)
    _require_safetensors("state.tensors", tensors)
    return ResumeState(step=step, manifest=manifest, tensors=tensors)


def require_sha256(name: str, content: bytes) -> None:
    """Check the SHA-256 of a body.

    Raises:
        InvalidInput: The body has another one.
    """
    if (found := sha256(content).hexdigest()) != name:
        raise InvalidInput("sha256", name[:80], f"is not that of the body, {found}")


class WorkerUploads:
    """Checks and stores what workers on other machines send; safe to use from any thread."""

    def __init__(self, store: Store, data_dir: Path) -> None:
        self._store, self._data_dir = store, data_dir
        self._lock = threading.Lock()

    def record(self, claim: Claim, step: int, content: bytes, policy_bytes: int) -> None:
        """Store a policy and a state; then delete the files that no state lists.

        The last one again, such as a repeated request, has no effect: files that a later state
        will list may have been stored since.

        Args:
            policy_bytes: Length of the policy's part.

        Raises:
            StaleAttempt: The attempt no longer holds the job.
            InvalidInput: A part breaks a rule, or a listed file of the memory is missing.
            CheckpointMismatch: The policy's format is another one.
            StorageFull: No room is left.
        """
        job = fencing.peek(self._store, claim)
        policy = read_upload(content[:policy_bytes])
        _require_origin(policy.manifest, job)
        rest = content[policy_bytes:]
        state = read_state(rest) if rest else None
        folder = self._folder(claim)
        with self._lock:
            for place, name in enumerate([] if state is None else _listed(state.manifest)):
                if not folder.path(name).is_file():
                    rule = "is not a file of this job: send it first"
                    raise InvalidInput(f"state.manifest.memory[{place}]", name, rule)
            if attempts.record_checkpoint(self._store, claim, step, to_store(policy), state):
                manifests = attempts.resume_manifests(self._store, claim.job_id)
                folder.keep({name for one in manifests for name in _listed(one)})

    def write_file(self, claim: Claim, name: str, content: bytes) -> None:
        """Store a file of the replay memory under its SHA-256.

        Raises:
            StaleAttempt: The attempt no longer holds the job.
            InvalidInput: The content has another SHA-256, is no safetensors file, or too much.
            StorageFull: No room is left.
        """
        require_sha256(name, content)
        _require_safetensors("body", content)
        folder = self._folder(claim)
        with self._lock:
            fencing.peek(self._store, claim)
            if (size := folder.size() + len(content)) > MAX_MEMORY:
                rule = f"bytes exceed the limit of {MAX_MEMORY} bytes of a replay memory"
                raise InvalidInput("body", size, rule)
            folder.write(name, content)

    def read_file(self, claim: Claim, name: str) -> bytes:
        """Return a file of the replay memory, which may be damaged.

        Raises:
            StaleAttempt: The attempt no longer holds the job.
            NotFound: It is missing.
        """
        fencing.peek(self._store, claim)
        if SHA256.fullmatch(name) is None:
            raise NotFound("file", name)
        try:
            return self._folder(claim).read(name)
        except FileNotFoundError:
            raise NotFound("file", name) from None

    def _folder(self, claim: Claim) -> FileFolder:
        return FileFolder(folder_of(self._data_dir, claim.job_id))


def _require_origin(manifest: Mapping[str, Any], job: JobRecord) -> None:
    """Check that a policy states the preset and the seed of its job."""
    for name, found, wanted in (
        ("preset.name", manifest["preset"].get("name"), job.preset),
        ("seed", manifest["seed"], job.seed),
    ):
        if found != wanted:
            raise InvalidInput(f"manifest.{name}", found, f"must be the job's, {wanted!r}")


def _listed(manifest: Mapping[str, Any]) -> list[str]:
    """Return the files that the manifest of a state lists, each by its SHA-256."""
    entries = manifest.get("memory", [])
    if not isinstance(entries, list):
        raise InvalidInput("state.manifest.memory", type(entries).__name__, "must be a list")
    names = [one.get("sha256") if isinstance(one, dict) else None for one in entries]
    for place, name in enumerate(names):
        if not isinstance(name, str) or SHA256.fullmatch(name) is None:
            rule = "must be 64 hexadecimal digits"
            raise InvalidInput(f"state.manifest.memory[{place}].sha256", name, rule)
    return [str(name) for name in names]


def _require_safetensors(field: str, content: bytes) -> None:
    try:
        load_arrays(content)
    except SafetensorError as error:
        raise InvalidInput(field, str(error), "must be a safetensors file") from error
