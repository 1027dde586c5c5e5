"""What is known about a live world at one tick, frozen, for any thread to read.

Robot, people, ``previous`` and ``time_left_s`` are exactly the inputs of the decision beside
them: sending them to ``POST /v1/task-selection`` gives the same choice and the same values.
"""

from dataclasses import dataclass
from typing import Literal

from app.live.commands import Mode
from app.live.reach.snapshot import ReachView
from app.live.sorting.snapshot import SortingView
from app.sim.core.arrays import Vec
from app.sim.core.out_of_range import OutsideField
from app.sim.pick.case_verdict import Verdict

Status = Literal[
    "moving",
    "picking",
    "contact",
    "blocked",
    "case done",
    "no candidates",
    "no policy",
    "solved",
    "reached",
]
"""``picking``: the target is reached, the tool goes down and up again; ``blocked``: the robot
waits at home because a person is in its way. In ``picking``, ``contact`` and ``case done``
the last decision stays as it was; in ``moving`` it belongs to this very state. In a sorting
cell ``picking`` is ``grasp`` and ``place``, and ``solved`` says that every tower is as the goal
asks. In a reach cell ``reached`` says that the tool is at the goal."""


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
    person: int | None = None
    """Id of the person who was touched."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyView:
    """How large a person is, or is becoming within half a second."""

    stature: float
    """Percentile of the stature that was asked for last."""
    arms: float
    """Percentile of the arms' length, likewise."""
    shoulders: float
    """Percentile of the shoulders' width, likewise."""
    recorded: bool
    """Whether a recorded person's lengths hold instead of the percentiles."""
    stature_m: float
    """Height of the head's top above the floor, standing upright [m]."""
    trunk_m: float
    """Pelvis to the base of the neck [m]."""
    arm_m: float
    """Shoulder to palm [m], mean of both."""
    shoulders_m: float
    """From shoulder joint to shoulder joint [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionView:
    """A recorded motion that is being played."""

    name: str
    """Name of the stored motion."""
    run: int
    """Which of its runs, from 0."""
    n_runs: int
    """How many clean runs it has."""
    t_s: float
    """How far it has come [s]."""
    duration_s: float
    """Length of the run [s]."""
    outside_share: float
    """Share of its frames whose pelvis lies outside the walking area."""
    clipped_share: float
    """Share of its frames with an angle beyond a joint's limit; policies are told the limit."""
    clipped_m: float
    """How far a wrist told so is from the true one at most [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CylinderView:
    """A person of whom no more than an upright cylinder is known."""

    x: float
    """Axis, robot base frame [m]."""
    y: float
    """The same."""
    vx: float
    """Velocity in the period to come [m/s]."""
    vy: float
    """The same."""
    radius: float
    """Radius [m]."""
    height: float
    """Height above the floor [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PersonView:
    """One person in a live cell."""

    id: int
    """Number of the person, kept as long as the person is there; the first is 0."""
    mode: Mode
    """Who moves the person."""
    q: Vec
    """Joint positions inside their limits, as policies are told them [m, rad], shape (18,),
    read-only; yaw within half a turn of home's."""
    posture: Vec
    """Where the body is [m, rad], shape (18,), read-only: recorded people leave the limits."""
    qd: Vec
    """Joint speeds [m/s, rad/s], shape (18,), read-only."""
    size: Vec
    """Size at this moment [m], shape (12,), read-only; the pelvis as high as it is now."""
    body: BodyView
    """How large the person is."""
    motion: MotionView | None
    """What is played in mode ``recorded``."""
    joining: bool
    """Whether the person is on the way to where work, motion or rest begin."""
    outside_area: bool
    """Whether the pelvis lies outside the walking area now."""
    clearance_m: float
    """Distance of the robot to this person [m]."""
    nearest: bool
    """Whether nobody is nearer to the robot: the one a policy for one person sees."""
    cylinder: CylinderView | None = None
    """What counts for contact in a reach cell; posture and size are then only a picture."""


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
    people: tuple[PersonView, ...]
    """The people in the cell, 0 to 4, in the order of their ids."""
    gripping: bool = False
    """Whether the fingers are closed."""
    selected: tuple[str, ...] = ()
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
    """Least distance between robot and people [m]; None where nobody is there."""
    contact: ContactView | None
    """The contact that is shown at the moment."""
    checkpoint: str | None
    """SHA-256 of the checkpoint that decides."""
    policy_title: str | None
    """Its short text for people."""
    elapsed_ms: float | None
    """Time the decision took [ms]."""
    case: str | None = None
    """Id of the running case study."""
    counters: Counters
    """What happened since the last reset."""
    decided_s: float | None = None
    """When the last decision was made, as ``t_s``; None without one."""
    verdict: Verdict | None = None
    """What the running case study or sorting test expects, and what happened so far."""
    speed: int = 1
    """Simulated seconds per second that were asked for last."""
    commands: int = 0
    """Number of the last command that was carried out or refused; they count from 1."""
    refused: tuple[int, str] | None = None
    """Number of the last command that was refused after it had been queued, and why."""
    sorting: SortingView | None = None
    """The sorting task; None in a cell without one."""
    reach: ReachView | None = None
    """Goal, safety layer and outcomes of a reach cell; None in other cells."""

    @property
    def values(self) -> dict[str, float]:
        """The critic's value per candidate id."""
        return {c.id: c.value for c in self.candidates if c.value is not None}

    @property
    def nearest(self) -> PersonView | None:
        """The person nearest to the robot; None where nobody is there."""
        return next((person for person in self.people if person.nearest), None)

    @property
    def mode(self) -> Mode | None:
        """Who moves the first person; None where nobody is there."""
        return self.people[0].mode if self.people else None

    @property
    def person_q(self) -> Vec:
        """The first person's joint positions [m, rad], shape (18,)."""
        return self.people[0].q

    @property
    def person_qd(self) -> Vec:
        """The first person's joint speeds [m/s, rad/s], shape (18,)."""
        return self.people[0].qd
