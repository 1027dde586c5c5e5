"""The shipped task primitives: what a person does between two places of a cell, by one hand.

One file holds, for each leg of a worker's task (home - cube, home - dock, cube - dock; each
hand), the weights of its demonstrations; the primitive is made of them as ``promp.fit`` makes
it. A leg is stored in one direction; backward it is ``promp.reversed_primitive``. The file is
written by ``make_primitives.py`` and holds numbers only: it is read without pickle.

Source: METHOD 3.4 (a library of primitives, one per task).
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any, Literal

import numpy as np

from app.sim.cells.cell import Cell, load_cell
from app.sim.core.arrays import Vec
from app.sim.human.model import Hand
from app.sim.primitives import promp
from app.sim.primitives.promp import ProMP

FILE = Path(str(resources.files("app.sim.primitives"))) / "data" / "task_primitives.npz"
HANDS: tuple[Hand, Hand] = ("r", "l")
"""Order of hands in arrays."""
HOME = "home"
"""Name of the place where a person rests."""

Kind = Literal["home-cube", "home-dock", "cube-dock"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Leg:
    """One leg of a task in one cell, in the direction in which it is stored."""

    kind: Kind
    """What is at its ends."""
    start: str
    """Name of the place where it begins: a station or HOME."""
    end: str
    """Name of the station where it ends."""
    hand: Hand
    """The hand that works."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskPrimitive:
    """The demonstrations of one leg."""

    cell: str
    """Name of the shipped cell in which they were made."""
    leg: Leg
    """What is done."""
    weights: Vec
    """Weights of each demonstration [m, rad], shape (n, 18, n_basis)."""
    durations: Vec
    """How long each took [s], shape (n,)."""
    residual: Vec
    """What the regression left, root mean square per joint [m, rad], shape (18,)."""

    def primitive(self) -> ProMP:
        """Return the movement primitive of the demonstrations."""
        return promp.of_weights(self.weights, self.durations, residual=self.residual)


def segments_of(cell: Cell) -> tuple[Leg, ...]:
    """Return the legs of a worker's task in a cell, stored direction; none without a worker."""
    if not cell.workers:
        return ()
    cubes = [station.id for station in cell.stations_of("cube")]
    docks = [station.id for station in cell.stations_of("dock")]
    ways: list[tuple[Kind, str, str]] = [
        *(("home-cube", HOME, cube) for cube in cubes),
        *(("home-dock", HOME, dock) for dock in docks),
        *(("cube-dock", cube, dock) for cube in cubes for dock in docks),
    ]
    return tuple(
        Leg(kind=kind, start=start, end=end, hand=hand)
        for kind, start, end in ways
        for hand in HANDS
    )


def place_of(cell: Cell, name: str) -> Vec | None:
    """Return the point of a place [m], shape (3,); None at home."""
    return None if name == HOME else np.array(cell.station(name).position)


def write_primitives(path: Path, made: Sequence[TaskPrimitive], about: dict[str, Any]) -> None:
    """Write primitives and a header.

    Args:
        path: File to write.
        made: Primitives, each with as many demonstrations.
        about: What else the header says, as JSON data.
    """
    tasks = [
        {
            "cell": one.cell,
            "kind": one.leg.kind,
            "start": one.leg.start,
            "end": one.leg.end,
            "hand": one.leg.hand,
        }
        for one in made
    ]
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(
        path,
        header=np.array(json.dumps({**about, "tasks": tasks})),
        weights=np.array([one.weights for one in made], dtype=np.float32),
        durations=np.array([one.durations for one in made], dtype=np.float32),
        residual=np.array([one.residual for one in made], dtype=np.float32),
    )


@cache
def read_header(path: Path = FILE) -> dict[str, Any]:
    """Return what the file says about itself: seed, version, styles, sizes, tasks."""
    with np.load(path, allow_pickle=False) as data:
        header: dict[str, Any] = json.loads(str(data["header"]))
    return header


@cache
def load_primitives(path: Path = FILE) -> tuple[TaskPrimitive, ...]:
    """Return the shipped primitives; arrays are read-only."""
    with np.load(path, allow_pickle=False) as data:
        weights, durations, residual = (
            np.asarray(data[name], dtype=np.float64)
            for name in ("weights", "durations", "residual")
        )
    for array in (weights, durations, residual):
        array.setflags(write=False)
    return tuple(
        TaskPrimitive(
            cell=task["cell"],
            leg=Leg(**{name: task[name] for name in ("kind", "start", "end", "hand")}),
            weights=weights[i],
            durations=durations[i],
            residual=residual[i],
        )
        for i, task in enumerate(read_header(path)["tasks"])
    )


def primitive_for(cell: Cell, leg: Leg) -> TaskPrimitive:
    """Return the shipped primitive for a leg of any cell.

    Of those of the same kind and hand, that whose places are nearest, seen from where the
    person stands; its pelvis is moved to where the person of this cell stands.

    Args:
        cell: Work cell with a worker.
        leg: One of its legs.
    """

    def apart(one: TaskPrimitive) -> float:
        theirs, ours = ends_seen(load_cell(one.cell), one.leg), ends_seen(cell, leg)
        return float(np.linalg.norm(theirs - ours, axis=1).sum())

    same = [
        one for one in load_primitives() if (one.leg.kind, one.leg.hand) == (leg.kind, leg.hand)
    ]
    nearest = min(same, key=apart)
    weights = nearest.weights.copy()
    weights[:, :2] += (_stand(cell) - _stand(load_cell(nearest.cell)))[:2, None]
    return replace(nearest, weights=weights)


def ends_seen(cell: Cell, leg: Leg) -> Vec:
    """Return a leg's two places as seen from where the person stands [m], shape (2, 3)."""
    x, y, _ = cell.human.home
    home = np.array([x, y, 0.0])
    points = [place_of(cell, name) for name in (leg.start, leg.end)]
    return np.stack([home if point is None else point for point in points]) - _stand(cell)


def _stand(cell: Cell) -> Vec:
    """Return the middle of a worker's stance at the table [m], shape (3,)."""
    return np.array([cell.human.home[0], cell.human.y_min, 0.0])
