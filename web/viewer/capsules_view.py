"""Collision capsules over the drawn bodies: translucent, red in contact."""

from collections.abc import Collection, Sequence

import numpy as np
import trimesh
import viser
from trimesh.geometry import align_vectors

from app.sim.core.arrays import Vec
from web.viewer.poses import orientation

STIFF_M = 1e-3
"""Largest change of a capsule's length that is not shown [m]."""
SHAPES, TOUCHED = "/shapes", "/touched"
"""Parent nodes: capsules that a visitor may hide, and capsules in contact, always shown."""
SHAPE, HIT = (64, 150, 190), (224, 44, 40)
OPACITY, HIT_OPACITY = 0.32, 0.65


class CapsulesView:
    """Capsules placed by their end points, and stretched when their length changes.

    Args:
        owner: Name of the body that they belong to; part of the names of their nodes.
    """

    def __init__(self, server: viser.ViserServer, owner: str) -> None:
        self._scene, self._owner = server.scene, owner
        self._handles: dict[str, viser.MeshHandle] = {}
        self._hits: dict[str, viser.MeshHandle] = {}
        self._sizes: dict[str, tuple[float, float]] = {}
        self._ends: Vec | None = None
        self._placed = False

    def fit(self, names: Sequence[str], radii: Vec, ends: Vec) -> None:
        """Replace all capsules by others, hidden at first.

        Args:
            names: Names, unique in this view.
            radii: Radii [m], shape (n,).
            ends: End points, of which only the distances count [m], shape (n, 2, 3).
        """
        for handle in (*self._handles.values(), *self._hits.values()):
            handle.remove()
        self._handles, self._hits, self._ends = {}, {}, None
        lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        pairs = zip(radii.tolist(), lengths.tolist(), strict=True)
        self._sizes = dict(zip(names, pairs, strict=True))
        for name in names:
            node = f"{SHAPES}/{self._owner}/{name}"
            self._handles[name] = self._add(node, name, SHAPE, OPACITY)
            self._handles[name].visible = False

    def _add(
        self, node: str, name: str, color: tuple[int, int, int], opacity: float
    ) -> viser.MeshHandle:
        radius, length = self._sizes[name]
        mesh = trimesh.creation.capsule(height=length, radius=radius, count=(24, 14))
        return self._scene.add_mesh_simple(
            node,
            np.asarray(mesh.vertices),
            np.asarray(mesh.faces),
            color=color,
            opacity=opacity,
            cast_shadow=False,
            receive_shadow=False,
        )

    def place(self, ends: Vec) -> None:
        """Place the capsules; poses are sent only while the capsules are shown.

        Args:
            ends: End points in world [m], shape (n, 2, 3), in the order of their names.
        """
        self._ends, self._placed = ends, False

    def show(self, visible: bool, touched: Collection[str]) -> None:
        """Show all or none; those named in ``touched`` are always shown, in red."""
        for handle in self._handles.values():
            handle.visible = visible
        for name in self._hits.keys() - set(touched):
            self._hits.pop(name).remove()
        for name in self._handles.keys() & set(touched) - self._hits.keys():
            node = f"{TOUCHED}/{self._owner}/{name}"
            self._hits[name], self._placed = self._add(node, name, HIT, HIT_OPACITY), False
        if (visible or self._hits) and not self._placed and self._ends is not None:
            self._send(self._ends)

    def _send(self, ends: Vec) -> None:
        self._placed = True
        frames = [
            align_vectors((0.0, 0.0, 1.0), end - start)  # type: ignore[no-untyped-call]
            for start, end in ends
        ]
        turns = orientation(np.stack(frames)[:, :3, :3])
        for name, turn, pair in zip(self._handles, turns, ends, strict=True):
            radius, length = self._sizes[name]
            now = float(np.linalg.norm(pair[1] - pair[0]))
            stretch = (now + 2.0 * radius) / (length + 2.0 * radius)
            scale = (1.0, 1.0, stretch if abs(now - length) > STIFF_M else 1.0)
            for handle in (self._handles[name], self._hits.get(name)):
                if handle is not None:
                    handle.wxyz, handle.position = turn, pair.mean(axis=0)
                    handle.scale = scale
