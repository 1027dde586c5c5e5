"""The four case studies of task selection (docs/method.md 3.6, thesis table 5.3).

The layout of the cell was chosen so that the geometry of each case agrees with its text; tests
measure it.
"""

from dataclasses import dataclass

import numpy as np

from app.errors import NotFound
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.human.model import Hand
from app.sim.people.reach_script import ReachScript, reach_script

CASES_CELL = "pick-and-place"
"""The cell whose layout the cases were chosen for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One case study."""

    id: str
    """Name in requests."""
    title: str
    """Title for display."""
    text: str
    """Course of events and expected behaviour, in one sentence."""
    robot_start: str
    """Station the robot starts from."""
    goals: tuple[str, str]
    """Stations to choose from."""
    hand: Hand
    """The person's working hand."""
    human_from: str
    """Station at which the palm starts."""
    human_to: str | None
    """Station to which the palm moves; None if it stays."""
    expected: str
    """Goal at which the robot should end."""
    first: str | None = None
    """Goal that should be selected at first; None for any."""
    switches: tuple[int, int | None] = (0, None)
    """Least and largest number of target switches; None for no limit."""
    palm_offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Palm relative to its stations [m]."""
    delay_s: float = 0.4
    """Rest of the person before the move [s]."""


CASES = (
    Case(
        id="case-1",
        title="Nearer, unobstructed",
        text=(
            "A hand rests beside Cube 4; both cubes can be reached, and the robot should take "
            "Cube 4 from the start: it is nearer, and the path does not cross the person."
        ),
        robot_start="cube5",
        goals=("cube0", "cube4"),
        hand="r",
        human_from="cube4",
        human_to=None,
        expected="cube4",
        first="cube4",
        switches=(0, 0),
        palm_offset=(-0.1, 0.4, 0.02),
    ),
    Case(
        id="case-2",
        title="Farther, clear of the hand",
        text=(
            "The right hand stays on Cube 2, the nearer goal; the robot should end at Cube 0, "
            "the farther and free one."
        ),
        robot_start="cube3",
        goals=("cube0", "cube2"),
        hand="r",
        human_from="cube2",
        human_to=None,
        expected="cube0",
    ),
    Case(
        id="case-3",
        title="Blocked for a while",
        text=(
            "The left arm moves from Cube 4 to Dock 1 across Cube 3, the nearer goal; the "
            "robot should switch while Cube 3 is blocked, and end there."
        ),
        robot_start="cube5",
        goals=("cube1", "cube3"),
        hand="l",
        human_from="cube4",
        human_to="dock1",
        expected="cube3",
        switches=(1, None),
        delay_s=0.8,
    ),
    Case(
        id="case-4",
        title="Single switch, no oscillation",
        text=(
            "The left arm moves from Cube 0 to Cube 4, the nearer goal; the robot should "
            "start for Cube 4, switch to Cube 1 and stay with it."
        ),
        robot_start="cube5",
        goals=("cube1", "cube4"),
        hand="l",
        human_from="cube0",
        human_to="cube4",
        expected="cube1",
        first="cube4",
        switches=(1, 1),
        palm_offset=(0.05, 0.05, 0.0),
    ),
)


def find_case(name: str) -> Case:
    """Return a case study by id.

    Raises:
        NotFound: There is no such case.
    """
    for case in CASES:
        if case.id == name:
            return case
    raise NotFound("case study", name, tuple(case.id for case in CASES))


def cases_of(cell: Cell) -> tuple[Case, ...]:
    """Return the case studies that can be started in a cell."""
    return CASES if cell.name == CASES_CELL else ()


def palms_of(cell: Cell, case: Case) -> Vec:
    """Return the palm of the working hand at the start and at the end [m], shape (2, 3)."""
    places = [case.human_from, case.human_to or case.human_from]
    return np.array([np.add(cell.station(one).position, case.palm_offset) for one in places])


def script_of(cell: Cell, case: Case) -> ReachScript:
    """Return the person's movement in a case study."""
    first, last = palms_of(cell, case)
    return reach_script(cell, case.hand, (first, last), case.delay_s)
