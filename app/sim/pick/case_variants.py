"""Variants of the four case studies, enumerated by a rule without a policy.

A variant has another start of the robot, goals, hand or stations of the palm than its case, and
agrees with the description of the case in the numbers below. All such combinations in the cell
are variants; the case itself is none. They are evaluated by protocol ``pick-case-variants``.

Case 1: the resting palm is beside the nearer goal, both goals are free, and so is the robot's
path to the nearer one. Case 2: the resting hand blocks the nearer goal; the farther one and a
path to it are free. Case 3: the nearer goal is free, blocked before it can be picked, and free
at the end, and blocked when the robot can arrive; the farther one is free when that begins.
Case 4: the nearer goal is free, and blocked from before it can be picked to the end; the
farther one is free at the end and was blocked for at most ``MOMENT_S``.

In case 3 itself the farther goal is not free at the end. Variants with the same property are
counted by themselves, too: in the others the robot can also end at the goal it switched to.

Source: ours; the cases are those of docs/method.md 3.6.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations, product
from types import MappingProxyType

import numpy as np

from app.sim.cells.cell import Cell
from app.sim.human.model import HANDS
from app.sim.pick.case_geometry import (
    BLOCKED_BELOW,
    CaseGeometry,
    case_geometry,
    person_geometry,
)
from app.sim.pick.cases import Case

NEARER_BY = 0.15
"""Least difference of the tool's paths to the two goals [m]; cubes are 0.2 m apart."""
FREE_FROM = 0.10
"""Clearance from which a goal is free [m]: 0.06 m of a grasp, and room for jittered starts.
Below ``BLOCKED_BELOW`` it is blocked, between both it is neither."""
MARGIN = 0.05
"""Least clearance of the robot that stays at its start, and on paths [m]: that of evaluations.
At first the start is free."""
BESIDE = 0.45
"""Largest distance of a palm from the target that it is beside [m]."""
PALM_ERROR = 0.01
"""Largest distance of a palm from where the case puts it [m]: that of inverse kinematics."""
MOMENT_S = 0.25
"""Longest time for which the farther goal of case 4 is blocked [s]."""
DEFINITION: Mapping[str, float] = MappingProxyType(
    {
        "blocked below [m]": BLOCKED_BELOW,
        "free from [m]": FREE_FROM,
        "nearer by [m]": NEARER_BY,
        "clearance of paths [m]": MARGIN,
        "beside within [m]": BESIDE,
        "palm within [m]": PALM_ERROR,
        "blocked for a moment within [s]": MOMENT_S,
    }
)
"""Numbers of the descriptions."""
FIRST, LAST = 0, -1
"""Indices of the first and the last posture of the person."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseDescription:
    """A case study without its stations."""

    text: str
    """Course of events and expected behaviour, in one sentence."""
    moves: bool
    """Whether the person moves."""
    to_nearer: bool
    """Whether the robot should end at the nearer goal."""
    holds: Callable[[CaseGeometry], bool]
    """Returns whether stations agree with the description."""


def _free(shown: CaseGeometry, goal: str, when: int | slice = slice(None)) -> bool:
    """Return whether a goal is free at one time or at all."""
    return bool(np.all(shown.person.goal_m[goal][when] >= FREE_FROM))


def _nearer_and_beside(shown: CaseGeometry) -> bool:
    away = np.linalg.norm(shown.person.palms[FIRST] - shown.stations.position[shown.nearer])
    return (
        bool(away <= BESIDE)
        and _free(shown, shown.nearer)
        and _free(shown, shown.farther)
        and shown.path_free(shown.nearer, FIRST, MARGIN)
    )


def _nearer_under_hand(shown: CaseGeometry) -> bool:
    first, last = _nearer_blocked(shown)
    return (
        first == 0.0
        and last == shown.person.times[LAST]
        and _free(shown, shown.farther)
        and shown.path_free(shown.farther, FIRST, MARGIN, around=True)
    )


def _nearer_for_a_while(shown: CaseGeometry) -> bool:
    first, last = _nearer_blocked(shown)
    when = int(np.searchsorted(shown.person.times, first))
    return (
        _free(shown, shown.nearer, FIRST)
        and first < shown.earliest_pick_s(shown.nearer)
        and last >= shown.arrival_s(shown.nearer)
        and _free(shown, shown.nearer, LAST)
        and _free(shown, shown.farther, when)
        and shown.path_free(shown.nearer, FIRST, MARGIN, around=True)
        and shown.path_free(shown.nearer, LAST, MARGIN, around=True)
    )


def _nearer_for_good(shown: CaseGeometry) -> bool:
    (first, last), times = _nearer_blocked(shown), shown.person.times
    after = shown.person.goal_m[shown.nearer][times >= first]
    start, end = shown.blocked_s(shown.farther) or (0.0, 0.0)
    return (
        _free(shown, shown.nearer, FIRST)
        and first < shown.earliest_pick_s(shown.nearer)
        and last == times[LAST]
        and bool((after < BLOCKED_BELOW).all())
        and _free(shown, shown.farther, LAST)
        and end - start <= MOMENT_S
        and shown.path_free(shown.nearer, FIRST, MARGIN)
        and shown.path_free(shown.farther, LAST, MARGIN, around=True)
    )


def _nearer_blocked(shown: CaseGeometry) -> tuple[float, float]:
    """Return the first and the last time of the nearer goal's block [s]; inf for never."""
    return shown.blocked_s(shown.nearer) or (np.inf, np.inf)


