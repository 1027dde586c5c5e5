"""Immutable state of a live world at one tick, for any thread and as JSON of the HTTP API.

While the status is ``moving``, in pick cells also ``picking``, robot, people, ``previous`` and
``time_left_s`` are the inputs of the decision in the same snapshot:
``POST /v1/task-selection`` returns the same choice and values for them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from app.live.commands import Mode
from app.live.reach.snapshot import ReachSnapshot
from app.live.read_model import Internal, Numbers, ReadModel, frozen
from app.live.safety.snapshot import SafetySnapshot
from app.live.sorting.snapshot import SortingSnapshot
from app.sim.core.out_of_range import OutOfRangeValue
from app.sim.pick.case_verdict import Verdict
from app.sim.pick.task_policy import Candidate, Decision

PickPhase = Literal["approach", "descend", "lift"]
PICK_PHASES: tuple[PickPhase, ...] = ("approach", "descend", "lift")
"""Phases of a pick, by their numbers in ``pick/kernels/grasp.py``."""
MAX_REFUSED = 32
"""Largest number of refused commands in a snapshot."""
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
"""``picking``: the tool descends to an object, closes and comes up; ``blocked``: the robot
waits at home for a person to leave. In ``moving``, in a pick cell also in ``picking``, the
decision belongs to the present state; otherwise the last one stays. In a sorting cell
``picking`` is ``grasp`` and ``place`` by inverse kinematics, and ``solved`` means that every
tower matches the goal. In a reach cell ``reached`` means that the tool is at the goal."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CandidateSnapshot(ReadModel):
    """One station that the robot can choose, with its value estimate."""

    id: str
    """station id"""
    position: Numbers
    """target of the tool centre point, robot base frame [m]"""
    value: float | None
    """Q(s, π(s)), expected discounted reward; null without a decision"""
    success: float | None
    """probability of success; null where the checkpoint predicts none"""
    contact: float | None
    """probability of a contact"""
    time_s: float | None
    """expected time to success [s]"""
    chosen: bool
    """whether the robot moves there"""
    reachable: bool | None
    """whether a configuration with vertical tool exists; null without a decision"""
    outside: tuple[OutOfRangeValue, ...]
    """inputs of the candidate outside the training range"""


def candidate_snapshots(
    offered: Sequence[Candidate], decision: Decision | None
) -> tuple[CandidateSnapshot, ...]:
    """Return the offered stations, with values and outcomes of the decision."""
    snapshots = []
    for k, candidate in enumerate(offered):
        outcome = None if decision is None else decision.outcome(k)
        snapshots.append(
            CandidateSnapshot(
                id=candidate.id,
                position=frozen(candidate.position),
                value=None if decision is None else decision.values[k],
                success=None if outcome is None else outcome.success,
                contact=None if outcome is None else outcome.contact,
                time_s=None if outcome is None else outcome.time_s,
                chosen=decision is not None and decision.index == k,
                reachable=None if decision is None else decision.reachable[k],
                outside=() if decision is None else decision.outside_candidates[k],
            )
        )
    return tuple(snapshots)


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactSnapshot(ReadModel):
    """The contact that ended an episode."""

    kind: str
    """human, cell or self"""
    link: str
    """capsule of the robot in contact"""
    body: str
    """touched part: a capsule of a person, `walker`, `table`, `obstacle`, or for `self` another
    capsule of the robot"""
    person: int | None = None
    """id of the touched person"""


@dataclass(frozen=True, slots=True, kw_only=True)
class AnthropometrySnapshot(ReadModel):
    """Body dimensions of a person, present or reached within half a second."""

    stature: float
    """percentile requested last"""
    arms: float
    """percentile of the arm length requested last, at that stature"""
    shoulders: float
    """percentile of the shoulder width requested last, at that stature"""
    recorded: bool
    """whether the lengths of a recorded person replace the percentiles"""
    stature_m: float
    """height, standing upright [m]"""
    trunk_m: float
    """pelvis to the base of the neck [m]"""
    arm_m: float
    """shoulder to palm, mean of both arms [m]"""
    shoulders_m: float
    """distance of the shoulder joints [m]"""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaybackSnapshot(ReadModel):
    """A recording that is being played."""

    name: str
    """name of the stored recording"""
    run: int
    """index of the run"""
    n_runs: int
    """number of its clean runs"""
    t_s: float
    """elapsed time of the run [s]"""
    duration_s: float
    """duration of the run [s]"""
    outside_share: float
    """share of frames with the pelvis outside the walking area"""
    clipped_share: float
    """share of frames with an angle beyond a joint limit; policies observe the limit"""
    clipped_m: float
    """maximum error of an observed wrist position by that [m]"""


@dataclass(frozen=True, slots=True, kw_only=True)
class CylinderSnapshot(ReadModel):
    """A person known only as an upright cylinder."""

    x: float
    """axis [m]"""
    y: float
    """axis [m]"""
    vx: float
    """velocity in the next period [m/s]"""
    vy: float
    """velocity in the next period [m/s]"""
    radius: float
    """radius [m]"""
    height: float
    """height above the floor [m]"""


