"""State of the sorting task of a live cell at one tick.

Blocks have constant ids; the sorting policy knows only colour and size. Places are
station ids: ``slot3`` is a clutter slot, ``red`` a tower. Lengths are in the robot base frame.
"""

from dataclasses import dataclass
from typing import Literal

from app.live.read_model import Numbers, ReadModel

HELD = "held"
"""Place of the block in the gripper."""
Phase = Literal["idle", "approach", "grasp", "carry", "place"]
"""``approach``: the pick policy moves the tool over a block; ``grasp``: down, the gripper
closes, up; ``carry``: the policy moves the block over its place; ``place``: down, the gripper
opens, up; ``idle``: no move or no policy."""
Decider = Literal["policy", "planner"]
"""Source of the present move."""
Order = Literal["critic", "planner", "nearest"]
"""Choice among equal moves: by the critic of the pick policy, by the sorting policy or the
planner, or the block nearest to the tool."""
MAX_RANKED = 5
"""Maximum number of ranked moves in a snapshot."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockSnapshot(ReadModel):
    """One block."""

    id: str
    """name, never reused: `block1`, `block2`, ..."""
    colour: str
    """colour of one of the towers"""
    size: str
    """small, medium or large"""
    place: str
    """id of the station it is on, or `held`"""
    level: int
    """level on a tower, 0 the lowest; 0 elsewhere"""
    position: Numbers
    """centre [m]"""
    half_size: Numbers
    """half of length, width and height [m]"""
    held: bool
    """whether the gripper holds it"""
    in_goal: bool
    """whether it is part of the goal; of duplicates as many as the goal contains"""


@dataclass(frozen=True, slots=True, kw_only=True)
class GoalBlockSnapshot(ReadModel):
    """One block of the goal."""

    tower: str
    """id of the tower"""
    level: int
    """level, 0 the lowest"""
    colour: str
    """colour"""
    size: str
    """size"""
    position: Numbers
    """centre [m]"""
    half_size: Numbers
    """half of length, width and height [m]"""
    done: bool
    """whether such a block is there, with no wrong one below"""


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveSnapshot(ReadModel):
    """One move that can be chosen."""

    pick: str
    """station of the block"""
    place: str
    """station it is placed on"""
    block: str | None
    """id of the block; null if it is gone"""
    value: float | None
    """Q(s, a) of the sorting policy, or minus the expected grasps of the planner; null where
    neither values it"""
    best: bool
    """whether it begins a shortest plan of the exact planner"""


@dataclass(frozen=True, slots=True, kw_only=True)
class SortingCounters(ReadModel):
    """Events since the task began (a reset or a test)."""

    moves: int = 0
    """blocks placed"""
    attempts: int = 0
    """grasps, the failed ones included"""
    failures: int = 0
    """failed grasps"""
    planner_fallbacks: int = 0
    """fallbacks from the policy to the exact planner"""


@dataclass(frozen=True, slots=True, kw_only=True)
class SortingSnapshot(ReadModel):
    """The sorting task at one tick."""

    blocks: tuple[BlockSnapshot, ...]
    """blocks in the order of their ids, the held one included"""
    goal: tuple[GoalBlockSnapshot, ...]
    """goal, tower by tower from the lowest level"""
    failure: tuple[float, ...]
    """probability that a grasp fails, by clutter slot"""
    colours: tuple[str, ...]
    """colours, in the order of the towers"""
    sizes: tuple[str, ...]
    """sizes, from the smallest"""
    move: MoveSnapshot | None
    """present move"""
    phase: Phase
    """phase of the move: idle, approach, grasp, carry or place"""
    decided_by: Decider | None
    """source of the move; null without one"""
    order: Order
    """choice among equal moves"""
    duplicates: tuple[str, ...]
    """ids of the blocks that the robot may take; of several the critic selects one"""
    ranked: tuple[MoveSnapshot, ...]
    """best valid moves, best first; the present move is last where it is none of them"""
    moves_to_go: int
    """fewest moves to the goal; a held block counts at its former place"""
    attempts_to_go: float
    """expected grasps of that plan, failed ones included"""
    counters: SortingCounters
    """events since the task began"""
    sorting_policy: str | None
    """SHA-256 of the sorting policy; null: the exact planner alone"""
    sorting_policy_title: str | None
    """title of the sorting policy"""
    test: str | None
    """id of the running test"""
    solved: bool
    """whether every tower matches the goal; false without a goal"""
