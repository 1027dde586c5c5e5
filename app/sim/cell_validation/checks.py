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
from app.sim.cell_validation.units import numbers, shown
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
            yield Fault(place=name, value=f"<{n} of them>", rule=f"must be at most {most}")
    if not cell.stations and cell.goal_region is None and not known:
        rule = "must hold at least one station, or the cell a goal_region"
        yield Fault(place="stations", value="[]", rule=rule)


def _ids(cell: Cell) -> Iterator[Fault]:
    for group in ("stations", "obstacles"):
        ids = Counter(one.id for one in getattr(cell, group))
        for name, count in ids.items():
            if count > 1:
                rule = f"must be given once, not {count} times"
                yield Fault(place=f"{group}.{name}.id", value=name, rule=rule)


def _in_order(place: str, low: float, high: float, names: tuple[str, str]) -> Iterator[Fault]:
    if low >= high:
        yield Fault(
            place=f"{place}.{names[0]}",
            value=shown(low),
            rule=f"must be less than {names[1]} = {digits(high)}",
            hint="the two may have changed places",
        )


def _table(cell: Cell) -> Iterator[Fault]:
    table = cell.table
    for axis in "xy":
        names = (f"{axis}_min", f"{axis}_max")
        yield from _in_order("table", getattr(table, names[0]), getattr(table, names[1]), names)
    if table.thickness >= table.height:
        rule = f"must be less than the table's height = {digits(table.height)} m"
        yield Fault(place="table.thickness", value=shown(table.thickness), rule=rule)


def _robot(robot: RobotMount) -> Iterator[Fault]:
    limits = zip(robot.q_min, robot.home_q, robot.q_max, strict=True)
    for joint, (low, home, high) in enumerate(limits):
        if low >= high:
            yield Fault(
                place=f"robot.q_min[{joint}]",
                value=shown(low),
                rule=f"must be less than q_max[{joint}] = {digits(high)}",
                hint="the two may have changed places",
            )
        elif not low < home < high:
            yield Fault(
                place=f"robot.home_q[{joint}]",
                value=shown(home),
                rule=f"must lie inside the joint's limits ({digits(low)}, {digits(high)}) rad",
            )
    for name, limit in (("q_min", robot.q_min[2]), ("q_max", robot.q_max[2])):
        if abs(limit) > MOST_ELBOW + 1e-9:
            yield Fault(
                place=f"robot.{name}[2]",
                value=shown(limit),
                rule=f"must lie in [-{MOST_ELBOW}, {MOST_ELBOW}] rad",
                hint="an elbow that bends more folds the arm into itself",
            )
    if robot.tool_radius > robot.tool_length:
        rule = f"must not exceed tool_length = {digits(robot.tool_length)} m"
        yield Fault(place="robot.tool_radius", value=shown(robot.tool_radius), rule=rule)


def _kinds(cell: Cell) -> Iterator[Fault]:
    owners = {name: kind for kind, names in FIELDS_OF_KIND.items() for name in names}
    for station in cell.stations:
        for name, owner in owners.items():
            value, place = getattr(station, name), f"stations.{station.id}.{name}"
            if station.kind == owner and value is None:
                rule = f"is missing: a station of kind {owner} needs it"
                yield Fault(place=place, value="", rule=rule)
            elif station.kind != owner and value is not None:
                rule = f"belongs to a station of kind {owner}; this one is a {station.kind}"
                yield Fault(place=place, value=shown(value), rule=rule)
    colours = [s.colour for s in cell.stations_of("cluster")]
    for station in cell.stations_of("cluster"):
        if station.colour is not None and colours.count(station.colour) > 1:
            rule = "must be that of one cluster only"
            place = f"stations.{station.id}.colour"
            yield Fault(place=place, value=station.colour, rule=rule)


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
            yield Fault(place=f"{place}.home", value=shown(person.home), rule=rule)


def _grid(region: GoalRegion) -> list[Fault]:
    if region.spacing <= 0.0:
        return []
    faults = []
    for axis, side in enumerate(region.size):
        if abs(side - round(side / region.spacing) * region.spacing) > 1e-6:
            rule = f"must be a multiple of spacing = {digits(region.spacing)} m"
            faults.append(
                Fault(place=f"goal_region.size[{axis}]", value=shown(side), rule=rule)
            )
    n = math.prod(round(abs(side) / region.spacing) + 1 for side in region.size)
    if n > MAX_TARGETS:
        rule = f"gives {n} grid targets; at most {MAX_TARGETS} are taken"
        faults.append(
            Fault(place="goal_region.spacing", value=shown(region.spacing), rule=rule)
        )
    return faults


def _overlaps(parts: FaultlessParts) -> Iterator[Fault]:
    for a, b in combinations(parts.stations, 2):
        if (distance := station_distance(a, b)) < MIN_SPACING:
            yield Fault(
                place=f"stations.{b.id}.position",
                value=shown(b.position),
                rule=f"must be at least {digits(MIN_SPACING)} m from every other station",
                hint=f"{a.id} is {distance:.3g} m away",
            )
    for one, other in combinations(parts.obstacles, 2):
        pair = [obstacle_box(box, 0.5 * MAX_OVERLAP) for box in (one, other)]
        if touch(*pair):
            yield Fault(
                place=f"obstacles.{other.id}.center",
                value=shown(other.center),
                rule=f"must not overlap another obstacle by more than {digits(MAX_OVERLAP)} m",
                hint=f"it overlaps {one.id}",
            )


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
            yield Fault(
                place=f"obstacles.{box.id}.center",
                value=shown(box.center),
                rule="must not touch the robot in its home configuration",
                hint=touching[0],
            )
    own = [one.text for one in found if one.kind != "obstacle"]
    if own:
        yield Fault(
            place="robot.home_q",
            value=shown(cell.robot.home_q),
            rule="must be a collision-free configuration",
            hint=own[0],
        )


def _station_reach(reach: Reach, station: Station) -> Iterator[Fault]:
    tries = [reach.tool_down(point) for point in station.points()]
    missed = [(level, one.reason) for level, one in enumerate(tries) if one.q is None]
    place = f"stations.{station.id}.position"
    if not missed:
        yield from _pick_reach(reach, station, place)
        return
    rule = "must be reachable by the robot with its tool pointing down"
    hint = missed[0][1]
    if station.kind == "cluster" and len(missed) < len(tries):
        levels = f"{len(missed)} of {len(tries)} levels, the first one {missed[0][0]}"
        place, rule = (
            f"stations.{station.id}.levels",
            f"{rule} at every level: {levels}, are not",
        )
        yield Fault(place=place, value=shown(station.levels), rule=rule, hint=hint)
        return
    yield Fault(place=place, value=shown(station.position), rule=rule, hint=hint)


def _pick_reach(reach: Reach, station: Station, place: str) -> Iterator[Fault]:
    """Check that the gripper gets down to the object at a cube or dock."""
    if station.kind not in ("cube", "dock"):
        return
    found = reach.tool_down(np.array(station.position) - (0.0, 0.0, PICK_DEPTH_M))
    if found.q is None:
        rule = f"must leave room to grasp: the tool goes down by {digits(PICK_DEPTH_M)} m"
        yield Fault(place=place, value=shown(station.position), rule=rule, hint=found.reason)


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
        point = shown(missed[0][0].round(3).tolist())
        yield Fault(
            place="goal_region.center",
            value=shown(region.center),
            rule="must have grid targets in reach only: "
            f"{least}{len(missed)} of {len(targets)} are not",
            hint=f"at {point}, {missed[0][1]}",
        )
