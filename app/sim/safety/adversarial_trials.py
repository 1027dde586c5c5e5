"""Falsification trials of the safety layer: many episodes with adversarial people.

The robot follows arbitrary policies; people run toward it, at most at the speed of the trial
(``safety/kernels/adversarial_trials.py``). Inside the layer's assumptions no contact may find a
link in motion; outside them the rate of such contacts is measured.
"""

from dataclasses import dataclass, field
from math import ceil

import numpy as np

from app.errors import InvalidInput
from app.sim.cells.cell import load_cell
from app.sim.core.arrays import Vec
from app.sim.people.human_motion_config import REACHING
from app.sim.people.kernels.people import new_people_geometry
from app.sim.robot.actions import ActionSettings
from app.sim.safety.kernels import adversarial_trials as safety_trial
from app.sim.safety.kernels.adversarial_people import Trial, new_trial_work
from app.sim.safety.kernels.adversarial_trials import (
    ALLOWED,
    CONTACT,
    MOVING,
    N_RESULT,
    SLOWED,
    SPEED,
    STEPS,
    STOPPED,
    WORST_PEOPLE,
)
from app.sim.safety.kernels.separation_check import new_ssm_workspace
from app.sim.safety.layer import SafetySettings, separation_rule
from app.sim.scene.scene import HumanKind, arm_of, new_people_state, people_of, with_people


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialSettings:
    """One trial: assumptions of the layer and true conditions."""

    safety: SafetySettings
    """Assumptions of the layer."""
    cell: str = "pick-and-place"
    """Name of a shipped cell."""
    people: tuple[HumanKind, ...] = ("worker",)
    """People in it."""
    human_speed: float = 1.6
    """Greatest true speed of any point of the people [m/s]."""
    true_delay: float = 0.0
    """True delay of observations of people [s]; rounded up to periods."""
    seconds: float = 4.0
    """Longest episode [s]."""
    monitored: bool = True
    """Whether the safety layer acts."""
    action: ActionSettings = field(default_factory=ActionSettings)
    """Interpretation of the policies' actions."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialResult:
    """Results of a trial; sums and rows of episodes."""

    rows: Vec
    """One row per episode; see ``safety/kernels/adversarial_trials.py``."""

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
        """Share of all periods in which the robot was stopped."""
        return float(self.rows[:, STOPPED].sum() / self.rows[:, STEPS].sum())

    @property
    def slowed_share(self) -> float:
        """Share of all periods in which the override was below 1, stops included."""
        return float(self.rows[:, SLOWED].sum() / self.rows[:, STEPS].sum())


def run_trial(
    settings: TrialSettings, n_episodes: int, seed: int, first: int = 0
) -> TrialResult:
    """Run a trial's episodes.

    Args:
        settings: Assumptions and true conditions.
        seed: Seed; episode ``k`` is fixed by (seed, k).

    Raises:
        InvalidInput: The number of episodes or of people is 0, or the layer uses measured
            velocities, which the people of a trial do not have.
    """
    if n_episodes < 1:
        raise InvalidInput("episodes", n_episodes, "must be at least 1")
    if not settings.people:
        raise InvalidInput("people", [], "must name at least one person")
    if settings.safety.use_measured_velocity:
        raise InvalidInput("safety.use_measured_velocity", True, "must be false in a trial")
    cell = with_people(load_cell(settings.cell), settings.people)
    arm, people = arm_of(cell), people_of(cell, REACHING)
    state = new_people_state(cell, people, 1)
    geometry = new_people_geometry(people, len(cell.workers), len(cell.cylinders))
    n_late = ceil(settings.true_delay / arm.dt - 1e-9)
    shape = (people.capsules.shape[1], len(cell.cylinders))
    spaces = new_ssm_workspace(arm, *shape), new_ssm_workspace(arm, *shape)
    work = new_trial_work(arm, people, state, geometry, spaces, n_late)
    rows = np.zeros((n_episodes, N_RESULT))
    trial = Trial(
        human_speed=settings.human_speed,
        n_late=n_late,
        n_steps=round(settings.seconds / arm.dt),
        monitored=settings.monitored,
        rule=separation_rule(settings.safety, *shape, known=False),
        action=settings.action.rule(),
    )
    safety_trial.run_episodes(arm, people, trial, seed, first, work, rows)
    return TrialResult(rows=rows)
