"""Support of stations and people: the table, an obstacle or the floor."""

import math
from collections.abc import Iterator, Sequence

from app.errors import Fault, digits
from app.sim.cell_validation.units import fault
from app.sim.cells.cell import Cell
from app.sim.cells.parts import Obstacle, Station
from app.sim.cells.people import Worker
from app.sim.cells.support import is_over, is_over_table, top_of

HIGHEST_PART = 0.4
"""Largest height of a station above the table or obstacle that supports it [m]."""
FACING = 1.4
"""Greatest angle between a worker's gaze at home and the direction to the table [rad]."""


class FaultlessParts:
    """The parts of a cell without faults, for checks that use several parts."""

    def __init__(self, cell: Cell, faults: list[Fault]) -> None:
        named = [fault.place for fault in faults]

        def is_faultless(place: str) -> bool:
            inside = (f"{place}.", f"{place}[")
            return not any(one == place or one.startswith(inside) for one in named)

        self.cell = cell
        self.table, self.robot = is_faultless("table"), is_faultless("robot")
        self.counts_valid = "stations" not in named and "obstacles" not in named
        self.stations = tuple(s for s in cell.stations if is_faultless(f"stations.{s.id}"))
        self.obstacles = tuple(o for o in cell.obstacles if is_faultless(f"obstacles.{o.id}"))
        self.people = tuple(
            (k, person) for k, person in enumerate(cell.people) if is_faultless(f"people[{k}]")
        )
        self.goal_region = cell.goal_region if is_faultless("goal_region") else None


def places(parts: FaultlessParts) -> Iterator[Fault]:
    """Check that stations are supported and free, and people clear of table and obstacles."""
    for station in parts.stations:
        place, value = f"stations.{station.id}.position", station.position
        under = [box for box in parts.obstacles if is_over(box, station.position)]
        inside = [
            box
            for box in under
            if (abs(station.points()[:, 2] - box.center[2]) < box.half_size[2]).any()
        ]
        if inside:
            rule = f"must not lie inside the obstacle {inside[0].id}"
            yield fault(place, value, rule)
        elif station.position[2] < 0.0:
            yield fault(place, value, "must not lie below the table top, z = 0")
        elif parts.table and not under and not is_over_table(parts.cell.table, value):
            rule = "must lie over the table or over an obstacle that carries it"
            yield fault(place, value, rule, _table_text(parts.cell))
        elif parts.table and (hint := _hangs(parts.cell, station, under)):
            most = f"{HIGHEST_PART:g} m"
            rule = f"must be carried by the table or an obstacle at most {most} below"
            yield fault(place, value, rule, hint)
    region = parts.goal_region
    if region is not None and region.center[2] - 0.5 * region.size[2] < 0.0:
        rule = "must keep the whole region over the table top, z = 0"
        yield fault("goal_region.center", region.center, rule)
    yield from _standing(parts)


def _hangs(cell: Cell, station: Station, under: Sequence[Obstacle]) -> str:
    """Return the gap below a station as text; empty if it is supported."""
    z = station.position[2]
    tops = [(top_of(box), box.id) for box in under]
    tops += [(0.0, "the table")] if is_over_table(cell.table, station.position) else []
    carrying = [one for one in tops if one[0] <= z]
    if not carrying:
        return f"{tops[0][1]} lies above it"
    top, name = max(carrying)
    return f"{name} ends {z - top:.3g} m below it" if z - top > HIGHEST_PART else ""


def _table_text(cell: Cell) -> str:
    t = cell.table
    return f"the table is x in [{t.x_min:g}, {t.x_max:g}] m, y in [{t.y_min:g}, {t.y_max:g}] m"


def _standing(parts: FaultlessParts) -> Iterator[Fault]:
    """Check that workers stand beside the table; cylinders include arms and may cross it."""
    table = parts.cell.table
    for index, person in parts.people:
        if not isinstance(person, Worker):
            continue
        place = f"people[{index}]"
        apart = (
            person.x_min >= table.x_max - 1e-9
            or person.x_max <= table.x_min + 1e-9
            or person.y_min >= table.y_max - 1e-9
            or person.y_max <= table.y_min + 1e-9
        )
        if parts.table and apart and person.y_min < table.y_max - 1e-9:
            rule = (
                "must keep a worker beside the edge of the table with the greatest y: at "
                f"least y_max = {digits(table.y_max)} m"
            )
            hint = "turn the cell: x to the right, y from the robot toward the person"
            yield fault(f"{place}.y_min", person.y_min, rule, hint)
        if parts.table and not apart:
            rule = "must keep a worker's walking area off the table"
            yield fault(f"{place}.y_min", person.y_min, rule, _table_text(parts.cell))
        if parts.table and apart:
            yield from _facing(parts.cell, person, place)
        pelvis_z = person.pelvis_height + parts.cell.floor_z
        for box in parts.obstacles:
            low = box.center[2] - box.half_size[2] < pelvis_z
            if low and is_over(box, person.home):
                rule = f"must not lie inside the obstacle {box.id}"
                yield fault(f"{place}.home", person.home, rule)


def _facing(cell: Cell, worker: Worker, place: str) -> Iterator[Fault]:
    """Check that a worker at home faces the table."""
    table, (x, y, yaw) = cell.table, worker.home
    to_x = min(table.x_max, max(table.x_min, x)) - x
    to_y = min(table.y_max, max(table.y_min, y)) - y
    toward = math.atan2(to_y, to_x)
    if math.hypot(to_x, to_y) > 0.0 and abs(math.remainder(yaw - toward, math.tau)) > FACING:
        rule = f"must look at the table, at most {FACING:g} rad past it"
        yield fault(f"{place}.home[2]", yaw, rule, f"the table is at {toward:.3g} rad")
