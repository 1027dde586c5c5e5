"""What is known about a live world at one tick, frozen, for any thread to read.

Robot, person, ``previous`` and ``time_left_s`` are exactly the inputs of the decision beside
them: sending them to ``POST /v1/task-selection`` gives the same choice and the same values.
"""

from dataclasses import dataclass
from typing import Literal

from app.sim.commands import Mode
from app.sim.ports import OutsideField, Vec

Status = Literal[
    "moving",
    "picking",
    "contact",
    "blocked",
    "case done",
    "no candidates",
    "no policy",
]
"""``picking``: the target is reached, the tool goes down and up again; ``blocked``: the robot
waits at home because the person is in its way. In ``picking``, ``contact`` and ``case done``
the last decision stays as it was; in ``moving`` it belongs to this very state."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CandidateView:
    """One station the robot may choose now, with what the critic says about it."""

    id: str
    """Station id."""
    position: Vec
    """Point the tcp must reach, robot base frame [m], shape (3,), read-only."""
    value: float | None
    """``Q(s, pi(s))``, discounted reward; None without a decision."""
    chosen: bool
    """Whether the robot goes there."""
    reachable: bool | None
    """Whether a vertical-tool posture exists; None without a decision."""
    outside: tuple[OutsideField, ...]
    """Where the candidate lies outside what the checkpoint was trained on."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactView:
    """The contact that ended an episode."""

    kind: str
    """What the robot touched: ``human``, ``cell`` or ``self``."""
    link: str
    """Robot link that touched."""
    body: str
    """The person's capsule that was touched, ``table`` or ``robot``."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Counters:
    """What happened since the last reset."""

    reached: int = 0
    """Targets reached."""
    contacts: int = 0
    """Episodes that ended in a contact."""
    timeouts: int = 0
    """Episodes that ran out of time."""
    switches: int = 0
    """Changes of mind within an episode."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WorldSnapshot:
    """One live world at one tick."""

    id: str
    """Name of the world in URLs."""
    cell: str
    """Name of the work cell."""
    tick: int
    """Control periods since the world was made; never goes back."""
    t_s: float
    """Simulated time since the last reset [s]."""
    mode: Mode
    """Who moves the person."""
    paused: bool
    """Whether the clock stands still."""
    status: Status
    """What the robot is doing."""
    message: str
    """Why, in one sentence for people."""
    robot_q: Vec
    """Robot joint positions [rad], shape (6,), read-only."""
    robot_qd: Vec
    """Robot joint speeds [rad/s], shape (6,), read-only."""
    tcp: Vec
    """Tool centre point, robot base frame [m], shape (3,), read-only."""
    person_q: Vec
    """The person's joint positions [m, rad], shape (18,), read-only."""
    person_qd: Vec
    """The person's joint speeds [m/s, rad/s], shape (18,), read-only."""
    gripping: bool
    """Whether the fingers are closed."""
    selected: tuple[str, ...]
    """Stations the visitor allows; those reached this round are missing in ``candidates``."""
    candidates: tuple[CandidateView, ...]
    """Stations the robot may choose now, in the cell's order."""
    chosen: str | None
    """Id of the chosen candidate."""
    previous: str | None
    """The choice one tick earlier, as given to the policy."""
    time_left_s: float
    """Time left in the episode, as given to the policy [s]."""
    outside: tuple[OutsideField, ...]
    """Fields of the state outside what the checkpoint was trained on."""
    clearance_m: float | None
    """Least distance between robot and person [m]; None when it was not computed."""
    contact: ContactView | None
    """The contact that is shown at the moment."""
    checkpoint: str | None
    """SHA-256 of the checkpoint that decides."""
    policy_title: str | None
    """Its short text for people."""
    elapsed_ms: float | None
    """Time the decision took [ms]."""
    case: str | None
    """Id of the running case study."""
    counters: Counters
    """What happened since the last reset."""

    @property
    def values(self) -> dict[str, float]:
        """The critic's value per candidate id."""
        return {c.id: c.value for c in self.candidates if c.value is not None}
