"""What the rooms of the house hand each other: the Protocols and their data.

``app.policies`` implements :class:`TaskPolicy`, :class:`ReachActor` and
:class:`SortingValues`, ``web`` implements :class:`WorldHandle`; the other side sees only what
is written here (numpy in, numpy out).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # the kernels need Vec first
    from app.sim.actions import ActionSettings
    from app.sim.reach import GoalRule, ViewName
    from app.sim.sorting_state import SortingShape

Vec = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Person:
    """One person in the cell, as the 18-DoF model of METHOD 3.4."""

    q: Vec
    """Joint positions [m, rad], shape (18,), order of ``human.JOINT_NAMES``."""
    qd: Vec
    """Joint speeds [m/s, rad/s], shape (18,)."""
    size: Vec | None = None
    """Lengths of the body [m], shape (12,) (``BodySize.vector``); None: the cell's person."""
    cylinder: Vec | None = None
    """x, y and radius [m], shape (3,), of the cylinder that is all that is known of this person
    (``seen_people.standing_in``); then distances count to it. None: a body of 18 joints."""
    top: float | None = None
    """Height of the top of that cylinder [m], as safety layers take it; None: as high as the
    cell's people, or 2 m over the floor."""
    growth: float = 0.0
    """How fast the radius of that cylinder grows [m/s]; 0 where nothing is known of it."""
    past: Vec | None = None
    """Radius [m] and walking speed [m/s] of that cylinder 0.1 s, 0.2 s, ... ago, shape (n, 2),
    n at most ``occupancy.N_PAST - 1``; None where nothing is remembered."""
    measured: bool = False
    """Whether a safety layer may go by the velocity of that cylinder: it was measured, and is
    not 0 for want of knowing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """One geometric task the robot may choose: bring the tool to ``position``."""

    id: str
    """Name given by the caller, unique among the candidates."""
    position: Vec
    """Point the tcp must reach, robot base frame [m], shape (3,)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OutsideField:
    """One input outside what the checkpoint was trained on, or a joint outside its limits."""

    field: str
    """Name of the input, such as ``"people[0].q.pelvis_y"``."""
    value: float
    """Its value, in the input's unit."""
    low: float
    """Least value met in training, or lower limit of the joint."""
    high: float
    """Greatest value met in training, or upper limit of the joint."""
    of: Literal["training", "limits"] = "training"
    """What ``low`` and ``high`` are: the range met in training, or the joint's limits."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """The critic's choice among candidates, with all that explains it (METHOD 3.1)."""

    chosen: str
    """Id of the chosen candidate."""
    index: int
    """Its place in the list of candidates."""
    values: tuple[float, ...]
    """``Q(s_i, pi(s_i))`` of every candidate, discounted reward."""
    actions: NDArray[np.float32]
    """The policy's action for every candidate in [-1, 1], shape (n, 5)."""
    qd_target: Vec
    """The joint speeds these actions ask for [rad/s], shape (n, 6)."""
    reachable: tuple[bool, ...]
    """Whether inverse kinematics finds a vertical-tool posture at each candidate."""
    outside: tuple[OutsideField, ...]
    """Fields of the state outside the joints' limits or the training range."""
    outside_candidates: tuple[tuple[OutsideField, ...], ...]
    """The same for each candidate's position."""
    checkpoint: str
    """SHA-256 of the checkpoint that decided."""
    elapsed_ms: float
    """Time the decision took [ms]."""
    seen: int | None = None
    """Which of the people a policy for one person saw: the nearest; None for nobody."""


class TaskPolicy(Protocol):
    """Chooses among candidates and says how to move; safe to call from several threads."""

    @property
    def checkpoint(self) -> str:
        """SHA-256 of the checkpoint."""

    @property
    def action(self) -> "ActionSettings":
        """What its actions mean."""

    @property
    def title(self) -> str:
        """Short text for people, such as ``"pick-td3, 2.0 M steps"``."""

    @property
    def cell(self) -> str:
        """Name of the work cell it was trained for."""

    @property
    def cell_sha256(self) -> str:
        """Identity of that cell's content (``Cell.sha256``)."""

    def decide(
        self,
        q: Vec,
        qd: Vec,
        people: Sequence[Person],
        candidates: Sequence[Candidate],
        *,
        previous: str | None = None,
        time_left_s: float = 10.0,
    ) -> Decision:
        """Choose one candidate.

        Args:
            q: Robot joint positions [rad], shape (6,).
            qd: Robot joint speeds [rad/s], shape (6,).
            people: The people in the cell, at most four. A policy that knows one person sees
                the one nearest to the robot.
            candidates: What may be chosen, at least one.
            previous: The candidate chosen last, for hysteresis; None chooses afresh.
            time_left_s: Time left to reach a candidate [s].

        Raises:
            InvalidInput: A value that no answer can be given for.
        """


class ReachKnown(Protocol):
    """What is known of a policy that brings the tcp to a goal beside people."""

    @property
    def checkpoint(self) -> str:
        """SHA-256 of the checkpoint."""

    @property
    def title(self) -> str:
        """Short text for people, such as ``"reach-td3, 7.7 M steps"``."""

    @property
    def cell(self) -> str:
        """Name of the work cell it was trained for."""

    @property
    def cell_sha256(self) -> str:
        """Identity of that cell's content (``Cell.sha256``)."""

    @property
    def view(self) -> "ViewName":
        """What it sees."""

    @property
    def action(self) -> "ActionSettings":
        """What its actions mean."""

    @property
    def goals(self) -> "GoalRule":
        """Where the goals of its training were drawn from."""

    @property
    def targets(self) -> Vec | None:
        """The goals it was trained on [m], shape (n, 3); None for a whole box."""


class ReachActor(ReachKnown, Protocol):
    """Brings the tcp to a goal beside people; safe to call from several threads."""

    @property
    def trained_range(self) -> Mapping[str, Mapping[str, Sequence[float]]]:
        """Least (``low``) and greatest (``high``) value of each state variable in training."""

    def acts(self, obs: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return actions in [-1, 1].

        Args:
            obs: Observations of :attr:`view`, as ``ReachBatch`` gives them, shape (n, F).

        Returns:
            Actions, shape (n, 6).
        """


class SortingValues(Protocol):
    """A learned policy as its values of all moves; safe to call from several threads.

    It was trained on goals that have each tower of its own colour, the largest at the bottom.
    """

    @property
    def checkpoint(self) -> str:
        """SHA-256 of the checkpoint."""

    @property
    def title(self) -> str:
        """Short text for people, such as ``"sorting-e0-dqn, 2.0 M steps"``."""

    @property
    def cell(self) -> str:
        """Name of the work cell it was trained for."""

    @property
    def cell_sha256(self) -> str:
        """Identity of that cell's content (``Cell.sha256``)."""

    @property
    def shape(self) -> "SortingShape":
        """The tasks it knows."""

    def values(self, obs: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Return Q of every move, valid or not.

        Args:
            obs: States as ``sorting.observe`` gives them, shape (n, obs_size).

        Returns:
            Expected discounted rewards, shape (n, n_actions).
        """


class WorldHandle(Protocol):
    """One live world, seen from other threads: commands in, immutable snapshots out."""

    @property
    def id(self) -> str:
        """Name of the world in URLs."""

    def submit(self, command: Any) -> int:
        """Queue one command of ``app.sim.commands``; returns its number at once."""

    def snapshot(self) -> Any:
        """Return the last ``WorldSnapshot``; never waits."""
