"""Import of recorded human motion as clean runs of the 18-DoF model.

Formats: BVH (joint centres, ``skeletons.py`` and ``inverse_kinematics.py``), OpenSim's ``.mot``
and ``.sto``, and the project's CSV (joint angles). The result is an :class:`ImportedMotion`, or
one :class:`~app.errors.BadRecording` that names place and rule.

Other body sizes: **joint angles and the path of the pelvis in metres are kept.** A simulated
person makes the recorded gesture at the recorded place; with a longer recorded arm, the
simulated hand falls short by the difference, which ``fixed_body`` reports. The error of the
conversion itself, ``wrists`` and ``elbows``, is measured on the recorded body.

Source: docs/method.md 3.4.
"""

import codecs
import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import PurePath

import numpy as np

from app.errors import BadRecording
from app.sim.core.arrays import Vec
from app.sim.human.anthropometry import BodySize
from app.sim.human.model import JOINT_NAMES, Q_MAX, Q_MIN
from app.sim.mocap.artifacts import MIN_RUN, Artifact, clean_runs, find_artifacts, merged
from app.sim.mocap.bvh import read_bvh
from app.sim.mocap.csv_tables import AngleTrack, read_csv
from app.sim.mocap.faults import bad
from app.sim.mocap.inverse_kinematics import body_angles
from app.sim.mocap.joint_centres import (
    ELBOW_L,
    ELBOW_R,
    PELVIS,
    WRIST_L,
    WRIST_R,
    BodyTrack,
    measure,
    model_points,
)
from app.sim.mocap.opensim import read_opensim
from app.sim.mocap.read_options import NOTHING_STATED, Reading, ReadOptions
from app.sim.mocap.skeletons import body_track

MAX_BYTES = 32 * 1024 * 1024
"""Largest size of a file [bytes]."""
FORMATS = (".bvh", ".mot", ".sto", ".csv")
"""File name extensions of the supported formats."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """One run of motion of an 18-DoF person, usually recorded."""

    name: str
    """File name without extension."""
    source: str
    """Origin: file, SHA-256 (12 digits) and frames."""
    times: Vec
    """Increasing times from 0 [s], shape (n,)."""
    q: Vec
    """Joint positions [m, rad], shape (n, 18); continuous, not clipped to joint limits."""
    pelvis_z: Vec
    """Rise of the pelvis above its standing height [m], shape (n,).

    The standing height is the 95th percentile of the clean frames; CSV tables state the rise.
    """
    size: BodySize
    """Size of the recorded person."""
    first_frame: int
    """First frame of the run in the file, counted from 0."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """Percentiles of an error over frames [m]."""

    p50: float
    """Median."""
    p99: float
    """99th percentile."""
    worst: float
    """Maximum."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportedMotion:
    """Result of an import."""

    name: str
    """File name without extension."""
    format: str
    """One of FORMATS without the dot."""
    reading: Reading
    """Interpretation of the file: units, up axis, names, rate."""
    n_frames: int
    """Number of frames in the file; repeated frames count once."""
    duration: float
    """Duration of the file [s]."""
    size: BodySize
    """Size of the recorded person; the default size where only angles are given."""
    runs: tuple[Motion, ...]
    """Clean runs, at least one."""
    spans: tuple[tuple[int, int], ...]
    """First and last frame of each run, counted from 0 in the file."""
    artifacts: tuple[Artifact, ...]
    """Removed artefacts."""
    wrists: Spread
    """Error of the model's wrists, with the recorded size, against the file."""
    elbows: Spread
    """Error of the elbows, likewise."""
    wrists_at_fixed_height: Spread
    """Error of the wrists with the pelvis fixed at standing height."""
    pelvis: Spread
    """Error of the pelvis, which is displaced to match the neck."""
    fixed_body: Spread
    """Error of the wrists of a person of default size."""
    beyond_limits: dict[str, tuple[float, float]]
    """Joints beyond the model's limits: share of the clean frames, largest excess [rad]."""

    @property
    def n_clean(self) -> int:
        """Number of frames of all clean runs."""
        return sum(len(run.times) for run in self.runs)


