"""The sorting task of a live world: what it shows, and what may be done to it."""

from typing import Any, Self

from pydantic import Field

from app.api.schemas.numbers import Answer
from app.live.sorting.snapshot import GoalBlockView, MoveView, PieceView, SortingView


class PieceLive(Answer):
    """One block."""

    id: str
    colour: str
    size: str
    place: str = Field(description="id of the station it is on, or `held`")
    level: int = Field(description="level on a tower, 0 the lowest")
    position: list[float] = Field(description="centre [m]")
    half_size: list[float] = Field(description="half of length, width and height [m]")
    held: bool = Field(description="whether it hangs at the magnet")
    in_goal: bool = Field(description="whether the goal asks for it")

    @classmethod
    def from_domain(cls, view: PieceView) -> Self:
        """Make it from the world's view."""
        same = ("id", "colour", "size", "place", "level", "held", "in_goal")
        return cls(
            **{name: getattr(view, name) for name in same},
            position=view.position.tolist(),
            half_size=view.half_size.tolist(),
        )


class GoalBlockLive(Answer):
    """One block that the goal asks for."""

    tower: str
    level: int
    colour: str
    size: str
    position: list[float] = Field(description="centre [m]")
    half_size: list[float] = Field(description="half of length, width and height [m]")
    done: bool = Field(description="whether such a block stands there, on nothing wrong")

    @classmethod
    def from_domain(cls, view: GoalBlockView) -> Self:
        """Make it from the world's view."""
        same = ("tower", "level", "colour", "size", "done")
        return cls(
            **{name: getattr(view, name) for name in same},
            position=view.position.tolist(),
            half_size=view.half_size.tolist(),
        )


class MoveLive(Answer):
    """One move that the sorter may choose."""

    pick: str = Field(description="station a block is taken from")
    place: str = Field(description="station it is put on")
    piece: str | None = Field(description="id of the block")
    value: float | None = Field(description="the sorter's value; null where it has none")
    best: bool = Field(description="begins a shortest plan, says the exact planner")

    @classmethod
    def from_domain(cls, view: MoveView) -> Self:
        """Make it from the world's view."""
        return cls(**{name: getattr(view, name) for name in cls.model_fields})


class SortingCountersPublic(Answer):
    """What the sorter did since the task began."""

    moves: int
    attempts: int = Field(description="grasps tried, the failed ones included")
    failures: int
    planner_fallbacks: int = Field(description="times at which the exact planner took over")


class SortingLive(Answer):
    """The sorting task at one tick."""

    pieces: list[PieceLive]
    goal: list[GoalBlockLive] = Field(description="tower by tower from the lowest level")
    failure: list[float] = Field(description="chance that a grasp fails, by clutter cell")
    colours: list[str] = Field(description="colours, in the order of the towers")
    sizes: list[str] = Field(description="sizes, from the smallest")
    move: MoveLive | None = Field(description="the move that is carried out")
    phase: str = Field(description="idle, approach, grasp, carry or place")
    decided_by: str | None = Field(description="policy or planner")
    duplicates: list[str] = Field(description="blocks that the sorter calls equal")
    ranked: list[MoveLive] = Field(description="the best valid moves, best first")
    moves_to_go: int = Field(description="fewest moves to the goal")
    attempts_to_go: float = Field(description="expected grasps, failed ones included")
    counters: SortingCountersPublic
    sorting_policy: str | None = Field(
        description="SHA-256 of the sorter; null: the planner alone"
    )
    sorting_policy_title: str | None
    test: str | None = Field(description="id of the running test")
    solved: bool

    @classmethod
    def from_domain(cls, view: SortingView) -> Self:
        """Make it from the world's view."""
        same = (
            "phase", "decided_by", "moves_to_go", "attempts_to_go", "sorting_policy",
            "sorting_policy_title", "test", "solved",
        )  # fmt: skip
        counters = SortingCountersPublic.model_fields
        members: dict[str, Any] = {name: getattr(view, name) for name in same}
        for name in ("failure", "colours", "sizes", "duplicates"):
            members[name] = list(getattr(view, name))
        return cls(
            **members,
            pieces=[PieceLive.from_domain(one) for one in view.pieces],
            goal=[GoalBlockLive.from_domain(one) for one in view.goal],
            move=None if view.move is None else MoveLive.from_domain(view.move),
            ranked=[MoveLive.from_domain(one) for one in view.ranked],
            counters=SortingCountersPublic(
                **{name: getattr(view.counters, name) for name in counters}
            ),
        )
