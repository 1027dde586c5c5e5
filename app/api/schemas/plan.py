"""``POST /v1/plan``: sorting task, robot and people in; next move and motion out."""

from collections.abc import Sequence
from typing import Annotated, Self

from pydantic import Field

from app.api.schemas.examples import PLAN, shows
from app.api.schemas.motion import SegmentPublic
from app.api.schemas.numbers import Answer, Data, Vector3, Word
from app.api.schemas.people import PersonInput, PersonUse
from app.api.schemas.robot_state import ArmState
from app.api.schemas.sorting import SortingFields, SortingMove, move_of
from app.api.schemas.task_selection import (
    FRAME_TEXT,
    ClosingTime,
    FrameName,
    Outcome,
    OutOfRangeInput,
    Phase,
    Stamp,
    TimeLeft,
    progress_of,
)
from app.errors import InvalidInput
from app.policies.inference.sorting_plan import (
    MotionEstimate,
    PlanOption,
    PlanQuery,
    SortingPlan,
    Symbol,
    reason,
    score_of,
)
from app.sim.core.arrays import Vec
from app.sim.human.person import Person
from app.sim.perception.multi_person_tracker import MAX_SKELETONS
from app.sim.pick.kernels.grasp import LIFT
from app.sim.pick.task_policy import Objective
from app.sim.sorting.names import SortingNames
from app.sim.sorting.near_optimal_moves import MARGIN, MAX_MARGIN
from app.sim.sorting.state import SortingState


class PlanRequest(SortingFields):
    """State of a sorting task, the robot and the people."""

    model_config = shows(PLAN)

    cell: str = Field(max_length=64, description="name of a sorting cell")
    frame: FrameName = Field("robot-base", description=FRAME_TEXT)
    stamp: Stamp = Field(None, description="your time of the state; returned unchanged")
    robot: ArmState
    people: list[PersonInput] = Field(
        max_length=MAX_SKELETONS, description="people in the cell, as in `/v1/task-selection`"
    )
    held: Word | None = Field(
        None,
        description="id of the object in the gripper, whose `at` is where it was picked; null: "
        "none",
    )
    previous: Word | None = Field(
        None,
        description="station of the last answer's motion, for hysteresis: that of `pick`, or "
        "of `place` while an object is held; one to which no motion is offered counts as none, "
        "and is refused in the phase `lift`; null: none",
    )
    phase: Phase = Field(
        "approach", description="phase of the motion to `previous`, as in `/v1/task-selection`"
    )
    closing_s: ClosingTime = Field(
        0.0, description="time for which the tool has been held there [s]"
    )
    time_left_s: TimeLeft = Field(
        10.0, description="time left for the motion [s]; clamped to 0 to 60 for the policy"
    )
    objective: Objective = Field(
        "value", description="objective of the choice, as in `/v1/task-selection`"
    )
    margin: Annotated[float, Field(ge=0.0, le=MAX_MARGIN)] = Field(
        MARGIN,
        description="expected attempts by which a move may be worse than the planner's own",
    )
    checkpoint: Word | None = Field(
        None, description="SHA-256 or alias of a pick policy; the shipped policy if null"
    )

    def to_domain(self, names: SortingNames, fail: Vec, people: Sequence[Person]) -> PlanQuery:
        """Return the query.

        Args:
            fail: The cell's failure probabilities, shape (K,).

        Raises:
            InvalidInput: An impossible state, with the field.
        """
        if self.previous not in names.stations and (
            self.previous is not None or self.phase == "lift"
        ):
            lacking = self.previous is None
            rule = "must be given in the phase lift" if lacking else "must be a station"
            raise InvalidInput("previous", self.previous, rule, names.stations)
        state = self.state_of(names, fail)
        return PlanQuery(
            q=self.robot.joints(self.robot.q),
            qd=self.robot.joints(self.robot.qd),
            qdd=None if self.robot.qdd is None else self.robot.joints(self.robot.qdd),
            people=people,
            state=state,
            held=None if self.held is None else self._held(self.held, names, state),
            previous=self.previous,
            progress=progress_of(self.phase, self.closing_s),
            time_left_s=self.time_left_s,
            objective=self.objective,
            margin=self.margin,
        )

    def _held(self, held: str, names: SortingNames, state: SortingState) -> int:
        """Return the position at which the held object counts."""
        found = [one for one in self.objects if one.id == held]
        if not found:
            ids = [one.id for one in self.objects if one.id is not None]
            raise InvalidInput("held", held, "must be the id of one of the objects", ids)
        place = names.stations.index(found[0].at)
        tower = place - names.shape.n_slots
        if tower >= 0 and found[0].level != state.heights[tower] - 1:
            raise InvalidInput("held", held, f"must be the top object of {found[0].at}")
        return place


