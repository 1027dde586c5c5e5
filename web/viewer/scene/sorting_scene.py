"""Scene of a sorting cell: clutter slots, towers, blocks and the current move.

Rings mark the start and the target of the block; a dashed arc connects them.
"""

from collections.abc import Callable

import numpy as np
import viser

from app.live.snapshot import WorldSnapshot
from app.live.sorting.commands import ToggleGoal
from app.live.sorting.snapshot import SortingSnapshot
from app.sim.cells.cell import Cell
from app.sim.cells.colours import TARGET
from app.sim.core.arrays import Vec
from web.viewer.scene.arc import Arc
from web.viewer.scene.blocks_view import BlocksView
from web.viewer.scene.clutter_view import ClutterView, tray_height
from web.viewer.scene.towers_view import TowersView
from web.viewer.solid_meshes import torus

ARC_LIFT = 0.22
"""Height of the arc over the straight line [m]."""
RING_M = 0.078


class SortingScene:
    """Draws slots, towers, blocks and move; used by the live cell's thread only."""

    def __init__(
        self, server: viser.ViserServer, cell: Cell, submit: Callable[[ToggleGoal], object]
    ) -> None:
        self._cell, self._floor = cell, tray_height(cell)
        self._clutter = ClutterView(server, cell)
        self._towers = TowersView(server, cell)
        self._blocks = BlocksView(server, submit)
        self._rings = {name: _add_ring(server, name) for name in ("pick", "place")}
        self._arc = Arc(server, "/move/arc", lift=ARC_LIFT)

    def draw(self, snapshot: WorldSnapshot) -> None:
        """Show a snapshot; sends only what changed."""
        view = snapshot.sorting
        if view is None:
            return
        self._clutter.draw(view.failure)
        self._towers.draw(view.goal)
        self._blocks.draw(view.blocks)
        ends = _ends(view, self._cell, self._floor)
        self._ring("pick", None if ends is None or ends[2] else ends[0])
        self._ring("place", None if ends is None else ends[1])
        if ends is None:
            self._arc.hide()
        else:
            self._arc.show(ends[0], ends[1])

    def _ring(self, name: str, at: Vec | None) -> None:
        ring = self._rings[name]
        ring.visible = at is not None
        if at is not None and np.abs(ring.position - at).max() > 1e-4:
            ring.position = at


def _ends(view: SortingSnapshot, cell: Cell, floor: float) -> tuple[Vec, Vec, bool] | None:
    """Return present and final position of the block [m], and whether it is held."""
    if view.move is None or view.phase == "idle":
        return None
    block = next((one for one in view.blocks if one.id == view.move.block), None)
    if block is None:
        return None
    below = np.array([0.0, 0.0, block.half_size[2]])
    start = block.position - below
    return start, _place(view, cell, floor), block.held


def _place(view: SortingSnapshot, cell: Cell, floor: float) -> Vec:
    """Return the centre of the free place at which the move ends [m], shape (3,)."""
    assert view.move is not None
    station = cell.station(view.move.place)
    level = sum(one.place == station.id and not one.held for one in view.blocks)
    stands = level if station.kind == "cluster" else 0
    height = floor + stands * (station.level_height or 0.0)
    return np.array([station.position[0], station.position[1], height])


def _add_ring(server: viser.ViserServer, name: str) -> viser.MeshHandle:
    ring = torus(RING_M, 0.004 if name == "pick" else 0.0028)
    return server.scene.add_mesh_simple(
        f"/marks/{name}", *ring, color=TARGET, cast_shadow=False, visible=False
    )