DESCRIPTIONS: Mapping[str, CaseDescription] = {
    "case-1": CaseDescription(
        text=(
            "A hand rests beside the nearer goal; both can be reached, and the robot should "
            "take the nearer from the start: the path does not cross the person."
        ),
        moves=False,
        to_nearer=True,
        holds=_nearer_and_beside,
    ),
    "case-2": CaseDescription(
        text=(
            "A hand stays on the nearer goal; the robot should end at the farther and free one."
        ),
        moves=False,
        to_nearer=False,
        holds=_nearer_under_hand,
    ),
    "case-3": CaseDescription(
        text=(
            "An arm moves across the nearer goal; the robot should switch while that is "
            "blocked, and end there."
        ),
        moves=True,
        to_nearer=True,
        holds=_nearer_for_a_while,
    ),
    "case-4": CaseDescription(
        text=(
            "An arm moves to the nearer goal; the robot should start for it, switch to the "
            "farther one and stay with it."
        ),
        moves=True,
        to_nearer=False,
        holds=_nearer_for_good,
    ),
}
"""Descriptions by case."""


def agrees(case: str, shown: CaseGeometry) -> bool:
    """Return whether stations agree with the description of a case, named by its id."""
    start = shown.person.start_m[shown.start]
    between = shown.tool_path_m(shown.farther) - shown.tool_path_m(shown.nearer)
    return (
        shown.person.palm_error_m <= PALM_ERROR
        and between >= NEARER_BY
        and bool(start[FIRST] >= FREE_FROM and start.min() >= MARGIN)
        and DESCRIPTIONS[case].holds(shown)
    )


@lru_cache(maxsize=8)
def variants_of(cell: Cell, case: Case) -> tuple[Case, ...]:
    """Return all variants of a case study in a cell, without the case itself."""
    described = DESCRIPTIONS[case.id]
    found = []
    for moved in _people(cell, case):
        person = person_geometry(cell, moved)
        if person.palm_error_m > PALM_ERROR:
            continue
        for candidate in _robots(cell, moved):
            shown = case_geometry(cell, candidate, person)
            if agrees(case.id, shown) and _id_of(candidate) != _id_of(case):
                expected = shown.nearer if described.to_nearer else shown.farther
                found.append(
                    replace(
                        candidate,
                        id=_id_of(candidate),
                        text=described.text,
                        expected=expected,
                        first=case.first and shown.nearer,
                    )
                )
    return tuple(found)


def other_goal_free_at_end(cell: Cell, case: Case) -> bool:
    """Return whether the goal at which the robot should not end is free at the end."""
    (other,) = {*case.goals} - {case.expected}
    return _free(case_geometry(cell, case), other, LAST)


def _people(cell: Cell, case: Case) -> Iterator[Case]:
    """Yield the case with each hand and each station of the palm, or two."""
    places = [station.id for station in cell.pick_stations]
    for hand, start, end in product(HANDS, places, places):
        if DESCRIPTIONS[case.id].moves == (start != end):
            yield replace(
                case, hand=hand, human_from=start, human_to=end if start != end else None
            )


def _robots(cell: Cell, case: Case) -> Iterator[Case]:
    """Yield the case with each start of the robot and each pair of cubes."""
    cubes = [station.id for station in cell.stations_of("cube")]
    for station, goals in product(cell.pick_stations, combinations(cubes, 2)):
        if station.id not in goals:
            yield replace(case, robot_start=station.id, goals=goals)


def _id_of(case: Case) -> str:
    """Return the name of a variant: case, start, goals, hand, stations of the palm."""
    parts = [case.id, case.robot_start, *case.goals, case.hand, case.human_from]
    return "-".join([*parts, case.human_to] if case.human_to else parts)
