"""Live worlds as answers of the API: the snapshot itself, with the request of its decision."""

from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Self

from pydantic import ConfigDict, Field, TypeAdapter

from app.api.schemas.examples import FOLLOW, WORLD_CELL, shows
from app.api.schemas.numbers import Answer, Body
from app.api.schemas.robot_state import RobotState
from app.api.schemas.task_selection import CandidateState, PersonState, TaskSelectionRequest
from app.live.snapshot import WorldSnapshot

SNAPSHOT = TypeAdapter(WorldSnapshot)
ONLY_FULL: dict[str, Any] = {
    "previous": True,
    "phase": True,
    "closing_s": True,
    "time_left_s": True,
    "tcp": True,
    "people": {"__all__": {"q", "qd", "size"}},
}
"""Members of a snapshot that its stream leaves out."""


def stream_json(snapshot: WorldSnapshot) -> str:
    """Return a snapshot without joint positions, as JSON of the stream."""
    return SNAPSHOT.dump_json(snapshot, exclude=ONLY_FULL).decode()


def _describe(schema: dict[str, Any]) -> None:
    """Copy the descriptions of inherited fields, which pydantic reads from one class only."""
    known = SNAPSHOT.json_schema(mode="serialization")["properties"]
    for name, member in schema["properties"].items():
        if "description" in known.get(name, {}):
            member.setdefault("description", known[name]["description"])


@dataclass(frozen=True, slots=True, kw_only=True)
class WorldState(WorldSnapshot):
    """One live world at one tick, with the state that a decision needs."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(
        use_attribute_docstrings=True, json_schema_extra=_describe
    )
    robot: RobotState
    """state of the robot"""
    viewer: str
    """path of its 3D scene"""
    state: TaskSelectionRequest | None
    """body for /v1/task-selection; it returns the same choice and values while the status is
    `moving`, in pick cells also `picking`; null without candidates"""


def state_of(snapshot: WorldSnapshot) -> WorldState:
    """Return a snapshot with the members that only a single answer has."""
    same = {one.name: getattr(snapshot, one.name) for one in fields(snapshot)}
    return WorldState(
        **same,
        robot=robot_of(snapshot),
        viewer=f"/viewer/{snapshot.id}/",
        state=decision_input(snapshot),
    )


class FollowPublic(Answer):
    """What a live world follows, or why it does so no longer."""

    job: str = Field(description="id of the training")
    number: int = Field(description="its running number")
    active: bool = Field(description="whether newer checkpoints will act")
    step: int | None = Field(description="step of the checkpoint that acts; null: none yet")
    checkpoint: str | None = Field(description="its SHA-256")
    reason: str | None = Field(description="why it has ended; null while it follows")


class WorldSummary(Answer):
    """One line of the list of worlds."""

    id: str
    cell: str
    viewer: str
    checkpoint: str | None
    follow: FollowPublic | None = Field(
        description="the training that it follows or followed last; null for none"
    )
    unstored: list[str] = Field(
        description="SHA-256 of policies that act and are no longer stored, such as those "
        "that a training dropped when it was resumed from an earlier state"
    )

    @classmethod
    def from_domain(
        cls,
        snapshot: WorldSnapshot,
        follow: FollowPublic | None = None,
        unstored: Iterable[str] = (),
    ) -> Self:
        """Make it from a snapshot."""
        viewer = f"/viewer/{snapshot.id}/"
        return cls.from_object(snapshot, viewer=viewer, follow=follow, unstored=list(unstored))


class WorldCell(Body):
    """The next cell of a live world."""

    model_config = shows(WORLD_CELL)

    cell: str = Field(max_length=64, description="name of a pick, sorting or reach cell")
    checkpoint: str | None = Field(
        None, max_length=64, description="SHA-256 or alias of the policy; see above if null"
    )
    sorting_policy: str | None = Field(
        None, max_length=64, description="SHA-256 or alias of the sorting policy, likewise"
    )


class WorldList(Answer):
    """All live worlds."""

    items: list[WorldSummary]


def robot_of(snapshot: WorldSnapshot) -> RobotState:
    """Return the robot's state, as a request carries it."""
    return RobotState(q=snapshot.robot_q.tolist(), qd=snapshot.robot_qd.tolist())


def decision_input(snapshot: WorldSnapshot) -> TaskSelectionRequest | None:
    """Return the request that repeats the snapshot's decision; None without candidates."""
    if not snapshot.candidates:
        return None
    return TaskSelectionRequest(
        cell=snapshot.cell,
        frame="robot-base",
        stamp=snapshot.t_s,
        robot=robot_of(snapshot),
        people=[
            PersonState(q=one.q.tolist(), qd=one.qd.tolist(), size=one.size.tolist())
            for one in snapshot.people
        ],
        candidates=[
            CandidateState(id=one.id, position=one.position.tolist())
            for one in snapshot.candidates
        ],
        previous=snapshot.previous,
        phase=snapshot.phase,
        closing_s=snapshot.closing_s,
        objective="value",
        time_left_s=max(snapshot.time_left_s, 0.0),
        checkpoint=snapshot.checkpoint,
    )


class CommandAccepted(Answer):
    """The command is queued; the world applies it before its next tick."""

    tag: str
    number: int = Field(description="a snapshot whose `commands` is as high shows its effect")
    tick: int = Field(description="the world's last tick when the command was queued")


class FollowRequest(Body):
    """The training whose newest checkpoint acts in a live world."""

    model_config = shows(FOLLOW)

    job: str = Field(max_length=64, description="id of a training that has not ended")