def read_motion(
    content: bytes, file_name: str, options: ReadOptions = NOTHING_STATED
) -> ImportedMotion:
    """Import a file of recorded motion.

    Args:
        file_name: Name of the file; its extension selects the format.
        options: Stated properties of the file.

    Raises:
        BadRecording: The file is invalid; each fault names line or column and rule.
    """
    ending = format_of(file_name)
    text = _text(content, ending)
    digest = hashlib.sha256(content).hexdigest()[:12]
    track, angles, reading = _read(text, ending, options)
    size = measure(track.points) if angles is None else BodySize()
    frames = np.arange(len(track.times)) if angles is None else angles.frames
    missing = () if angles is None else angles.missing
    found = find_artifacts(track.times, track.points)
    spans = clean_runs(track.times, found)
    artifacts = merged(found, missing, frames)
    if not spans:
        raise _no_run(track, artifacts)
    name = PurePath(file_name).stem[:100]
    origin = f"{PurePath(file_name).name[:100]} ({digest})"
    segments = [_converted(track, angles, size, span) for span in spans]
    q, height = (np.concatenate(part) for part in zip(*segments, strict=True))
    # CSV tables state heights relative to standing; elsewhere standing is estimated.
    standing = 0.0 if ending == ".csv" else float(np.percentile(height, 95.0))
    in_file = tuple((int(frames[a]), int(frames[b])) for a, b in spans)
    runs = tuple(
        Motion(
            name=name,
            source=f"{origin}, frames {first} to {last}",
            times=_own(track.times[a : b + 1] - track.times[a]),
            q=_own(run_q),
            pelvis_z=_own(run_height - standing),
            size=size,
            first_frame=first,
        )
        for (a, b), (first, last), (run_q, run_height) in zip(
            spans, in_file, segments, strict=True
        )
    )
    points = np.concatenate([track.points[a : b + 1] for a, b in spans])
    return ImportedMotion(
        name=name,
        format=ending[1:],
        reading=reading,
        n_frames=len(track.times) if angles is None else angles.n_frames,
        duration=float(track.times[-1] - track.times[0]),
        size=size,
        runs=runs,
        spans=in_file,
        artifacts=artifacts,
        **_errors(q, height, standing, size, points),
        beyond_limits=beyond_limits(q),
    )


def format_of(file_name: str) -> str:
    """Return the extension of a file's name, in lower case.

    Raises:
        BadRecording: It is that of no supported format.
    """
    ending = PurePath(file_name).suffix.lower()
    if ending not in FORMATS:
        raise bad("file_name", repr(file_name[-60:]), f"must end with {', '.join(FORMATS)}")
    return ending


def _read(
    text: str, ending: str, options: ReadOptions
) -> tuple[BodyTrack, AngleTrack | None, Reading]:
    """Return joint centres, joint angles if the file has them, and its interpretation."""
    if ending == ".bvh":
        track, reading = body_track(read_bvh(text), options)
        return track, None, reading
    _require_names_only(options)
    read, up = (read_csv, "z") if ending == ".csv" else (read_opensim, "y")
    angles = read(text, options.names)
    points = model_points(angles.q, angles.pelvis_z, BodySize())
    rate_hz = 1.0 / float(np.median(np.diff(angles.times)))
    return (
        BodyTrack(times=angles.times, points=points),
        angles,
        Reading(unit="m", root_unit="m", up=up, rate_hz=rate_hz, names=angles.names),
    )


def placed(motion: Motion, x: float, y: float, yaw: float) -> Motion:
    """Return the motion transformed so that the pelvis starts at a place with a given yaw.

    Args:
        motion: Run in the frame of its file.
        x: Pelvis x at the first frame [m].
        y: Pelvis y at the first frame [m].
        yaw: Yaw at the first frame [rad].
    """
    q = motion.q.copy()
    turn = yaw - q[0, 2]
    c, s = np.cos(turn), np.sin(turn)
    path = q[:, :2] - q[0, :2]
    q[:, 0] = x + c * path[:, 0] - s * path[:, 1]
    q[:, 1] = y + s * path[:, 0] + c * path[:, 1]
    q[:, 2] += turn
    return replace(motion, q=_own(q))


