"""The live cell as a picture: everything that moves, drawn from one snapshot.

Only the thread that owns the world draws; clicks and drags leave as commands.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import viser

from app.sim.cells import Cell
from app.sim.commands import Command
from app.sim.snapshot import WorldSnapshot
from web import workplace
from web.people_view import PeopleView
from web.poses import Vec
from web.robot_view import RobotView
from web.stations_view import MARK, StationsView

PATH_DASHES = 14
PATH_LIFT = 0.12
"""Height of the dashed path's arc over the straight line [m]."""


@dataclass(slots=True)
class Overlays:
    """What a visitor may show or hide; written by the panel, read by the drawing thread."""

    shapes: bool = False
    """The capsules the simulator sees."""
    values: bool = True
    """The labels at the stations."""
    path: bool = True
    """The dashed line from tool to target."""


class CellScene:
    """One cell in one viewer.

    Args:
        server: The viewer.
        cell: Work cell.
        submit: Takes commands of clicks and drags.
    """

    def __init__(
        self, server: viser.ViserServer, cell: Cell, submit: Callable[[Command], None]
    ) -> None:
        self._server, self._cell = server, cell
        self.overlays = Overlays()
        with server.atomic():
            workplace.build(server, cell)
            self._robot = RobotView(server, cell)
            self._stations = StationsView(server, cell, submit)
            self._people = PeopleView(server, cell, submit)
            self._path = server.scene.add_line_segments(
                "/path",
                np.zeros((PATH_DASHES, 2, 3)),
                MARK,
                thickness=0.006,
                visible=False,
            )
        self._path_key: tuple[object, ...] = ()

    def draw(self, snapshot: WorldSnapshot, dt: float) -> None:
        """Show a snapshot; sends only what changed.

        Args:
            snapshot: What to show.
            dt: Time since the last call [s].
        """
        with self._server.atomic():
            touched = snapshot.contact if snapshot.status == "contact" else None
            self._robot.draw(snapshot.robot_q)
            self._robot.grip(snapshot.gripping)
            self._robot.show_capsules(self.overlays.shapes, touched.link if touched else None)
            self._people.draw(snapshot, dt, shapes=self.overlays.shapes)
            self._stations.show_values(self.overlays.values)
            self._stations.draw(snapshot)
            self._draw_path(snapshot)

    def _draw_path(self, snapshot: WorldSnapshot) -> None:
        going = snapshot.status == "moving" and snapshot.chosen is not None
        shown = going and self.overlays.path
        if self._path.visible != shown:
            self._path.visible = shown
        if not shown or snapshot.chosen is None:
            return
        key = (snapshot.chosen, *np.round(snapshot.tcp, 3).tolist())
        if key != self._path_key:
            self._path_key = key
            target = np.array(self._cell.station(snapshot.chosen).position)
            self._path.points = dashes(snapshot.tcp, target).astype(np.float32)


def dashes(start: Vec, end: Vec) -> Vec:
    """Return the dashes of an arc from ``start`` to ``end`` [m], (PATH_DASHES, 2, 3)."""
    ends = (np.arange(PATH_DASHES)[:, None] + np.array([0.15, 0.75])) / PATH_DASHES
    line = start + ends[..., None] * (end - start)
    lift = min(PATH_LIFT, 0.35 * float(np.linalg.norm(end - start)))
    line[..., 2] += 4.0 * lift * ends * (1.0 - ends)
    return np.asarray(line)
