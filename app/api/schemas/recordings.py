"""Recordings of human motion as they are shown."""

from datetime import datetime
from typing import Any, Self

from pydantic import Field

from app.api.schemas.numbers import Answer
from app.store.records import StoredRecording


class SpreadPublic(Answer):
    """Distribution of an error over the clean frames."""

    p50: float = Field(description="median [mm]")
    p99: float = Field(description="99th percentile [mm]")
    worst: float = Field(description="maximum [mm]")


class ErrorPublic(Answer):
    """Distance of the model's points from the file's; 0 for files of joint angles."""

    wrists: SpreadPublic = Field(description="wrists, with the recorded lengths [mm]")
    elbows: SpreadPublic = Field(description="elbows, with the recorded lengths [mm]")
    pelvis: SpreadPublic = Field(description="pelvis; the neck has priority [mm]")
    wrists_at_fixed_height: SpreadPublic = Field(
        description="wrists with the pelvis at a fixed height [mm]"
    )
    fixed_body: SpreadPublic = Field(description="wrists of the median person's body [mm]")


class JointBeyondLimits(Answer):
    """A joint outside the model's limits; its recorded angles are kept."""

    share: float = Field(description="share of the clean frames, 0 to 1")
    farthest_rad: float = Field(description="largest excess [rad]")


class RunPublic(Answer):
    """One clean run, between two artifacts."""

    first: int = Field(description="first frame in the file, from 0")
    last: int = Field(description="last frame")
    duration_s: float = Field(description="duration [s]")


class ArtifactPublic(Answer):
    """Frames that were cut out."""

    first: int = Field(description="first frame of the fault, from 0")
    last: int = Field(description="last frame of the fault")
    parts: list[str] = Field(
        description="points that are too fast, the fastest first; columns without a value"
    )
    speed: float = Field(
        description="highest speed [m/s]; 0 for a gap in the times and for missing values"
    )
    reason: str = Field(description="reason as text")


class ReadingPublic(Answer):
    """How a file was read: stated options, detected values otherwise."""

    unit: str = Field(description="unit of lengths: a name, or metres per unit")
    root_unit: str = Field(description="unit of the root's path")
    up: str = Field(description="direction of the file that points up")
    rate_hz: float = Field(description="frames per second; those that repeat count once [Hz]")
    names: dict[str, str] = Field(description="joints of the file, by our names")
    stature: float | None = Field(
        description="of the person, from the skeleton [m]; null for files of angles"
    )
    notes: list[str] = Field(description="further observations as text")


class RecordingItem(Answer):
    """One recording, in short."""

    name: str
    file_name: str = Field(description="name of the file it was imported from")
    sha256: str = Field(description="of that file")
    created_at: datetime
    format: str = Field(description="bvh, mot, sto or csv")
    unit: str = Field(description="unit of the file's lengths")
    reading: ReadingPublic | None = Field(
        default=None, description="how the file was read; null where an older version read it"
    )
    options: dict[str, Any] = Field(
        default_factory=dict, description="options stated when the file was posted"
    )
    frames: int = Field(description="frames of the file")
    duration_s: float = Field(description="of the file [s]")
    n_runs: int = Field(description="clean runs")
    clean_frames: int = Field(description="frames of all clean runs")
    n_artifacts: int = Field(description="faults that were cut out")
    body_m: dict[str, float] = Field(
        description="lengths of the recorded person [m]; the median's for files of angles"
    )
    error_mm: ErrorPublic = Field(description="error of the import [mm]")
    beyond_limits: dict[str, JointBeyondLimits] = Field(
        description="joints outside the model's limits, by name"
    )

    @classmethod
    def from_domain(cls, record: StoredRecording) -> Self:
        """Return the schema of a record; its detail is needed for :class:`RecordingPublic`."""
        return cls.from_object(
            record,
            frames=record.n_frames,
            duration_s=record.duration,
            **record.summary,
            **(record.detail or {}),
        )


class RecordingPublic(RecordingItem):
    """One recording with each run and artifact."""

    clean_runs: list[RunPublic]
    artifacts: list[ArtifactPublic] = Field(description="the first 1000")


class RecordingList(Answer):
    """All recordings, by name."""

    items: list[RecordingItem]
