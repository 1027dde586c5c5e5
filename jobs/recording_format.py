"""The stored form of a recording.

The runs are a safetensors file: the frames of all runs one after the other in ``times``, ``q``
and ``pelvis_z``; ``lengths`` and ``first_frames`` have a number per run. Names, measures and
errors are JSON beside them.
"""

from collections.abc import Mapping
from dataclasses import asdict, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load as load_tensors
from safetensors.numpy import save as save_tensors

from app.errors import InvalidInput
from app.sim.human.anthropometry import BodySize
from app.sim.mocap.importer import ImportedMotion, Motion, Spread
from app.sim.mocap.joint_centres import MEASURED
from app.sim.mocap.read_options import NOTHING_STATED, ReadOptions
from app.store.records import NewRecording, StoredRecording

MAX_ARTIFACTS = 1000
"""Largest number of artifacts stored with their place; all are counted."""

_SPREADS = ("wrists", "elbows", "pelvis", "wrists_at_fixed_height", "fixed_body")


def summary_of(found: ImportedMotion) -> dict[str, Any]:
    """Return measures and errors of an import as JSON data."""
    lengths = found.size.lengths()
    return {
        "format": found.format,
        "unit": found.reading.unit,
        "reading": {**asdict(found.reading), "notes": list(found.reading.notes)},
        "body_m": {name: lengths[name] for name in MEASURED},
        "error_mm": {name: _mm(getattr(found, name)) for name in _SPREADS},
        "clean_frames": found.n_clean,
        "n_artifacts": len(found.artifacts),
        "beyond_limits": {
            name: {"share": share, "farthest_rad": farthest}
            for name, (share, farthest) in found.beyond_limits.items()
        },
    }


def detail_of(found: ImportedMotion) -> dict[str, Any]:
    """Return the runs and artifacts of an import as JSON data."""
    return {
        "artifacts": [asdict(one) for one in found.artifacts],
        "clean_runs": [
            {"first": first, "last": last, "duration_s": float(run.times[-1])}
            for run, (first, last) in zip(found.runs, found.spans, strict=True)
        ],
    }


def packed(
    found: ImportedMotion,
    name: str,
    file_name: str,
    sha256: str,
    options: ReadOptions = NOTHING_STATED,
) -> NewRecording:
    """Return the stored form of a file's import; ``name`` is that of the recording."""
    detail = detail_of(found)
    detail["artifacts"] = detail["artifacts"][:MAX_ARTIFACTS]
    detail["recorded"] = {
        "name": found.name,
        "size": asdict(found.size),
        "sources": [run.source for run in found.runs],
    }
    tensors = save_tensors(
        {
            "times": np.concatenate([run.times for run in found.runs]),
            "q": np.concatenate([run.q for run in found.runs]),
            "pelvis_z": np.concatenate([run.pelvis_z for run in found.runs]),
            "lengths": np.array([len(run.times) for run in found.runs], dtype=np.int64),
            "first_frames": np.array([run.first_frame for run in found.runs], dtype=np.int64),
        }
    )
    return NewRecording(
        name=name,
        sha256=sha256,
        file_name=file_name,
        n_runs=len(found.runs),
        n_frames=found.n_frames,
        duration=found.duration,
        summary={**summary_of(found), "options": options.stated()},
        detail=detail,
        tensors=tensors,
    )


def unpacked(record: StoredRecording, tensors: bytes) -> tuple[Motion, ...]:
    """Return the runs of a stored recording that has its detail, arrays read-only.

    Raises:
        InvalidInput: They do not fit this version.
    """
    try:
        recorded = (record.detail or {})["recorded"]
        name, sources = str(recorded["name"]), [str(one) for one in recorded["sources"]]
        size = _size(recorded["size"])
        arrays = _arrays(tensors, len(sources))
    except (SafetensorError, KeyError, TypeError, ValueError) as error:
        rule = (
            "was stored by another version of Tandem and does not fit this one: post it again"
        )
        raise InvalidInput("recording", record.name, rule) from error
    stops = np.cumsum(arrays["lengths"])
    spans = [slice(stop - n, stop) for stop, n in zip(stops, arrays["lengths"], strict=True)]
    return tuple(
        Motion(
            name=name,
            source=source,
            times=arrays["times"][span],
            q=arrays["q"][span],
            pelvis_z=arrays["pelvis_z"][span],
            size=size,
            first_frame=int(first),
        )
        for source, span, first in zip(sources, spans, arrays["first_frames"], strict=True)
    )


def _arrays(tensors: bytes, n_runs: int) -> dict[str, NDArray[Any]]:
    """Return the arrays of a stored recording; ValueError: wrong shape, type or number."""
    arrays = load_tensors(tensors)
    n = len(arrays["times"])
    expected: dict[str, tuple[tuple[int, ...], type]] = {
        "times": ((n,), np.float64),
        "q": ((n, 18), np.float64),
        "pelvis_z": ((n,), np.float64),
        "lengths": ((n_runs,), np.int64),
        "first_frames": ((n_runs,), np.int64),
    }
    for name, (shape, kind) in expected.items():
        array = arrays[name]
        if array.shape != shape or array.dtype != kind or not np.isfinite(array).all():
            raise ValueError(name)
        array.setflags(write=False)
    if (arrays["lengths"] < 2).any() or arrays["lengths"].sum() != n:
        raise ValueError("lengths")
    return arrays


def _size(lengths: Mapping[str, float]) -> BodySize:
    """Return a body from its stored lengths; missing ones are those of the median person."""
    known = {entry.name for entry in fields(BodySize)}
    return BodySize(**{name: float(one) for name, one in lengths.items() if name in known})


def _mm(spread: Spread) -> dict[str, float]:
    return {name: 1000.0 * value for name, value in asdict(spread).items()}
