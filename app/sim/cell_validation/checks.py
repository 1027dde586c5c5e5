"""Validation of a work cell whose fields have the right types.

:func:`check_cell` checks numbers (range, unit), order, overlap and reach, and returns all
faults, each with place, value, rule and a hint. Checks that depend on an invalid number are
skipped, so that one mistake gives one fault.
"""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from app.errors import Fault, digits, interval
from app.sim.cell_validation.places import FaultlessParts, places
from app.sim.cell_validation.reachability import ContactPair, Reach
from app.sim.cell_validation.units import fault, numbers, shown
from app.sim.cells.cell import LIMITS, MAX_TARGETS, Cell
from app.sim.cells.parts import GoalRegion, RobotMount, Station
from app.sim.cells.people import Worker
from app.sim.collision.fcl_reference import obstacle_box, touch
from app.sim.core.pick_depth import PICK_DEPTH_M
from app.sim.robot.capsules import MOST_ELBOW

MIN_SPACING = 0.05
"""Least distance of two stations [m]; a cluster counts from its lowest to its top level."""
MAX_OVERLAP = 0.01
"""Largest overlap of two obstacles [m], so that boxes can be joined."""
MAX_MISSED = 12
"""Number of grid targets without a configuration after which the search ends: it is slow."""
FIELDS_OF_KIND = {
    "cube": (),
    "dock": (),
    "clutter": ("failure_probability",),
    "cluster": ("colour", "levels", "level_height"),
}
"""Fields that a station of a kind must have and others must not."""


def check_cell(cell: Cell, known: Sequence[Fault] = ()) -> list[Fault]:
    """Return all faults of a cell.

    Args:
        known: Faults found while reading; checks that depend on these values are skipped.
    """
    faults = [*_counts(cell, known), *_ids(cell), *numbers(cell)]
    parts = FaultlessParts(cell, [*known, *faults])
    faults += [*_kinds(cell), *_people(parts)]
    faults += _table(cell) if parts.table else []
    faults += _robot(cell.robot) if parts.robot else []
    faults += _grid(parts.goal_region) if parts.goal_region is not None else []
    parts = FaultlessParts(cell, [*known, *faults])
    faults += [*_overlaps(parts), *places(parts)] if parts.counts_valid else []
    parts = FaultlessParts(cell, [*known, *faults])
    if parts.robot and parts.counts_valid:
        faults += _reach(parts)
    return faults


def _counts(cell: Cell, known: Sequence[Fault]) -> Iterator[Fault]:
    for name, most in LIMITS.items():
        n = len(getattr(cell, name))
        if n > most:
            yield fault(name, f"<{n} of them>", f"must be at most {most}")
    if not cell.stations and cell.goal_region is None and not known:
        rule = "must hold at least one station, or the cell a goal_region"
        yield fault("stations", "[]", rule)


def _ids(cell: Cell) -> Iterator[Fault]:
    for group in ("stations", "obstacles"):
        ids = Counter(one.id for one in getattr(cell, group))
        for name, count in ids.items():
            if count > 1:
                rule = f"must be given once, not {count} times"
                yield fault(f"{group}.{name}.id", name, rule)


def _in_order(place: str, low: float, high: float, names: tuple[str, str]) -> Iterator[Fault]:
    if low >= high:
        rule = f"must be less than {names[1]} = {digits(high)}"
        yield fault(f"{place}.{names[0]}", low, rule, "the two may have changed places")


def _table(cell: Cell) -> Iterator[Fault]:
    table = cell.table
    for axis in "xy":
        names = (f"{axis}_min", f"{axis}_max")
        yield from _in_order("table", getattr(table, names[0]), getattr(table, names[1]), names)
    if table.thickness >= table.height:
        rule = f"must be less than the table's height = {digits(table.height)} m"
        yield fault("table.thickness", table.thickness, rule)


