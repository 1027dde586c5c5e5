"""The people of a live cell: none to four, each with a home and a part of the table.

The homes lie side by side along the walking area, so that nobody begins inside another one;
whoever comes in later starts where there is room and walks to work. When somebody comes or
leaves, those who work or stand still move up. People do not avoid each other: whoever is
dragged, or moves as recorded, may walk into anybody.
"""

from collections.abc import Iterator

import numpy as np

from app.live.arm import HumanGeometry
from app.live.command_checks import people_after
from app.live.commands import FIRST, AddPerson, RemovePerson
from app.live.people.dragging import STEP_BACK
from app.live.people.worker import LivePerson
from app.sim.cells.cell import Cell
from app.sim.cells.parts import Station
from app.sim.cells.people import Worker
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.human.kernels.kinematics import N_SIZE
from app.sim.scene.scene import NO_CYLINDERS

ROOM = 0.7
"""Distance of two homes that leaves room for shoulders and elbows [m]."""
SIDEWAYS = 0.35
"""How far beyond the own part of the table a person works [m]."""
SEED_STEP = 7919
"""Between the seeds of two people's work."""


class LivePeople:
    """The people of one live cell.

    Args:
        cell: Work cell with at least one worker.
        seed: Seed of the first person's work.
    """

    def __init__(self, cell: Cell, seed: int) -> None:
        self._cell, self._seed = cell, seed
        self._people = {FIRST: LivePerson(cell, place_of(cell, 0, 1), FIRST, seed)}

    def __iter__(self) -> Iterator[LivePerson]:
        return iter(self._people.values())

    def __len__(self) -> int:
        return len(self._people)

    def __getitem__(self, id: int) -> LivePerson:
        return self._people[id]

    @property
    def ids(self) -> tuple[int, ...]:
        """Ids of the people who are there, in order."""
        return tuple(self._people)

    @property
    def q(self) -> Vec:
        """Joint positions of all [m, rad], shape (n, 18)."""
        return np.array([one.q for one in self]).reshape(-1, 18)

    @property
    def sizes(self) -> Vec:
        """Sizes of all [m], shape (n, N_SIZE)."""
        return np.array([one.size for one in self]).reshape(-1, N_SIZE)

    @property
    def bodies(self) -> HumanGeometry:
        """Where they are; nobody is a cylinder."""
        return HumanGeometry(self.q, self.sizes, NO_CYLINDERS)

    def only_first(self) -> LivePerson:
        """Leave the first person alone, as the cell describes it, and return it."""
        place = place_of(self._cell, 0, 1)
        self._people = {FIRST: LivePerson(self._cell, place, FIRST, self._seed)}
        return self._people[FIRST]

    def change(self, command: AddPerson | RemovePerson) -> None:
        """Let people come and leave as a command says, and the others move up."""
        ids = people_after(command, self.ids)
        places = [place_of(self._cell, k, len(ids)) for k in range(len(ids))]
        people = {}
        for id, place in zip(ids, places, strict=True):
            known = self._people.get(id)
            if known is None:
                known = LivePerson(
                    self._cell,
                    place,
                    id,
                    self._seed + SEED_STEP * id,
                    self._entrance(place.human),
                )
            else:
                known.move_to(place)
            people[id] = known
        self._people = people

    def _entrance(self, worker: Worker) -> Vec:
        """Return a posture at home, or behind it, where nobody stands; else the freest."""
        x, y, yaw = worker.home
        back = self._cell.human.y_max + STEP_BACK
        spots = [(x, y), *((x + dx, back) for dx in (0.0, ROOM, -ROOM, 2 * ROOM, -2 * ROOM))]
        others = self.q[:, :2]

        def room(spot: tuple[float, float]) -> float:
            gaps = np.linalg.norm(others - np.array(spot), axis=1)
            return float(min(gaps, default=np.inf))

        free = [spot for spot in spots if room(spot) >= ROOM]
        return human.rest_posture(*(free[0] if free else max(spots, key=room)), yaw)

    def move(self, dt: float) -> None:
        """Move everyone for ``dt`` [s]."""
        for one in self:
            one.move(dt)

    def move_while_paused(self, dt: float) -> bool:
        """Move whoever is dragged, and let sizes change; return whether anything did."""
        moved = False
        for one in self:
            if one.move(dt) if one.mode == "manual" else one.glide(dt):
                one.freeze()
                moved = True
        return moved


def place_of(cell: Cell, index: int, count: int) -> Cell:
    """Return a cell as one of its people sees it: own home, own part of table and area.

    Args:
        cell: Work cell with at least one worker.
        index: Which of the people, from 0, from left to right.
        count: How many there are.
    """
    worker = cell.human
    if count == 1:
        return cell if cell.people == (worker,) else _with(cell, worker, cell.stations)
    spacing = max((worker.x_max - worker.x_min) / count, ROOM)
    x = 0.5 * (worker.x_min + worker.x_max) + spacing * (index - 0.5 * (count - 1))
    free = max(0.5 * (spacing - ROOM), 0.03)
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
