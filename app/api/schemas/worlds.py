"""Live worlds: what they show, and what may be done to them."""

from typing import Any, Self

from pydantic import Field

from app.api.schemas.live_people import PersonLight, PersonLive
from app.api.schemas.live_reach import ReachLive
from app.api.schemas.live_sorting import SortingLive
from app.api.schemas.numbers import Answer, Body
from app.api.schemas.robot_state import RobotState
from app.api.schemas.task_selection import (
    CandidateState,
    Outside,
    PersonState,
    TaskSelectionRequest,
)
from app.live.snapshot import CandidateView, WorldSnapshot
from app.sim.pick.case_verdict import Verdict


class CandidateLive(Answer):
    """One station the robot may choose now."""

    id: str
    position: list[float] = Field(description="point the tool must reach [m]")
    value: float | None = Field(description="expected discounted reward; null undecided")
    chosen: bool
    reachable: bool | None
    outside: list[Outside]

    @classmethod
    def from_domain(cls, view: CandidateView) -> Self:
        """Make it from the world's view."""
        return cls(
            id=view.id,
            position=view.position.tolist(),
            value=view.value,
            chosen=view.chosen,
            reachable=view.reachable,
            outside=[Outside.from_domain(one) for one in view.outside],
        )


class RefusedCommand(Answer):
    """A command that fitted the world when it was queued and did not when its turn came."""

    number: int
    reason: str


class ContactPublic(Answer):
    """The contact that ended an episode."""

    kind: str
    link: str
    body: str
    person: int | None = Field(description="id of the person who was touched")


class CountersPublic(Answer):
    """What happened since the last reset."""

    reached: int
    contacts: int
    timeouts: int
    switches: int


class ChoicePublic(Answer):
    """A goal that was chosen, and when."""

    t_s: float = Field(description="simulated time [s]")
    goal: str


class VerdictPublic(Answer):
    """What a case study or a sorting test is judged by."""

    expected: str = Field(description="what it expects, one sentence")
    observed: str = Field(description="what happened so far, one sentence")
    as_expected: bool | None = Field(
        description="the verdict on the whole run; null while it is open or cannot be judged"
    )
    choices: list[ChoicePublic] = Field(
        description="in a case study, the first choice and every change of mind"
    )

    @classmethod
    def from_domain(cls, verdict: Verdict) -> Self:
        """Make it from the world's verdict."""
        return cls(
            expected=verdict.expected,
            observed=verdict.observed,
            as_expected=verdict.as_expected,
            choices=[ChoicePublic(t_s=one.t_s, goal=one.goal) for one in verdict.choices],
        )


class WorldLight(Answer):
    """One live world at one tick, without joint positions: ten times a second on a stream."""

    id: str
    cell: str
    tick: int
    t_s: float = Field(description="simulated time since the last reset [s]")
    mode: str | None = Field(description="who moves the first person; null: nobody is there")
    people: tuple[PersonLight, ...] = Field(description="0 to 4, in the order of their ids")
    paused: bool
    speed: int = Field(description="simulated seconds per second that were asked for last")
    commands: int = Field(description="number of the last command that was carried out")
    refused: RefusedCommand | None = Field(
        description="the last command that was queued and could not be carried out then"
    )
    status: str
    message: str = Field(description="why, in one sentence")
    gripping: bool = Field(description="whether the fingers are closed")
    selected: list[str] = Field(description="stations that the visitor allows")
    candidates: list[CandidateLive]
    chosen: str | None
    outside: list[Outside] = Field(description="state fields outside the training range")
    decided_s: float | None = Field(
        description="when values and choice were decided, as `t_s` [s]; null without a decision"
    )
    clearance_m: float | None = Field(
        description="least distance robot to people [m]; 0 or less: contact, negative: overlap"
    )
    contact: ContactPublic | None
    checkpoint: str | None = Field(description="SHA-256 of the checkpoint that decides")
    policy_title: str | None
    elapsed_ms: float | None = Field(description="time the decision took [ms]")
    case: str | None
    verdict: VerdictPublic | None = Field(
        description="of the running case study or sorting test; null without one"
    )
    counters: CountersPublic
    sorting: SortingLive | None = Field(description="the sorting task; null without one")
    reach: ReachLive | None = Field(
        description="goal, safety layer and outcomes of a reach cell; null in other cells"
    )

    @classmethod
    def from_domain(cls, snapshot: WorldSnapshot) -> Self:
        """Make it from a snapshot."""
        return cls(**light_members(snapshot))


