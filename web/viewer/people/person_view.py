"""One person in the scene: mannequin, feet and collision capsules.

A skinned mesh is never removed. When one is removed, viser's client (1.1.1) compares its
node with ``undefined`` although it is ``null``, and the error ends the drawing in every open
window. A person that leaves is therefore hidden, and shown again when its number is reused. For
a person of another size the meshes are added under the same names, which the client handles as
an update.
"""

import numpy as np
import viser

from app.live.snapshot import PersonSnapshot
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.human.kernels.kinematics import GIRTH, PELVIS_Z
from web.viewer.capsules_view import CapsulesView
from web.viewer.people import mannequin, skeleton
from web.viewer.people.gait import Gait
from web.viewer.poses import orientation

SAME_M = 1e-4
"""Difference below which two lengths are equal [m]."""


class PersonView:
    """Draws one person; used by the live cell's thread only."""

    def __init__(self, server: viser.ViserServer, cell: Cell, person: PersonSnapshot) -> None:
        self._scene, self._cell, self._id = server.scene, cell, person.id
        self._root = f"/people/{person.id}"
        self._gait = Gait(cell.floor_z)
        self._skins: list[tuple[viser.MeshSkinnedHandle, tuple[str, ...]]] = []
        self._drawn: tuple[Vec, Vec] | None = None
        self._frame = self._scene.add_frame(self._root, show_axes=False)
        self._solids: list[tuple[viser.MeshHandle, str]] = []
        self.capsules = CapsulesView(server, f"people/{person.id}")
        """Its collision capsules."""
        self._lengths = self._fitted = _lengths(person.size)
        self._fit(person)

    def hide(self) -> None:
        """Hide the person."""
        self._frame.visible = False
        self.capsules.show(False, ())

    def show(self, person: PersonSnapshot) -> None:
        """Show a hidden person, or another person with the same number."""
        self._gait = Gait(self._cell.floor_z)
        self._drawn = None
        self._lengths = _lengths(person.size)
        if not _same(self._lengths, self._fitted):
            self._fit(person)
        self._frame.visible = True

    def _fit(self, person: PersonSnapshot) -> None:
        """Fit the mannequin to the size of the person."""
        self._fitted = _lengths(person.size)
        bind = skeleton.bind_bones(person.size)
        self._skins = [
            self._add_skin(part, person.size, bind)
            for part in mannequin.parts()
            if part.bone is None
        ]
        scale = skeleton.scales(person.size)
        self._solids = [
            (self._add_solid(part, scale[part.bone]), part.bone)
            for part in mannequin.parts()
            if part.bone is not None
        ]
        upright = human.rest_posture(0.0, 0.0, 0.0)
        ends = human.capsules(upright, person.size, self._cell.floor_z)
        self.capsules.fit(human.CAPSULE_NAMES, human.capsule_radii(person.size), ends)
        self._drawn = None

    def _add_skin(
        self, part: mannequin.Part, size: Vec, bind: skeleton.Bones
    ) -> tuple[viser.MeshSkinnedHandle, tuple[str, ...]]:
        names = tuple(part.weights)
        frames = np.stack([bind[name] for name in names])
        handle = self._scene.add_mesh_skinned(
            f"{self._root}/{part.name}",
            mannequin.fitted(part, size),
            part.surface.faces,
            bone_wxyzs=orientation(frames[:, :3, :3]),
            bone_positions=frames[:, :3, 3],
            skin_weights=np.stack([part.weights[name] for name in names], axis=1),
            color=mannequin.color_of(part, self._id),
        )
        return handle, names

    def _add_solid(self, part: mannequin.Part, scale: Vec) -> viser.MeshHandle:
        return self._scene.add_mesh_simple(
            f"{self._root}/{part.name}",
            part.surface.vertices * scale,
            part.surface.faces,
            color=part.color,
        )

    def draw(self, person: PersonSnapshot, dt: float) -> None:
        """Show the person; the feet step on for ``dt`` [s], the time since the last call."""
        self._follow_size(person)
        q, size = person.posture, person.size
        pelvis = human.body_frames(q, size)["pelvis"]
        walking = self._gait.follow(pelvis, dt, float(size[GIRTH]))
        if not walking and self._drawn is not None:
            if np.array_equal(q, self._drawn[0]) and np.array_equal(size, self._drawn[1]):
                return
        self._drawn = q.copy(), size.copy()
        bones = skeleton.bones(q, size, self._gait.feet)
        for skin, names in self._skins:
            frames = np.stack([bones[name] for name in names])
            turns = orientation(frames[:, :3, :3])
            for bone, turn, frame in zip(skin.bones, turns, frames, strict=True):
                bone.wxyz, bone.position = turn, frame[:3, 3]
        for solid, name in self._solids:
            solid.wxyz = orientation(bones[name][:3, :3])
            solid.position = bones[name][:3, 3]
        self.capsules.place(human.capsules(q, size, self._cell.floor_z))

    def _follow_size(self, person: PersonSnapshot) -> None:
        """Fit the skin when the size is constant; before that only the bones move."""
        lengths, before = _lengths(person.size), self._lengths
        self._lengths = lengths
        if _same(lengths, before) and not _same(lengths, self._fitted):
            self._fit(person)


def _lengths(size: Vec) -> Vec:
    """Return a size without the pelvis height, which changes during motion."""
    return np.delete(size, PELVIS_Z)


def _same(a: Vec, b: Vec) -> bool:
    return bool(np.abs(a - b).max() < SAME_M)
