"""The person in the scene: the mannequin, its feet, and the simulator's capsules over it."""

import numpy as np
import viser

from app.sim import human
from app.sim.cells import Cell
from web import mannequin, skeleton
from web.capsules_view import CapsulesView
from web.gait import Gait
from web.poses import Vec, orientation


class PersonView:
    """Draws one person; used by the live cell's thread only.

    Args:
        server: Where to draw.
        cell: Where the floor is and how high the pelvis.
    """

    def __init__(self, server: viser.ViserServer, cell: Cell) -> None:
        self._scene, self._cell = server.scene, cell
        self._gait = Gait(cell.floor_z)
        self._skins: list[tuple[viser.MeshSkinnedHandle, tuple[str, ...]]] = []
        self._solids: list[tuple[viser.MeshHandle, str]] = []
        self._drawn: Vec | None = None
        self._scene.add_frame("/person", show_axes=False)
        bind = skeleton.bind_bones()
        for part in mannequin.parts():
            if part.bone is None:
                self._add_skin(part, bind)
            else:
                self._solids.append((self._add_solid(part), part.bone))
        rest = human.rest_posture(0.0, 0.0, 0.0)
        ends = human.capsules(rest, cell.body, cell.floor_z)
        self._capsules = CapsulesView(server, "/person/shapes")
        for name, radius, (start, end) in zip(
            human.CAPSULE_NAMES, human.CAPSULE_RADII, ends, strict=True
        ):
            self._capsules.add(name, float(radius), float(np.linalg.norm(end - start)))

    def _add_skin(self, part: mannequin.Part, bind: skeleton.Bones) -> None:
        names = tuple(part.weights)
        frames = np.stack([bind[name] for name in names])
        handle = self._scene.add_mesh_skinned(
            f"/person/{part.name}",
            part.surface.vertices,
            part.surface.faces,
            bone_wxyzs=orientation(frames[:, :3, :3]),
            bone_positions=frames[:, :3, 3],
            skin_weights=np.stack([part.weights[name] for name in names], axis=1),
            color=part.color,
        )
        self._skins.append((handle, names))

    def _add_solid(self, part: mannequin.Part) -> viser.MeshHandle:
        return self._scene.add_mesh_simple(
            f"/person/{part.name}",
            part.surface.vertices,
            part.surface.faces,
            color=part.color,
        )

    def draw(self, q: Vec, dt: float) -> None:
        """Show the person in a posture.

        Args:
            q: Joint positions [m, rad], shape (18,).
            dt: Time since the last call [s], for the steps of the feet.
        """
        pelvis = human.body_frames(q, self._cell.body)["pelvis"]
        walking = self._gait.follow(pelvis, dt)
        if not walking and self._drawn is not None and np.array_equal(q, self._drawn):
            return
        self._drawn = q.copy()
        bones = skeleton.bones(q, self._cell.body, self._gait.feet)
        for skin, names in self._skins:
            frames = np.stack([bones[name] for name in names])
            turns = orientation(frames[:, :3, :3])
            for bone, turn, frame in zip(skin.bones, turns, frames, strict=True):
                bone.wxyz, bone.position = turn, frame[:3, 3]
        for solid, name in self._solids:
            solid.wxyz = orientation(bones[name][:3, :3])
            solid.position = bones[name][:3, 3]
        self._capsules.place(human.capsules(q, self._cell.body, self._cell.floor_z))

    def show_capsules(self, visible: bool, touched: str | None) -> None:
        """Show or hide the simulator's capsules; the one that was touched stays, red."""
        self._capsules.show(visible, () if touched is None else (touched,))
