"""Cubes and docks in the scene: coloured, labelled, clickable.

A label shows rank and value of a candidate. Other stations are grey. A ring marks the selected
candidate.
"""

import time
from collections.abc import Callable

import numpy as np
import trimesh
import viser

from app.live.commands import ToggleCandidate
from app.live.snapshot import CandidateSnapshot, WorldSnapshot
from app.live.status_messages import value_text
from app.sim.cells.cell import Cell
from app.sim.cells.colours import TARGET, Rgb
from app.sim.cells.parts import Station
from app.sim.cells.support import support_height
from web.viewer.solid_meshes import block, disc, slab, torus

CUBE_SIDE, DOCK_SIDE = 0.07, 0.15
GOALS: tuple[Rgb, ...] = (
    (49, 119, 220),
    (206, 100, 0),
    (0, 146, 159),
    (167, 76, 193),
    (140, 131, 0),
    (211, 45, 72),
    (146, 94, 50),
    (42, 144, 75),
    (202, 87, 148),
    (98, 108, 196),
)
"""Colours of the goals, in the cell's order; the same as GOALS in ``web/page/palette.js``."""
IDLE: Rgb = (196, 202, 210)
PERIOD_S = 0.25
"""Time between two updates of the values in labels [s]."""


class StationsView:
    """Draws the stations of one cell; used by the live cell's thread only."""

    def __init__(
        self, server: viser.ViserServer, cell: Cell, submit: Callable[[ToggleCandidate], object]
    ) -> None:
        self._scene, self._cell, self._submit = server.scene, cell, submit
        self._stations = [one for one in cell.stations if one.kind in ("cube", "dock")]
        self._bodies = {station.id: self._add_body(station) for station in self._stations}
        self._labels = {station.id: self._add_label(station) for station in self._stations}
        self._marker = self._add_marker()
        self._key: tuple[object, ...] = ()
        self._next = 0.0

    def _add_body(self, station: Station) -> viser.MeshHandle:
        x, y, _ = station.position
        mesh = _cube() if station.kind == "cube" else _dock()
        body = self._scene.add_mesh_simple(
            f"/stations/{station.id}",
            np.asarray(mesh.vertices),
            np.asarray(mesh.faces),
            color=IDLE,
            flat_shading=True,
            cast_shadow=station.kind == "cube",
            position=(x, y, support_height(self._cell, station.position)),
        )
        name = station.id

        async def toggle(_: object) -> None:
            self._submit(ToggleCandidate(id=name))

        body.on_click(toggle)
        return body

    def _add_label(self, station: Station) -> viser.LabelHandle:
        x, y, _ = station.position
        height = support_height(self._cell, station.position)
        height += CUBE_SIDE + 0.035 if station.kind == "cube" else 0.05
        return self._scene.add_label(
            f"/labels/{station.id}",
            station.label,
            position=(x, y, height),
            anchor="bottom-center",
            font_screen_scale=0.95,
        )

    def _add_marker(self) -> viser.FrameHandle:
        marker = self._scene.add_frame("/chosen", show_axes=False, visible=False)
        self._scene.add_mesh_simple(
            "/chosen/ring",
            *torus(0.085, 0.0055),
            color=TARGET,
            position=(0, 0, 0.006),
            cast_shadow=False,
        )
        self._scene.add_mesh_simple(
            "/chosen/glow",
            *disc(0.083),
            color=TARGET,
            opacity=0.22,
            position=(0.0, 0.0, 0.003),
            cast_shadow=False,
        )
        return marker

    def draw(self, snapshot: WorldSnapshot) -> None:
        """Show the selected candidate at once, and ranks and values every ``PERIOD_S``."""
        key = (snapshot.chosen, tuple(c.id for c in snapshot.candidates))
        if key == self._key and time.monotonic() < self._next:
            return
        self._key, self._next = key, time.monotonic() + PERIOD_S
        offered = {candidate.id: candidate for candidate in snapshot.candidates}
        values = list(snapshot.values.values())
        for index, station in enumerate(self._stations):
            candidate = offered.get(station.id)
            body, label = self._bodies[station.id], self._labels[station.id]
            body.color = IDLE if candidate is None else GOALS[index % len(GOALS)]
            label.text = _text(station, candidate, values)
            label.visible = candidate is not None
        self._mark(snapshot.chosen if snapshot.chosen in self._bodies else None)

    def _mark(self, chosen: str | None) -> None:
        self._marker.visible = chosen is not None
        if chosen is not None:
            x, y, z = self._cell.station(chosen).position
            self._marker.position = (x, y, support_height(self._cell, (x, y, z)))


def _text(station: Station, candidate: CandidateSnapshot | None, values: list[float]) -> str:
    if candidate is None or candidate.value is None:
        return station.label
    sign = "\N{BLACK RIGHT-POINTING SMALL TRIANGLE} " if candidate.chosen else ""
    rank = 1 + sum(value > candidate.value for value in values)
    return f"{sign}{rank}. {station.label}  {value_text(candidate.value, 1)}"


def _cube() -> trimesh.Trimesh:
    side = CUBE_SIDE
    return block((side, side, side), (0.0, 0.0, 0.5 * side), 0.005)


def _dock() -> trimesh.Trimesh:
    """Return a tray with a raised rim of four bars."""
    side, bar = DOCK_SIDE, 0.012
    pieces = [slab((side, side, 0.006), (0.0, 0.0, 0.003), 0.012, 0.002)]
    for sign in (-1.0, 1.0):
        at = sign * 0.5 * (side - bar)
        pieces.append(block((bar, side, 0.016), (at, 0.0, 0.008), 0.002))
        pieces.append(block((side, bar, 0.016), (0.0, at, 0.008), 0.002))
    mesh = trimesh.util.concatenate(pieces)
    assert isinstance(mesh, trimesh.Trimesh)
    return mesh