def _robot(robot: RobotMount) -> Iterator[Fault]:
    limits = zip(robot.q_min, robot.home_q, robot.q_max, strict=True)
    for joint, (low, home, high) in enumerate(limits):
        yield from _in_order("robot", low, high, (f"q_min[{joint}]", f"q_max[{joint}]"))
        if low < high and not low < home < high:
            rule = f"must lie inside the joint's limits ({digits(low)}, {digits(high)}) rad"
            yield fault(f"robot.home_q[{joint}]", home, rule)
    for name, limit in (("q_min", robot.q_min[2]), ("q_max", robot.q_max[2])):
        if abs(limit) > MOST_ELBOW + 1e-9:
            rule = f"must lie in [-{MOST_ELBOW}, {MOST_ELBOW}] rad"
            hint = "an elbow that bends more folds the arm into itself"
            yield fault(f"robot.{name}[2]", limit, rule, hint)
    if robot.tool_radius > robot.tool_length:
        rule = f"must not exceed tool_length = {digits(robot.tool_length)} m"
        yield fault("robot.tool_radius", robot.tool_radius, rule)


def _kinds(cell: Cell) -> Iterator[Fault]:
    owners = {name: kind for kind, names in FIELDS_OF_KIND.items() for name in names}
    for station in cell.stations:
        for name, owner in owners.items():
            value, place = getattr(station, name), f"stations.{station.id}.{name}"
            if station.kind == owner and value is None:
                rule = f"is missing: a station of kind {owner} needs it"
                yield fault(place, "", rule)
            elif station.kind != owner and value is not None:
                rule = f"belongs to a station of kind {owner}; this one is a {station.kind}"
                yield fault(place, value, rule)
    clusters = cell.stations_of("cluster")
    colours = Counter(station.colour for station in clusters)
    for station in clusters:
        if station.colour is not None and colours[station.colour] > 1:
            rule = "must be that of one cluster only"
            yield fault(f"stations.{station.id}.colour", station.colour, rule)


def _people(parts: FaultlessParts) -> Iterator[Fault]:
    for index, person in parts.people:
        place = f"people[{index}]"
        for name in ("x", "y", "speed", "radius"):
            low, high = (getattr(person, f"{name}_{end}", None) for end in ("min", "max"))
            if low is None or high is None or (name in ("speed", "radius") and low == high):
                continue
            yield from _in_order(place, low, high, (f"{name}_min", f"{name}_max"))
        if not isinstance(person, Worker) or person.x_min >= person.x_max:
            continue
        x, y, _ = person.home
        if person.y_min < person.y_max and not (
            person.x_min <= x <= person.x_max and person.y_min <= y <= person.y_max
        ):
            rule = (
                f"must lie inside the walking area, x in [{digits(person.x_min)}, "
                f"{digits(person.x_max)}] m and y in {interval(person.y_min, person.y_max)} m"
            )
            yield fault(f"{place}.home", person.home, rule)


def _grid(region: GoalRegion) -> Iterator[Fault]:
    if region.spacing <= 0.0:
        return
    for axis, side in enumerate(region.size):
        if abs(side - round(side / region.spacing) * region.spacing) > 1e-6:
            rule = f"must be a multiple of spacing = {digits(region.spacing)} m"
            yield fault(f"goal_region.size[{axis}]", side, rule)
    n = math.prod(round(abs(side) / region.spacing) + 1 for side in region.size)
    if n > MAX_TARGETS:
        rule = f"gives {n} grid targets; at most {MAX_TARGETS} are taken"
        yield fault("goal_region.spacing", region.spacing, rule)


