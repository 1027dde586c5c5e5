"""Towers in the scene: base plates, and missing goal blocks as translucent blocks."""

import numpy as np
import viser

from app.live.sorting.snapshot import GoalBlockSnapshot
from app.sim.cells.cell import Cell
from app.sim.cells.colours import BLOCKS
from web.viewer.scene.clutter_view import tray_height
from web.viewer.scene.sorting_bodies import ghost_body, tower_plate

Kind = tuple[str, tuple[float, ...], tuple[float, ...]]
"""Colour, half sizes [m] and centre [m] of a missing goal block."""


class TowersView:
    """Draws the towers of one cell; used by the live cell's thread only."""

    def __init__(self, server: viser.ViserServer, cell: Cell) -> None:
        self._scene = server.scene
        height = tray_height(cell)
        for station in cell.stations_of("cluster"):
            if station.colour is not None:
                x, y, _ = station.position
                plate = tower_plate(BLOCKS[station.colour], height)
                self._scene.add_glb(
                    f"/towers/{station.id}", plate, position=(x, y, 0.0), cast_shadow=False
                )
        self._ghosts: dict[tuple[str, int], tuple[Kind, viser.MeshHandle]] = {}

    def draw(self, goal: tuple[GoalBlockSnapshot, ...]) -> None:
        """Show the blocks of the goal that are not in place."""
        wanted = {(one.tower, one.level): one for one in goal if not one.done}
        for place in self._ghosts.keys() - wanted.keys():
            self._ghosts.pop(place)[1].remove()
        for place, block in wanted.items():
            kind = (block.colour, tuple(block.half_size), tuple(block.position))
            known = self._ghosts.get(place)
            if known is not None and known[0] == kind:
                continue
            if known is not None:
                known[1].remove()
            self._ghosts[place] = kind, self._add(block)

    def _add(self, block: GoalBlockSnapshot) -> viser.MeshHandle:
        x, y, z = block.half_size.tolist()
        mesh = ghost_body((x, y, z))
        return self._scene.add_mesh_simple(
            f"/goal/{block.tower}/{block.level}",
            np.asarray(mesh.vertices),
            np.asarray(mesh.faces),
            color=BLOCKS[block.colour],
            opacity=0.3,
            flat_shading=True,
            cast_shadow=False,
            receive_shadow=False,
            position=block.position,
        )
