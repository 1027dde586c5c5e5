"""People of a live pick or sorting cell: up to four workers with their work areas.

Homes lie side by side along the walking area. A new person starts at a free position and walks
to work; work areas are divided again when people come or leave. People do not avoid each other.
Keyframe postures of work with another size or area take some tenths of a second to compute:
with an executor the person rests at home until then, and no command waits.
"""

from concurrent.futures import Future

import numpy as np

from app.live.arm import HumanGeometry
from app.live.command_checks import people_after
from app.live.commands import FIRST, AddPerson, RemovePerson
from app.live.people.dragging import STEP_BACK
from app.live.people.people_by_id import PeopleById
from app.live.people.work_loop import WorkLoop
from app.live.people.worker import LiveWorker
from app.sim.cells.cell import Cell
from app.sim.cells.parts import Station
from app.sim.cells.people import Worker
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.human.anthropometry import BodySize
from app.sim.human.kernels.kinematics import N_SIZE
from app.sim.scene.scene import NO_CYLINDERS

SPACING = 0.7
"""Minimum distance of two homes [m]; leaves space for shoulders and elbows."""
SIDEWAYS = 0.35
"""Overlap of the work areas of neighbours [m]."""
SEED_STEP = 7919
"""Difference between the seeds of two people."""


class LiveWorkers(PeopleById[LiveWorker]):
    """Workers of one live cell, which has at least one."""

    def __init__(self, cell: Cell, seed: int) -> None:
        self._cell, self._seed = cell, seed
        self.only_first()

    @property
    def geometry(self) -> HumanGeometry:
        """Collision geometry: capsules only."""
        q = np.array([one.q for one in self]).reshape(-1, 18)
        qd = np.array([one.qd for one in self]).reshape(-1, 18)
        sizes = np.array([one.size for one in self]).reshape(-1, N_SIZE)
        return HumanGeometry(q, qd, sizes, NO_CYLINDERS, NO_CYLINDERS)

    def only_first(self) -> None:
        """Replace all people by the worker of the cell."""
        place = place_of(self._cell, 0, 1)
        first = LiveWorker(self._cell, place, FIRST, self._seed, self._build)
        self._people = {FIRST: first}

    def _build(self, place: Cell, seed: int, size: BodySize, variants: int) -> Future[WorkLoop]:
        """Build a work loop by the executor, or at once where there is none."""
        if self.executor is not None:
            return self.executor.submit(WorkLoop, place, seed, size, variants)
        built = Future[WorkLoop]()
        built.set_result(WorkLoop(place, seed, size, variants))
        return built

    def change(self, command: AddPerson | RemovePerson) -> None:
        """Add or remove a person and divide the work areas again."""
        ids = people_after(command, self.ids)
        places = [place_of(self._cell, k, len(ids)) for k in range(len(ids))]
        people = {}
        for id, place in zip(ids, places, strict=True):
            if id in self._people:
                people[id] = self._people[id]
                people[id].move_to(place)
            else:
                seed, start = self._seed + SEED_STEP * id, self._entrance(place.human)
                people[id] = LiveWorker(self._cell, place, id, seed, self._build, start)
        self._people = people

    def _entrance(self, worker: Worker) -> Vec:
        """Return a standing posture at or behind home, where no person stands."""
        x, y, yaw = worker.home
        back = self._cell.human.y_max + STEP_BACK
        spots = [
            (x, y),
            *((x + dx, back) for dx in (0.0, SPACING, -SPACING, 2 * SPACING, -2 * SPACING)),
        ]
        others = self.geometry.q[:, :2]

        def clearance(spot: tuple[float, float]) -> float:
            gaps = np.linalg.norm(others - np.array(spot), axis=1)
            return float(min(gaps, default=np.inf))

        free = [spot for spot in spots if clearance(spot) >= SPACING]
        return human.rest_posture(*(free[0] if free else max(spots, key=clearance)), yaw)

    def move(self, dt: float) -> None:
        """Move all people for ``dt`` [s]."""
        for one in self:
            one.move(dt)

    def move_while_paused(self, dt: float) -> bool:
        """Move dragged people and continue changes of size; return whether anything changed."""
        moved = False
        for one in self:
            if one.mode == "manual":
                changed = one.move(dt)
                if changed:
                    one.freeze()
            else:
                changed = one.advance_size(dt)
            moved = moved or changed
        return moved


def place_of(cell: Cell, index: int, count: int) -> Cell:
    """Return a cell restricted to one person of ``count``: home, stations and walking area.

    ``index`` counts the people from left to right.
    """
    worker = cell.human
    if count == 1:
        return cell if cell.people == (worker,) else _with(cell, worker, cell.stations)
    spacing = max((worker.x_max - worker.x_min) / count, SPACING)
    x = 0.5 * (worker.x_min + worker.x_max) + spacing * (index - 0.5 * (count - 1))
    free = max(0.5 * (spacing - SPACING), 0.03)
    own = worker.model_copy(
        update={
            "home": (x, worker.home[1], worker.home[2]),
            "x_min": x - free,
            "x_max": x + free,
        }
    )
    near = []
    for kind in ("cube", "dock"):
        stations = sorted(cell.stations_of(kind), key=lambda one: abs(one.position[0] - x))
        reach = 0.5 * spacing + SIDEWAYS
        near += [s for s in stations if s is stations[0] or abs(s.position[0] - x) < reach]
    return _with(cell, own, tuple(one for one in cell.stations if one in near))


def _with(cell: Cell, worker: Worker, stations: tuple[Station, ...]) -> Cell:
    return cell.model_copy(update={"people": (worker,), "stations": stations})