def _overlaps(parts: FaultlessParts) -> Iterator[Fault]:
    for a, b in combinations(parts.stations, 2):
        if (distance := station_distance(a, b)) < MIN_SPACING:
            rule = f"must be at least {digits(MIN_SPACING)} m from every other station"
            hint = f"{a.id} is {distance:.3g} m away"
            yield fault(f"stations.{b.id}.position", b.position, rule, hint)
    for one, other in combinations(parts.obstacles, 2):
        pair = [obstacle_box(box, 0.5 * MAX_OVERLAP) for box in (one, other)]
        if touch(*pair):
            rule = f"must not overlap another obstacle by more than {digits(MAX_OVERLAP)} m"
            hint = f"it overlaps {one.id}"
            yield fault(f"obstacles.{other.id}.center", other.center, rule, hint)


def station_distance(a: Station, b: Station) -> float:
    """Return the distance of two stations [m]; a cluster is the line through its levels."""
    ends = [(points[0], points[-1]) for points in (a.points(), b.points())]
    flat = math.hypot(*(ends[0][0] - ends[1][0])[:2])
    gap = max(ends[0][0][2] - ends[1][1][2], ends[1][0][2] - ends[0][1][2], 0.0)
    return math.hypot(flat, gap)


def _reach(parts: FaultlessParts) -> Iterator[Fault]:
    cell = parts.cell.model_copy(update={"obstacles": parts.obstacles})
    found = list(Reach(cell).contacts(np.array(cell.robot.home_q)))
    yield from _home_contacts(cell, found)
    # Obstacles that touch the robot at home would be reported again for every station.
    touching = {one.other for one in found if one.kind == "obstacle"}
    apart = tuple(box for box in parts.obstacles if box.id not in touching)
    reach = Reach(cell.model_copy(update={"obstacles": apart}))
    for station in parts.stations:
        yield from _station_reach(reach, station)
    if parts.goal_region is not None:
        yield from _region_reach(reach, parts.goal_region)


def _home_contacts(cell: Cell, found: list[ContactPair]) -> Iterator[Fault]:
    for box in cell.obstacles:
        touching = [one.text for one in found if (one.kind, one.other) == ("obstacle", box.id)]
        if touching:
            rule = "must not touch the robot in its home configuration"
            yield fault(f"obstacles.{box.id}.center", box.center, rule, touching[0])
    own = [one.text for one in found if one.kind != "obstacle"]
    if own:
        rule = "must be a collision-free configuration"
        yield fault("robot.home_q", cell.robot.home_q, rule, own[0])


def _station_reach(reach: Reach, station: Station) -> Iterator[Fault]:
    tries = [reach.tool_down(point) for point in station.points()]
    missed = [(level, one.reason) for level, one in enumerate(tries) if one.q is None]
    place = f"stations.{station.id}.position"
    rule = "must be reachable by the robot with its tool pointing down"
    if missed and station.kind == "cluster" and len(missed) < len(tries):
        levels = f"{len(missed)} of {len(tries)} levels, the first one {missed[0][0]}"
        rule = f"{rule} at every level: {levels}, are not"
        yield fault(f"stations.{station.id}.levels", station.levels, rule, missed[0][1])
    elif missed:
        yield fault(place, station.position, rule, missed[0][1])
    elif station.kind in ("cube", "dock"):  # the gripper must get down to the object
        found = reach.tool_down(np.array(station.position) - (0.0, 0.0, PICK_DEPTH_M))
        if found.q is None:
            rule = f"must leave room to grasp: the tool goes down by {digits(PICK_DEPTH_M)} m"
            yield fault(place, station.position, rule, found.reason)


def _region_reach(reach: Reach, region: GoalRegion) -> Iterator[Fault]:
    targets, missed = region.targets(), []
    for target in targets:
        found = reach.any_configuration(target)
        if found.q is None:
            missed.append((target, found.reason))
        if len(missed) == MAX_MISSED:
            break
    if missed:
        least = "at least " if len(missed) == MAX_MISSED else ""
        n = f"{least}{len(missed)} of {len(targets)}"
        rule = f"must have grid targets in reach only: {n} are not"
        hint = f"at {shown(missed[0][0].round(3).tolist())}, {missed[0][1]}"
        yield fault("goal_region.center", region.center, rule, hint)
