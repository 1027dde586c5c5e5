"""``POST /v1/sorting``: objects and goal in, next move out."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Annotated, Self

import numpy as np
from pydantic import BeforeValidator, Field

from app.api.schemas.examples import SORTING, shows
from app.api.schemas.numbers import Answer, Body, Finite, Word
from app.api.schemas.task_selection import Stamp
from app.errors import InvalidInput
from app.sim.core.arrays import Vec
from app.sim.sorting.batch import SortingSettings
from app.sim.sorting.decision_types import REASONS, By, SortingDecision, Why
from app.sim.sorting.names import NamedObject, SortingNames, fail_with, state_from_names
from app.sim.sorting.progress_monitor import MAX_SEEN, FallbackReason, ProgressMonitor
from app.sim.sorting.sorting_values import SortingValues
from app.sim.sorting.state import (
    MAX_COLOURS,
    MAX_SIZES,
    MAX_SLOTS,
    NULL,
    SIZE_NAMES,
    Move,
    SortingState,
)

Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_-]{0,31}$")]
Key = Annotated[str, Field(pattern=r"^[0-9a-f]{16}$")]


class SortingLayout(Body):
    """A sorting task without a work cell: its clutter slots are ``slot0``, ``slot1``, ..."""

    n_slots: int = Field(
        ge=1, le=MAX_SLOTS, description="clutter slots: most objects, and levels of a tower"
    )
    colours: list[Name] = Field(
        min_length=1, max_length=MAX_COLOURS, description="colours; each names a tower"
    )
    sizes: list[Name] = Field(
        list(SIZE_NAMES[3]),
        min_length=1,
        max_length=MAX_SIZES,
        description="sizes, from the smallest",
    )


class SortingObject(Body):
    """An object and its place."""

    colour: Word = Field(description="colour, one of the towers'")
    size: Word = Field(description="`small`, `medium` or `large` in a work cell")
    at: Word = Field(description="id of its clutter slot or tower")
    level: int | None = Field(
        None, ge=0, lt=MAX_SLOTS, description="level on a tower from 0; null in the clutter"
    )
    id: Word | None = Field(None, description="your name for it; returned with the move")


class GoalObject(Body):
    """An object of a goal tower."""

    size: Word
    colour: Word | None = Field(None, description="colour; the tower's own if null")


GoalEntry = Annotated[
    GoalObject,
    BeforeValidator(
        lambda value: {"size": value} if isinstance(value, str) else value,
        json_schema_input_type=Word | GoalObject,
    ),
]


class SortingRecord(Body):
    """State of the progress monitor, from the answer before, unchanged."""

    checkpoint: str = Field(
        pattern=r"^[0-9a-f]{64}$", description="SHA-256 of the monitored policy"
    )
    last: Key = Field(description="key of the last state")
    expected: Key = Field(description="key of the state after a successful move")
    can_fail: bool = Field(description="whether its pick can fail")
    seen: list[Key] = Field(max_length=MAX_SEEN, description="keys of the visited states")
    attempts: int = Field(ge=0, le=1_000_000, description="attempted moves of this task")
    budget: Finite = Field(ge=0.0, le=1e6, description="attempts until the planner fallback")
    planner_fallback: FallbackReason | None = Field(
        description="cause of the planner fallback, or null"
    )

    def to_domain(self) -> ProgressMonitor:
        """Return the simulator's data."""
        return ProgressMonitor(**{**dict(self), "seen": tuple(self.seen)})

    @classmethod
    def from_domain(cls, monitor: ProgressMonitor) -> Self:
        """Return the schema of the simulator's data."""
        return cls(**{**asdict(monitor), "seen": list(monitor.seen)})


class SortingFields(Body):
    """Objects, goal and failure probabilities of a sorting task."""

    objects: list[SortingObject] = Field(
        max_length=MAX_SLOTS,
        description="all objects, at most one per clutter slot of the task",
    )
    goal: dict[str, Annotated[list[GoalEntry], Field(max_length=MAX_SLOTS)]] = Field(
        max_length=MAX_COLOURS,
        description="by tower, from the bottom: a size, of the tower's own colour, or a size "
        "and a colour. Other towers are empty in the goal; all other objects belong in the "
        "clutter",
    )
    failure_map: dict[str, Finite] = Field(
        default_factory=dict,
        max_length=MAX_SLOTS,
        description="failure probability of a pick by clutter slot, 0 to 0.99; "
        "that of the work cell, or 0, for other slots",
    )

    def state_of(self, names: SortingNames, fail: Vec) -> SortingState:
        """Return the state.

        Args:
            fail: The cell's failure probabilities, shape (K,).

        Raises:
            InvalidInput: An impossible state, with the field.
        """
        goal = {
            tower: [(one.colour, one.size) for one in wanted]
            for tower, wanted in self.goal.items()
        }
        objects = [NamedObject(**dict(one)) for one in self.objects]
        return state_from_names(names, objects, goal, fail_with(names, fail, self.failure_map))

    @property
    def ids(self) -> "Ids":
        """Names of the objects, by station and level."""
        return {(one.at, one.level): one.id for one in self.objects}


