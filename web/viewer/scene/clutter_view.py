"""Clutter slots in the scene, coloured by failure probability: tiles on a tray."""

import numpy as np
import viser

from app.live.status_messages import percent_text
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from web.viewer.scene.sorting_bodies import failure_color, tile, tray

GAP = 0.012
"""Distance between two tiles [m]."""
LONE_M = 0.18
"""Side of the tile of a slot without neighbours [m]."""
DRAWN_M = 0.004
"""Least height of the tray over the table [m]."""


def tray_height(cell: Cell) -> float:
    """Return the height of the tray above the table, that of the lowest blocks' underside [m].

    The tool reaches a block's top at its station; a block is one level high.
    """
    towers = cell.stations_of("cluster")
    levels = [one.position[2] - (one.level_height or 0.0) for one in towers]
    return max(DRAWN_M, min(levels, default=0.0))


class ClutterView:
    """Draws the clutter slots; used by the live cell's thread only."""

    def __init__(self, server: viser.ViserServer, cell: Cell) -> None:
        scene, height = server.scene, tray_height(cell)
        stations = cell.stations_of("clutter")
        points = np.array([one.position[:2] for one in stations])
        width, depth = _spacing(points[:, 0]), _spacing(points[:, 1])
        body = tray(points, height, 0.5 * max(width, depth) + 0.002)
        scene.add_glb("/clutter", body, cast_shadow=False)
        mesh = tile(width - GAP, depth - GAP)
        self._slots: list[tuple[viser.MeshHandle, viser.LabelHandle]] = []
        for index, (x, y) in enumerate(points.tolist()):
            surface = scene.add_mesh_simple(
                f"/clutter/{index}",
                np.asarray(mesh.vertices),
                np.asarray(mesh.faces),
                color=failure_color(0.0),
                flat_shading=True,
                cast_shadow=False,
                position=(x, y, height - 0.0004),
            )
            label = scene.add_label(
                f"/chances/{index}",
                "",
                position=(x + 0.5 * width - 0.026, y, height + 0.012),
                anchor="center-center",
                font_screen_scale=0.7,
                depth_test=True,
            )
            self._slots.append((surface, label))
        self._shown: tuple[float, ...] | None = None

    def draw(self, failure: tuple[float, ...]) -> None:
        """Show the failure probability of each slot."""
        if failure == self._shown:
            return
        self._shown = failure
        for (surface, label), chance in zip(self._slots, failure, strict=True):
            surface.color = failure_color(chance)
            label.text = percent_text(chance)


def _spacing(values: Vec) -> float:
    """Return the smallest difference between two different coordinates [m]."""
    steps = np.diff(np.unique(values.round(3)))
    return float(steps.min()) if len(steps) else LONE_M