def beyond_limits(q: Vec) -> dict[str, tuple[float, float]]:
    """Return the joints beyond the model's limits: share of frames, largest excess [rad].

    Args:
        q: Joint positions [m, rad], shape (n, 18); position and yaw are not limited.
    """
    excess = np.maximum(Q_MIN - q, q - Q_MAX)[:, 3:]
    return {
        name: (float((column > 0.0).mean()), float(column.max()))
        for name, column in zip(JOINT_NAMES[3:], excess.T, strict=True)
        if column.max() > 0.0
    }


def _errors(
    q: Vec, height: Vec, standing: float, size: BodySize, points: Vec
) -> dict[str, Spread]:
    """Return the errors of the model's joint centres, by the fields of ImportedMotion.

    Args:
        q: Joint positions of all runs [m, rad], shape (n, 18).
        height: Heights of the pelvis [m], shape (n,).
        standing: Standing height of the pelvis [m].
        size: Size of the recorded person.
        points: Joint centres of the file [m], shape (n, 8, 3).
    """

    def away(pelvis_z: Vec, body: BodySize) -> Vec:
        return np.asarray(np.linalg.norm(model_points(q, pelvis_z, body) - points, axis=2))

    own, wrists = away(height, size), [WRIST_R, WRIST_L]
    found = {
        "wrists": own[:, wrists],
        "elbows": own[:, [ELBOW_R, ELBOW_L]],
        "wrists_at_fixed_height": away(np.full_like(height, standing), size)[:, wrists],
        "pelvis": own[:, PELVIS],
        "fixed_body": away(height, BodySize())[:, wrists],
    }
    shares = {name: np.percentile(one, (50.0, 99.0, 100.0)) for name, one in found.items()}
    return {
        name: Spread(p50=float(p50), p99=float(p99), worst=float(worst))
        for name, (p50, p99, worst) in shares.items()
    }


def _converted(
    track: BodyTrack, angles: AngleTrack | None, size: BodySize, span: tuple[int, int]
) -> tuple[Vec, Vec]:
    """Return joint positions and the pelvis's height of one clean run."""
    part = slice(span[0], span[1] + 1)
    if angles is not None:
        return angles.q[part].copy(), angles.pelvis_z[part].copy()
    run = replace(
        track,
        times=track.times[part],
        points=track.points[part],
        hips=None if track.hips is None else track.hips[part],
    )
    return body_angles(run, size)


def _text(content: bytes, ending: str) -> str:
    """Return a file's text: UTF-8, UTF-16 with byte-order mark, or Latin-1 (CSV only)."""
    if len(content) > MAX_BYTES:
        rule = f"must have at most {MAX_BYTES} bytes (32 MiB)"
        raise bad("file", f"<{len(content)} bytes>", rule, "cut it into parts")
    marked = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        text = content.decode("utf-16" if marked else "utf-8-sig")
    except UnicodeDecodeError as error:
        if ending == ".csv" and not re.search(rb"[\x00-\x08\x0e-\x1f]", content):
            return content.decode("latin-1")
        value = f"<byte {content[error.start]:#04x} at {error.start}>"
        raise bad("file", value, "must be text in UTF-8") from error
    if not text.strip():
        raise bad("file", f"<{len(content)} bytes>", "is empty")
    return text


def _require_names_only(options: ReadOptions) -> None:
    """Check that neither unit nor axis is stated for a table, whose positions are in metres."""
    for name in ("unit", "root_unit", "up"):
        stated = getattr(options, name)
        if stated is not None:
            raise bad(
                name, repr(stated), "applies to .bvh only: positions of a table are in metres"
            )


def _no_run(track: BodyTrack, artifacts: Sequence[Artifact]) -> BadRecording:
    value = f"<{len(track.times)} frames, {track.times[-1] - track.times[0]:.2f} s>"
    rule = f"has no run of {MIN_RUN:g} s without an artifact"
    hint = (
        f"{len(artifacts)} artifacts, first: {artifacts[0].reason}"
        if artifacts
        else "too short"
    )
    return bad("frames", value, rule, hint)


def _own(values: Vec) -> Vec:
    """Return a read-only copy."""
    kept = np.array(values, dtype=np.float64)
    kept.setflags(write=False)
    return kept
