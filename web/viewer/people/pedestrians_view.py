"""Cylinders of pedestrians in the scene, around their mannequins.

The simulator and the policies use the cylinders only.
"""

import numpy as np
import viser

from app.live.snapshot import PersonSnapshot, WorldSnapshot
from app.sim.cells.cell import Cell
from app.sim.cells.colours import VESTS, Rgb
from web.viewer.capsules_view import HIT
from web.viewer.solid_meshes import disc, torus

OPACITY, HIT_OPACITY = 0.16, 0.4
FLOOR_OPACITY = 0.3
SAME_M = 2e-3
"""Largest change of position and radius that is not shown [m]."""


class PedestriansView:
    """Draws the cylinders; used by the live cell's thread only."""

    def __init__(self, server: viser.ViserServer, cell: Cell) -> None:
        self._scene, self._floor = server.scene, cell.floor_z
        self._drawn: dict[int, _Cylinder] = {}

    def draw(self, snapshot: WorldSnapshot) -> None:
        """Show the cylinders of a snapshot, the one in contact in red."""
        here = {one.id for one in snapshot.people if one.cylinder is not None}
        for id in self._drawn.keys() - here:
            self._drawn.pop(id).remove()
        contact = snapshot.contact if snapshot.status == "contact" else None
        for person in snapshot.people:
            if person.cylinder is None:
                continue
            if person.id not in self._drawn:
                self._drawn[person.id] = _Cylinder(self._scene, person, self._floor)
            near = person.clearance_m <= 0.0
            hit = near or (contact is not None and contact.person == person.id)
            self._drawn[person.id].draw(person, hit=hit)


class _Cylinder:
    """One cylinder of unit radius, scaled to the person's radius."""

    def __init__(self, scene: viser.SceneApi, person: PersonSnapshot, floor: float) -> None:
        assert person.cylinder is not None
        root, color = f"/cylinders/{person.id}", VESTS[person.id % len(VESTS)]
        self._color: Rgb = color
        self._key: tuple[float, float, float] | None = None
        self._frame = scene.add_frame(root, show_axes=False)
        height = person.cylinder.height
        self._side = scene.add_cylinder(
            f"{root}/side",
            radius=1.0,
            height=height,
            color=color,
            radial_segments=48,
            opacity=OPACITY,
            side="double",
            cast_shadow=False,
            receive_shadow=False,
            position=(0.0, 0.0, floor + 0.5 * height),
        )
        self._shade = scene.add_mesh_simple(
            f"{root}/floor",
            *disc(1.0),
            color=color,
            opacity=FLOOR_OPACITY,
            cast_shadow=False,
            position=(0.0, 0.0, floor + 0.008),
        )
        self._rims = [
            scene.add_mesh_simple(
                f"{root}/rim{k}",
                *torus(1.0, 0.02),
                color=color,
                cast_shadow=False,
                position=(0.0, 0.0, z),
            )
            for k, z in enumerate((floor + 0.01, floor + height))
        ]

    def remove(self) -> None:
        """Remove it from the scene."""
        self._frame.remove()

    def draw(self, person: PersonSnapshot, *, hit: bool) -> None:
        """Show it at the position of the person."""
        one = person.cylinder
        assert one is not None
        key = (one.x, one.y, one.radius)
        if self._key is None or np.abs(np.subtract(key, self._key)).max() > SAME_M:
            self._key = key
            self._frame.position = (one.x, one.y, 0.0)
            for part in (self._side, self._shade):
                part.scale = (one.radius, one.radius, 1.0)
            for rim in self._rims:
                rim.scale = (one.radius, one.radius, one.radius)
        color = HIT if hit else self._color
        self._side.color = self._shade.color = color
        self._side.opacity = HIT_OPACITY if hit else OPACITY