@dataclass(frozen=True, slots=True, kw_only=True)
class PersonSnapshot(ReadModel):
    """One person in a live cell."""

    id: int
    """number of the person, constant; the first is 0"""
    mode: Mode
    """motion source"""
    q: Numbers
    """observed joint positions, inside the joint limits [m, rad], shape (18,), in the order of
    `human.JOINT_NAMES`"""
    posture: Internal
    """joint positions [m, rad], shape (18,); recordings exceed the limits"""
    qd: Numbers
    """joint speeds [m/s, rad/s], shape (18,)"""
    size: Numbers
    """body lengths at this moment [m], shape (12,)"""
    anthropometry: AnthropometrySnapshot
    """body dimensions"""
    motion: PlaybackSnapshot | None
    """recording in mode `recorded`"""
    joining: bool
    """whether the person moves to the start of work, recording or rest"""
    outside_area: bool
    """whether the pelvis is outside the walking area"""
    clearance_m: float
    """distance to the robot [m]"""
    nearest: bool
    """whether this is the person nearest to the robot"""
    cylinder: CylinderSnapshot | None = None
    """collision geometry in a reach cell; posture and size are only drawn there"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Counters(ReadModel):
    """Events since the last reset."""

    reached: int = 0
    """targets reached; in a pick cell objects lifted or set down"""
    broken_off: int = 0
    """picks broken off during the descent"""
    contacts: int = 0
    """contacts of the moving robot; each ends an episode"""
    contacts_at_rest: int = 0
    """contacts of a person with the robot at standstill, which waits"""
    timeouts: int = 0
    """episodes that reached the time limit"""
    switches: int = 0
    """target switches within an episode"""


@dataclass(frozen=True, slots=True, kw_only=True)
class RefusedCommand(ReadModel):
    """A command that was valid when queued and refused when applied."""

    number: int
    """number of the command"""
    reason: str
    """error message"""


@dataclass(frozen=True, slots=True, kw_only=True)
class WorldSnapshot(ReadModel):
    """One live world at one tick."""

    id: str
    """name of the world in URLs"""
    cell: str
    """name of the work cell"""
    tick: int
    """control periods since the start; never decreases"""
    t_s: float
    """simulated time since the last reset [s]"""
    mode: Mode | None
    """motion source of the first person; null without people"""
    people: tuple[PersonSnapshot, ...]
    """0 to 4 people, in the order of their ids"""
    paused: bool
    """whether the clock is stopped"""
    speed: int = 1
    """simulated seconds per second, as requested last"""
    commands: int = 0
    """number of the last command that was applied or refused, from 1"""
    refused: Annotated[tuple[RefusedCommand, ...], Field(max_length=MAX_REFUSED)] = ()
    """newest commands that were refused after they had been queued, oldest first"""
    status: Status
    """activity of the robot"""
    message: str
    """the reason, in one sentence"""
    gripping: bool = False
    """whether the fingers are closed"""
    selected: tuple[str, ...] = ()
    """selected stations; those reached this round are missing in `candidates`"""
    candidates: tuple[CandidateSnapshot, ...]
    """stations that the robot can choose, in the order of the cell"""
    chosen: str | None
    """id of the chosen candidate"""
    outside: tuple[OutOfRangeValue, ...]
    """inputs of the state outside the training range"""
    decided_s: float | None = None
    """time of the last decision, as `t_s` [s]; null without one"""
    clearance_m: float | None
    """separation distance of robot and people [m]; 0 or less: contact; null without people"""
    contact: ContactSnapshot | None
    """contact that is shown at present"""
    checkpoint: str | None
    """SHA-256 of the active checkpoint"""
    policy_title: str | None
    """title of the active policy"""
    observed_people: int | None
    """greatest number of people that the policy observes at once; null without one"""
    elapsed_ms: float | None
    """duration of the decision [ms]"""
    case: str | None = None
    """id of the running case study"""
    verdict: Verdict | None = None
    """expectation and outcome of the running case study or sorting test"""
    counters: Counters
    """events since the last reset"""
    safety: SafetySnapshot
    """safety layer and its decision for the present state"""
    sorting: SortingSnapshot | None = None
    """sorting task; null in other cells"""
    reach: ReachSnapshot | None = None
    """goal and outcomes of a reach cell; null in other cells"""
    robot_q: Internal
    """joint positions of the robot [rad], shape (6,)"""
    robot_qd: Internal
    """joint speeds of the robot [rad/s], shape (6,)"""
    previous: str | None
    """choice one tick earlier, as observed by the policy"""
    time_left_s: float
    """time left in the episode [s], as observed by the policy; in a reach cell it observes at
    most 5 s"""
    phase: PickPhase = "approach"
    """phase of the pick, as observed by the policy"""
    closing_s: float = 0.0
    """time for which the gripper has been closing, as observed by the policy [s]"""
    tcp: Numbers
    """tool centre point, robot base frame [m]"""

    @property
    def values(self) -> dict[str, float]:
        """Value estimate per candidate id."""
        return {c.id: c.value for c in self.candidates if c.value is not None}
