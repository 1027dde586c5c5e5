"""Scene of a live cell, drawn from one snapshot.

Only the thread that owns the world draws; clicks and drags become commands.
"""

from collections.abc import Callable

import numpy as np
import viser

from app.live.command_checks import Command
from app.live.pick.risk_worker import PersonRisk
from app.live.reach.commands import is_reaching
from app.live.snapshot import WorldSnapshot
from app.sim.cells.cell import Cell
from app.sim.sorting.layout import is_sorting
from web.viewer.people.people_view import PeopleView
from web.viewer.robot.robot_view import RobotView
from web.viewer.scene import workplace
from web.viewer.scene.arc import Arc
from web.viewer.scene.reach_scene import ReachScene
from web.viewer.scene.risk_view import RiskView
from web.viewer.scene.sorting_scene import SortingScene
from web.viewer.scene.stations_view import StationsView

PATH_LIFT = 0.12
"""Height of the dashed path's arc over the straight line [m]."""


class CellScene:
    """One cell in one viewer."""

    def __init__(
        self, server: viser.ViserServer, cell: Cell, submit: Callable[[Command], object]
    ) -> None:
        self._server, self._cell = server, cell
        with server.atomic():
            workplace.build(server, cell)
            self._robot = RobotView(server, cell)
            self._stations = StationsView(server, cell, submit)
            self._people = PeopleView(server, cell, submit)
            self._sorting = SortingScene(server, cell, submit) if is_sorting(cell) else None
            self._reach = ReachScene(server, cell, submit) if is_reaching(cell) else None
            picks = self._sorting is None and self._reach is None
            self._risk = RiskView(server) if picks else None
            self._path = Arc(server, "/path/arc", lift=PATH_LIFT) if picks else None

    def note(self, snapshot: WorldSnapshot) -> None:
        """Add a snapshot that is not drawn to the trail of the tool."""
        if self._reach is not None:
            self._reach.note(snapshot)

    def draw(
        self,
        snapshot: WorldSnapshot,
        dt: float,
        *,
        shapes: bool = False,
        risk: PersonRisk | None = None,
    ) -> None:
        """Show a snapshot; sends only what changed.

        Args:
            dt: Time since the last call [s].
            shapes: Whether a visitor shows the collision capsules.
            risk: Risk map of a pick cell.
        """
        with self._server.atomic():
            self._robot.draw(snapshot.robot_q)
            self._robot.grip(snapshot.gripping)
            self._robot.capsules.show(shapes, _touched_capsules(snapshot))
            self._people.draw(snapshot, dt, shapes=shapes)
            self._stations.draw(snapshot)
            if self._sorting is not None:
                self._sorting.draw(snapshot)
            elif self._reach is not None:
                self._reach.draw(snapshot)
            if self._path is not None:
                self._draw_path(self._path, snapshot)
            if self._risk is not None:
                self._risk.draw(risk)

    def _draw_path(self, path: Arc, snapshot: WorldSnapshot) -> None:
        if snapshot.status != "moving" or snapshot.chosen is None:
            path.hide()
            return
        path.show(snapshot.tcp, np.array(self._cell.station(snapshot.chosen).position))


def _touched_capsules(snapshot: WorldSnapshot) -> set[str]:
    """Return the names of the robot's capsules in contact: two where it touches itself."""
    contact = snapshot.contact if snapshot.status == "contact" else None
    if contact is None:
        return set()
    return {contact.link, contact.body} if contact.kind == "self" else {contact.link}