class PlannedMotion(Answer):
    """The pick policy's estimate of one motion."""

    position: Vector3 = Field(description="target of the tool, over the object or place [m]")
    value: float = Field(description="expected discounted reward Q(s, pi(s))")
    outcome: Outcome | None = Field(
        description="probabilities and time; null where the checkpoint predicts none"
    )
    outside: list[OutOfRangeInput] = Field(description="coordinates outside the training range")

    @classmethod
    def from_domain(cls, estimate: MotionEstimate) -> Self:
        """Return the schema of the estimate."""
        return cls.model_validate(
            {
                "position": estimate.position.tolist(),
                "value": estimate.value,
                "outcome": Outcome.data_of(estimate.outcome),
                "outside": estimate.outside,
            }
        )


class PlannedMove(SortingMove):
    """A move that may be chosen."""

    chosen: bool
    expected_attempts: float = Field(
        description="attempts to the goal with this move first, with failed picks"
    )
    score: float = Field(
        description="what the objective maximises: the sum of the values of the motions, the "
        "product of their probabilities of success, or minus their time per success [s]"
    )
    to_object: PlannedMotion | None = Field(
        description="motion to the object, from the present state; null while it is held"
    )
    to_place: PlannedMotion = Field(
        description="motion with the object, which begins over it with 10 s left, or from the "
        "present state while it is held; people as they are now"
    )


class PlanAnswer(Answer):
    """The next move and its motion, with the explanation."""

    solved: bool = Field(description="whether every tower equals the goal and nothing is held")
    symbol: Symbol | None = Field(
        description="present motion: `pick` an object, `place` the held one, `return` it to "
        "where it was picked, because the plan needs another move first; null when solved"
    )
    move: SortingMove | None = Field(description="the chosen move; null when solved")
    target: Vector3 | None = Field(
        description="target of the tool in the present motion [m]; null when solved"
    )
    segment: SegmentPublic | None = Field(
        description="trajectory of the first control period; null when solved"
    )
    dt: float = Field(description="control period [s]")
    because: str = Field(description="the reason as a sentence")
    moves: list[PlannedMove] = Field(
        description="reachable moves within the margin, the planner's own first"
    )
    fewest_moves: int = Field(description="fewest moves to the goal without failed picks")
    expected_attempts: float = Field(
        description="the exact planner's expected attempts to the goal, with failed picks; the "
        "pick of an object that is held and can be placed has not failed"
    )
    people: list[PersonUse] = Field(description="use of each person")
    state_outside: list[OutOfRangeInput] = Field(
        description="measured joints outside their limits, clamped for the policy, and state "
        "fields outside the training range"
    )
    checkpoint: str = Field(description="SHA-256 of the pick policy")
    elapsed_ms: float = Field(description="time of the decision [ms]")
    stamp: Stamp = None

    @classmethod
    def from_domain(
        cls,
        plan: SortingPlan,
        query: PlanQuery,
        request: PlanRequest,
        names: SortingNames,
        people: list[Data],
    ) -> Self:
        """Return the answer of a plan.

        Args:
            plan: The plan; its decision counts people as the request does.
        """
        chosen, decision, segment = plan.chosen, plan.decision, plan.segment

        def move(option: PlanOption) -> SortingMove:
            return move_of(option.move, query.state, names, request.ids)

        return cls(
            solved=chosen is None,
            symbol=plan.symbol,
            move=None if chosen is None else move(chosen),
            target=None if chosen is None else (chosen.pick or chosen.place).position.tolist(),
            segment=None
            if segment is None
            else SegmentPublic(**SegmentPublic.commanded(segment, query.q, query.qd, plan.dt)),
            dt=plan.dt,
            because=reason(plan, query.objective, lifts=query.progress.phase == LIFT),
            moves=[
                PlannedMove(
                    **dict(move(one)),
                    chosen=index == plan.index,
                    expected_attempts=one.attempts,
                    score=score_of(one, query.objective),
                    to_object=None if one.pick is None else PlannedMotion.from_domain(one.pick),
                    to_place=PlannedMotion.from_domain(one.place),
                )
                for index, one in enumerate(plan.options)
            ],
            fewest_moves=plan.near.plan.moves,
            expected_attempts=plan.near.plan.attempts,
            people=[PersonUse(**one) for one in people],
            state_outside=[]
            if decision is None
            else [OutOfRangeInput.model_validate(one) for one in decision.outside],
            checkpoint=plan.checkpoint,
            elapsed_ms=plan.elapsed_ms,
            stamp=request.stamp,
        )
