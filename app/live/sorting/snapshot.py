"""What is known about the sorting task of a live cell at one tick, frozen.

Pieces are blocks with an id that stays theirs; the sorter knows only their codes
(``sorting_state.py``). Places are the ids of stations: ``cell3`` a clutter cell, ``red`` a
tower. Lengths are metres in the robot's base frame.
"""

from dataclasses import dataclass
from typing import Literal

from app.sim.core.arrays import Vec

HELD = "held"
"""Place of the piece that hangs at the magnet."""
Phase = Literal["idle", "approach", "grasp", "carry", "place"]
"""``approach``: the pick policy brings the tool over a piece; ``grasp``: down to it, the magnet
closes, up again; ``carry``: the policy brings it over its place; ``place``: down, the magnet
opens, up again; ``idle``: nothing to do, or nobody to do it."""
Decider = Literal["policy", "planner"]
"""Who chose the current move."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PieceView:
    """One block."""

    id: str
    """Name, never used again: ``block1``, ``block2``, ..."""
    colour: str
    """Colour; the cell's towers say which there are."""
    size: str
    """Size: ``small``, ``medium`` or ``large``."""
    place: str
    """Id of the station it is on, or HELD."""
    level: int
    """Level on a tower, 0 the lowest; 0 in the clutter and at the magnet."""
    position: Vec
    """Centre [m], shape (3,), read-only."""
    half_size: Vec
    """Half of length, width and height [m], shape (3,), read-only."""
    held: bool
    """Whether it hangs at the magnet."""
    in_goal: bool
    """Whether the goal asks for it; of twins as many as the goal asks for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GoalBlockView:
    """One block that the goal asks for, where it shall stand."""

    tower: str
    """Id of the tower."""
    level: int
    """Level, 0 the lowest."""
    colour: str
    """Colour."""
    size: str
    """Size."""
    position: Vec
    """Centre [m], shape (3,), read-only."""
    half_size: Vec
    """Half of length, width and height [m], shape (3,), read-only."""
    done: bool
    """Whether such a block stands there, on nothing wrong."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveView:
    """One move that the sorter may choose."""

    pick: str
    """Station a piece is taken from."""
    place: str
    """Station it is put on."""
    piece: str | None
    """Id of the piece; None where it is not known any more."""
    value: float | None
    """The sorter's value ``Q(s, a)``; None where the planner alone knows."""
    best: bool
    """Whether the exact planner counts it among the first moves of a shortest plan."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SortingCounters:
    """What the sorter did since the task began (a reset or a test)."""

    moves: int = 0
    """Pieces that were carried to where they should go."""
    attempts: int = 0
    """Grasps tried, the failed ones included."""
    failures: int = 0
    """Grasps that failed."""
    planner_fallbacks: int = 0
    """Times at which the exact planner took over from the policy."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SortingView:
    """The sorting task at one tick."""

    pieces: tuple[PieceView, ...]
    """The blocks, in the order of their ids; the held one too."""
    goal: tuple[GoalBlockView, ...]
    """What the towers shall be, tower by tower from the lowest level."""
    failure: tuple[float, ...]
    """Chance that a grasp fails, by clutter cell in the cell's order."""
    colours: tuple[str, ...]
    """The colours there are, in the order of the towers."""
    sizes: tuple[str, ...]
    """The sizes there are, from the smallest."""
    move: MoveView | None
    """The move that is carried out; None while nothing is."""
    phase: Phase
    """How far it is."""
    decided_by: Decider | None
    """Who chose it; None while nothing is carried out."""
    duplicates: tuple[str, ...]
    """Ids of the pieces whose moves the sorter calls equal; of two or more the critic chose."""
    ranked: tuple[MoveView, ...]
    """The best valid moves, best first, at most MAX_RANKED."""
    moves_to_go: int
    """Fewest moves to the goal, as the pieces lie; the held one counts where it was."""
    attempts_to_go: float
    """Expected grasps of that plan, failed ones included."""
    counters: SortingCounters
    """What the sorter did since the task began."""
    sorting_policy: str | None
    """SHA-256 of the sorter's checkpoint; None: the exact planner alone."""
    sorting_policy_title: str | None
    """Its short text for people."""
    test: str | None
    """Id of the running test."""
    solved: bool
    """Whether every tower is as the goal asks; a cell without a goal is not solved."""


MAX_RANKED = 5
"""Most moves that a snapshot ranks."""
