"""The person in the scene: the mannequin, its feet, and the simulator's capsules over it."""

import numpy as np
import trimesh
import viser

from app.sim import human
from app.sim.cells import Cell
from web import mannequin, skeleton
from web.gait import Gait
from web.poses import Vec, orientation

OVERLAY = (255, 86, 86)


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
        self._capsules: list[viser.MeshHandle] = []
        self._drawn: Vec | None = None
        self._scene.add_frame("/person", show_axes=False)
        bind = skeleton.bind_bones()
        for part in mannequin.parts():
            if part.bone is None:
                self._add_skin(part, bind)
            else:
                self._solids.append((self._add_solid(part), part.bone))
        self._add_capsules()

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

    def _add_capsules(self) -> None:
        self._scene.add_frame("/person/capsules", show_axes=False, visible=False)
        ends = human.capsules(human.rest_posture(0.0, 0.0, 0.0), self._cell.pelvis_z, self._cell.floor_z)
        for name, radius, (start, end) in zip(
            human.CAPSULE_NAMES, human.CAPSULE_RADII, ends, strict=True
        ):
            length = float(np.linalg.norm(end - start))
            mesh = trimesh.creation.capsule(height=length, radius=float(radius), count=(20, 12))
            mesh.apply_translation((0.0, 0.0, -0.5 * length))
            self._capsules.append(
                self._scene.add_mesh_simple(
                    f"/person/capsules/{name}",
                    np.asarray(mesh.vertices),
                    np.asarray(mesh.faces),
                    color=OVERLAY,
                    opacity=0.3,
                    cast_shadow=False,
                    receive_shadow=False,
                )
            )

    def draw(self, q: Vec, dt: float) -> None:
        """Show the person in a posture.

        Args:
            q: Joint positions [m, rad], shape (18,).
            dt: Time since the last call [s], for the steps of the feet.
        """
        pelvis = human.body_frames(q, self._cell.pelvis_z)["pelvis"]
        walking = self._gait.follow(pelvis, dt)
        if not walking and self._drawn is not None and np.array_equal(q, self._drawn):
            return
        self._drawn = q.copy()
        bones = skeleton.bones(q, self._cell.pelvis_z, self._gait.feet)
        for skin, names in self._skins:
            frames = np.stack([bones[name] for name in names])
            turns = orientation(frames[:, :3, :3])
            for bone, turn, frame in zip(skin.bones, turns, frames, strict=True):
                bone.wxyz, bone.position = turn, frame[:3, 3]
        for solid, name in self._solids:
            solid.wxyz = orientation(bones[name][:3, :3])
            solid.position = bones[name][:3, 3]
        self._draw_capsules(q)

    def _draw_capsules(self, q: Vec) -> None:
        ends = human.capsules(q, self._cell.pelvis_z, self._cell.floor_z)
        for handle, (start, end) in zip(self._capsules, ends, strict=True):
            handle.position = 0.5 * (start + end)
            handle.wxyz = orientation(_turn_onto(end - start))

    def show_capsules(self, visible: bool) -> None:
        """Show or hide the simulator's capsules."""
        self._scene.get_handle_by_name("/person/capsules").visible = visible  # type: ignore


def _turn_onto(direction: Vec) -> Vec:
    """Return a rotation whose z axis points along ``direction``, shape (3, 3)."""
    z = direction / np.linalg.norm(direction)
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.9 else [1.0, 0.0, 0.0], z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])