class SortingRequest(SortingFields):
    """State of a sorting task."""

    model_config = shows(SORTING)

    cell: str | None = Field(
        None,
        max_length=64,
        description="name of the work cell; or `layout`",
        examples=["sorting-e0"],
    )
    layout: SortingLayout | None = Field(
        None, description="a task without a work cell, in place of `cell`"
    )
    monitor: SortingRecord | None = Field(
        None, description="`monitor` of the last answer in the same task; null at its start"
    )
    decider: By = Field("policy", description="a policy, or the exact planner")
    checkpoint: Word | None = Field(
        None,
        description="SHA-256 or alias of a sorting policy; if null the cell's shipped one, or "
        "the exact planner",
    )
    stamp: Stamp = Field(None, description="your time of the state; returned unchanged")

    def to_domain(self, names: SortingNames, fail: Vec) -> SortingState:
        """Return the state as :meth:`state_of`, for a decider that may have the checkpoint.

        Raises:
            InvalidInput: A checkpoint is named for the planner, or the state is impossible.
        """
        if self.decider == "planner" and self.checkpoint is not None:
            rule = "must be null where the planner decides"
            raise InvalidInput("checkpoint", self.checkpoint, rule)
        return self.state_of(names, fail)


class SortingPlace(Answer):
    """Place of a pick or of a placement."""

    station: str = Field(description="id of the clutter slot or tower")
    level: int | None = Field(description="level on a tower from 0; null in the clutter")


class SortingMove(Answer):
    """A move: where an object is picked and placed."""

    pick: SortingPlace
    place: SortingPlace
    object: str | None = Field(description="your id of the object, or null")
    colour: str
    size: str


class SortingValue(SortingMove):
    """A valid move with its value."""

    value: float | None = Field(
        description="policy: Q, expected discounted reward; planner: minus the expected number "
        "of attempts of its best plan that begins with this move (the optimum may have fewer), "
        "null in tasks too large for it"
    )
    fewest: bool = Field(description="whether a plan with the fewest moves begins with it")


class OutsideTraining(Answer):
    """An input outside the training range."""

    field: str
    value: str
    rule: str = Field(description="the training range")


class SortingAnswer(Answer):
    """The next move with its explanation."""

    solved: bool = Field(description="whether every tower equals the goal")
    move: SortingMove | None = Field(description="the next move; null when solved")
    by: By = Field(description="policy or planner")
    why: Why = Field(description="reason for policy or planner, as a keyword")
    because: str = Field(description="the reason as a sentence")
    moves: list[SortingValue] = Field(description="all valid moves, the chosen one first")
    fewest_moves: int = Field(description="fewest moves to the goal without failed picks")
    expected_attempts: float = Field(
        description="the exact planner's expected attempts to the goal, with failed picks"
    )
    outside: list[OutsideTraining] = Field(description="inputs outside the training range")
    monitor: SortingRecord | None = Field(
        description="send it with the next state of this task, so that the planner can replace "
        "a policy that repeats moves; null where nothing is monitored"
    )
    checkpoint: str | None = Field(description="SHA-256 of the policy; null without one")
    elapsed_ms: float = Field(description="time of the decision [ms]")
    stamp: Stamp = None

    @classmethod
    def from_domain(
        cls,
        decision: SortingDecision,
        state: SortingState,
        request: SortingRequest,
        names: SortingNames,
        outside: Sequence[OutsideTraining],
    ) -> Self:
        """Return the answer of a decision in a state."""
        ids, monitor = request.ids, decision.monitor

        def shown(move: Move) -> SortingMove:
            return move_of(move, state, names, ids)

        return cls.from_object(
            decision,
            move=shown(decision.move) if decision.move else None,
            because=REASONS[decision.why],
            moves=[
                SortingValue(**dict(shown(one.move)), value=one.value, fewest=one.fewest)
                for one in decision.ranked
            ],
            outside=outside,
            monitor=None if monitor is None else SortingRecord.from_domain(monitor),
            stamp=request.stamp,
        )


Ids = Mapping[tuple[str, int | None], str | None]
"""Names of objects in the request, by station and level."""


def outside_of(
    decision: SortingDecision,
    state: SortingState,
    names: SortingNames,
    policy: SortingValues | None,
    own: Vec,
) -> list[OutsideTraining]:
    """Return the inputs outside the training range; none without a policy.

    Args:
        own: The cell's failure probabilities, shape (K,).
    """
    if policy is None:
        return []
    found = [
        OutsideTraining(
            field=f"goal.{names.towers[one.tower]}[{one.level}]",
            value=names.kind(int(state.goal[one.tower, one.level])),
            rule=one.rule,
        )
        for one in decision.outside
    ]
    if policy.shape != names.shape:
        value, trained = str(names.shape), str(policy.shape)
        rule = f"was {trained} in training"
        found.append(OutsideTraining(field="cell", value=value, rule=rule))
    most = max(SortingSettings().failure_max, float(own.max()))
    for k in np.flatnonzero(state.fail > most).tolist():
        field, value = f"failure_map.{names.slots[k]}", f"{state.fail[k]:g}"
        rule = f"was at most {most:g} in training"
        found.append(OutsideTraining(field=field, value=value, rule=rule))
    return found


def move_of(move: Move, state: SortingState, names: SortingNames, ids: Ids) -> SortingMove:
    """Return a move in the words of the task; a move back ends where it began."""
    pick = _place(move.pick, state, names, top=True)
    tower = move.pick - names.shape.n_slots
    code = int(state.clutter[move.pick] if tower < 0 else state.towers[tower, pick.level or 0])
    return SortingMove(
        pick=pick,
        place=_place(move.place, state, names, top=move.place == move.pick),
        object=ids.get((pick.station, pick.level)),
        colour=names.colours[names.shape.colour_of(code)],
        size=names.sizes[names.shape.size_of(code)],
    )


def _place(
    position: int, state: SortingState, names: SortingNames, *, top: bool
) -> SortingPlace:
    """Return a place; on a tower the highest level, or the free one above it."""
    tower = position - names.shape.n_slots
    if tower < 0:
        return SortingPlace(station=names.slots[position], level=None)
    height = int((state.towers[tower] != NULL).sum())
    return SortingPlace(station=names.towers[tower], level=height - 1 if top else height)
