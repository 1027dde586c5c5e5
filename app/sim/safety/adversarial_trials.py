"""Trials of the safety layer: many episodes of people who run at a robot that does as it likes.

``safety/kernels/adversarial_trials.py`` says who runs how, and why nobody is faster than a
trial allows.
Inside the layer's assumptions no contact may find a link in motion; outside them the rate is
measured.
"""

from dataclasses import dataclass, field
from math import ceil

import numpy as np

from app.errors import InvalidInput
from app.sim.cells.cell import Cell, load_cell
from app.sim.core.arrays import Vec
from app.sim.people.human_motion_config import REACHING
from app.sim.people.kernels.people import new_crowd
from app.sim.robot.actions import ActionSettings
from app.sim.safety.kernels import adversarial_trials as safety_trial
from app.sim.safety.kernels import separation_check as watch
from app.sim.safety.kernels.adversarial_people import Trial, new_trial_work
from app.sim.safety.kernels.adversarial_trials import (
    ALLOWED,
    CONTACT,
    MODE,
    MOVING,
    N_RESULT,
    POLICY,
    SLOWED,
    SPEED,
    STEPS,
    STOPPED,
    WORST_PEOPLE,
)
from app.sim.safety.layer import SafetySettings, separation_rule
from app.sim.scene.scene import HumanKind, arm_of, new_people_state, people_of, with_people

POLICIES = ("smooth", "constant", "goals", "bang-bang")
MODES = ("script", "straight", "zig-zag", "tease")


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialSettings:
    """One trial: what is assumed, and what is true."""

    safety: SafetySettings
    """What the layer assumes."""
    cell: str = "pick-and-place"
    """Name of a shipped cell."""
    people: tuple[HumanKind, ...] = ("worker",)
    """Who is in it."""
    human_speed: float = 1.6
    """Greatest true speed of any point of the people [m/s]."""
    true_delay: float = 0.0
    """How late people are truly seen [s]; rounded up to periods."""
    seconds: float = 4.0
    """Longest episode [s]."""
    guarded: bool = True
    """Whether the layer acts."""
    action: ActionSettings = field(default_factory=ActionSettings)
    """What the policies' actions mean."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialResult:
    """What happened; sums and rows of episodes."""

    rows: Vec
    """One row per episode; see ``safety/kernels/adversarial_trials.py``."""
    dt: float
    """Control period [s]."""

    @property
    def n(self) -> int:
        """Episodes."""
        return len(self.rows)

    @property
    def n_steps(self) -> int:
        """Control periods of all episodes."""
        return int(self.rows[:, STEPS].sum())

    @property
    def n_contacts(self) -> int:
        """Episodes that ended in contact."""
        return int(self.rows[:, CONTACT].sum())

    @property
    def n_moving(self) -> int:
        """Contacts with a link faster than 1 mm/s, or than the touched part allows."""
        return int((self.rows[:, SPEED] > MOVING + self.rows[:, ALLOWED]).sum())

    @property
    def fastest_link(self) -> float:
        """Greatest speed of a touching link [m/s]."""
        return float(self.rows[:, SPEED].max())

    @property
    def fastest_person(self) -> float:
        """Greatest speed of any point of the people [m/s]."""
        return float(self.rows[:, WORST_PEOPLE].max())

    @property
    def stopped_share(self) -> float:
        """Share of all periods in which the robot stood or braked to stand."""
        return float(self.rows[:, STOPPED].sum() / self.rows[:, STEPS].sum())

    @property
    def slowed_share(self) -> float:
        """Share of all periods in which the override was below 1, stops included."""
        return float(self.rows[:, SLOWED].sum() / self.rows[:, STEPS].sum())

    def of(self, policy: str | None = None, mode: str | None = None) -> "TrialResult":
        """Return the episodes of one policy, or of people who do one thing."""
        kept = np.ones(self.n, dtype=bool)
        if policy is not None:
            kept &= self.rows[:, POLICY] == POLICIES.index(policy)
        if mode is not None:
            kept &= self.rows[:, MODE] == MODES.index(mode)
        return TrialResult(rows=self.rows[kept], dt=self.dt)


def _cell_of(settings: TrialSettings) -> Cell:
    return with_people(load_cell(settings.cell), settings.people)


def run_trial(
    settings: TrialSettings, n_episodes: int, seed: int, first: int = 0
) -> TrialResult:
    """Run a trial's episodes.

    Args:
        settings: What is assumed and what is true.
        n_episodes: Number of episodes.
        seed: Seed; episode ``k`` is fixed by (seed, k).
        first: Number of the first episode.

    Raises:
        InvalidInput: There are no episodes, or nobody is there.
    """
    if n_episodes < 1:
        raise InvalidInput("episodes", n_episodes, "must be at least 1")
    if not settings.people:
        raise InvalidInput("people", [], "must name at least one person")
    cell = _cell_of(settings)
    arm, people = arm_of(cell), people_of(cell, REACHING)
    state = new_people_state(cell, people, 1)
    crowd = new_crowd(people, len(cell.workers), len(cell.cylinders))
    n_late = ceil(settings.true_delay / arm.dt - 1e-9)
    shape = (people.columns.shape[1], len(cell.cylinders))
    watches = (watch.new_ssm_workspace(arm, *shape), watch.new_ssm_workspace(arm, *shape))
    work = new_trial_work(arm, people, state, crowd, watches, n_late)
    rows = np.zeros((n_episodes, N_RESULT))
    trial = Trial(
        human_speed=settings.human_speed,
        n_late=n_late,
        n_steps=round(settings.seconds / arm.dt),
        guarded=settings.guarded,
    )
    safety = separation_rule(settings.safety, *shape, known=False)
    safety_trial.run_episodes(
        arm, people, safety, trial, settings.action.rule(), seed, first, work, rows
    )
    return TrialResult(rows=rows, dt=arm.dt)