class WorldPublic(WorldLight):
    """One live world at one tick, with the state that a decision needs."""

    robot: RobotState
    people: tuple[PersonLive, ...] = Field(description="0 to 4, in the order of their ids")
    previous: str | None = Field(description="the choice one tick earlier")
    time_left_s: float = Field(description="time left in the episode [s]")
    tcp: list[float] = Field(description="tool centre point [m]")
    viewer: str = Field(description="where its 3D scene is")
    state: TaskSelectionRequest | None = Field(
        description="post it to /v1/task-selection as it is: while the status is `moving`, "
        "same choice and values; null while there is nothing to choose"
    )

    @classmethod
    def from_domain(cls, snapshot: WorldSnapshot) -> Self:
        """Make it from a snapshot."""
        members = light_members(snapshot)
        members["people"] = tuple(PersonLive.from_domain(one) for one in snapshot.people)
        return cls(
            **members,
            robot=robot_of(snapshot),
            previous=snapshot.previous,
            time_left_s=snapshot.time_left_s,
            tcp=snapshot.tcp.tolist(),
            viewer=f"/viewer/{snapshot.id}/",
            state=decision_input(snapshot),
        )


class WorldSummary(Answer):
    """One line of the list of worlds."""

    id: str
    cell: str
    viewer: str
    checkpoint: str | None

    @classmethod
    def from_domain(cls, snapshot: WorldSnapshot) -> Self:
        """Make it from a snapshot."""
        return cls(
            id=snapshot.id,
            cell=snapshot.cell,
            viewer=f"/viewer/{snapshot.id}/",
            checkpoint=snapshot.checkpoint,
        )


class WorldCell(Body):
    """The cell a live world shall show from now on."""

    cell: str = Field(
        max_length=64, description="name of a cell to pick and place, sort or reach in"
    )
    checkpoint: str | None = Field(
        None, max_length=64, description="SHA-256 or alias of what decides; see above if null"
    )
    sorting_policy: str | None = Field(
        None, max_length=64, description="SHA-256 or alias of what sorts; see above if null"
    )


class WorldList(Answer):
    """All live worlds."""

    items: list[WorldSummary]


def robot_of(snapshot: WorldSnapshot) -> RobotState:
    """Return the robot's state, as a request carries it."""
    return RobotState(q=snapshot.robot_q.tolist(), qd=snapshot.robot_qd.tolist())


def people_of(snapshot: WorldSnapshot) -> list[PersonState]:
    """Return the people's states, as a request carries them."""
    return [
        PersonState(q=one.q.tolist(), qd=one.qd.tolist(), size=one.size.tolist())
        for one in snapshot.people
    ]


def decision_input(snapshot: WorldSnapshot) -> TaskSelectionRequest | None:
    """Return the request that repeats the snapshot's decision; None with nothing to choose."""
    if not snapshot.candidates:
        return None
    return TaskSelectionRequest(
        cell=snapshot.cell,
        frame="robot-base",
        stamp=snapshot.t_s,
        robot=robot_of(snapshot),
        people=people_of(snapshot),
        candidates=[
            CandidateState(id=one.id, position=one.position.tolist())
            for one in snapshot.candidates
        ],
        previous=snapshot.previous,
        time_left_s=max(snapshot.time_left_s, 0.0),
        checkpoint=snapshot.checkpoint,
    )


def light_members(snapshot: WorldSnapshot) -> dict[str, Any]:
    """Return the members of :class:`WorldLight`."""
    contact, counters = snapshot.contact, snapshot.counters
    same = (
        "id", "cell", "tick", "t_s", "mode", "paused", "speed", "status", "message",
        "gripping", "chosen", "clearance_m", "checkpoint", "policy_title", "elapsed_ms", "case",
        "commands", "decided_s",
    )  # fmt: skip
    return {name: getattr(snapshot, name) for name in same} | {
        "people": tuple(PersonLight.from_domain(one) for one in snapshot.people),
        "refused": snapshot.refused
        and RefusedCommand(number=snapshot.refused[0], reason=snapshot.refused[1]),
        "selected": list(snapshot.selected),
        "candidates": [CandidateLive.from_domain(one) for one in snapshot.candidates],
        "outside": [Outside.from_domain(one) for one in snapshot.outside],
        "contact": contact
        and ContactPublic(
            kind=contact.kind, link=contact.link, body=contact.body, person=contact.person
        ),
        "verdict": snapshot.verdict and VerdictPublic.from_domain(snapshot.verdict),
        "counters": CountersPublic(
            reached=counters.reached,
            contacts=counters.contacts,
            timeouts=counters.timeouts,
            switches=counters.switches,
        ),
        "sorting": None
        if snapshot.sorting is None
        else SortingLive.from_domain(snapshot.sorting),
        "reach": None if snapshot.reach is None else ReachLive.from_domain(snapshot.reach),
    }


class CommandAccepted(Answer):
    """The command is queued; the world applies it before its next tick."""

    tag: str
    number: int = Field(description="a snapshot whose `commands` is as high shows its effect")
    tick: int = Field(description="the world's last tick when the command was queued")
