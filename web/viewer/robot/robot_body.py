"""Visual meshes of the UR10, of the gripper and of the magnet.

The meshes are example-robot-data's ``.dae`` visuals in each link's frame, read once per
process. They are repainted. The gripper is drawn around the tool capsule of the simulator.
"""

from functools import lru_cache

import fast_simplification
import numpy as np
import trimesh

from app.sim.cells import colours
from app.sim.robot.ur10 import LINK_NAMES, package_dir
from web.viewer.solid_meshes import block, creased, material, painted, rod

_FILES = dict(
    zip(
        LINK_NAMES,
        ("base", "shoulder", "upperarm", "forearm", "wrist1", "wrist2", "wrist3"),
        strict=True,
    )
)

ALUMINIUM = material(colours.ALUMINIUM, metallic=0.15, roughness=0.42)
CAP = material(colours.JOINT, metallic=0.05, roughness=0.35)
RUBBER = material((58, 62, 70), roughness=0.55)
STEEL = material((150, 155, 162), metallic=0.3, roughness=0.35)
ACCENT = material(colours.TOOL, roughness=0.5)

_PAINT = {57: ALUMINIUM, 100: CAP, 118: RUBBER, 95: RUBBER, 167: STEEL, 20: RUBBER}
"""Material by the red channel of the colour in the file, which identifies the part."""
DENSE, KEPT = 4000, 0.15
"""Number of triangles above which a piece is simplified, and the share that it keeps.

The files resolve bolts to 2 mm. The scene is drawn four times per picture, three times for
shadows; without a graphics processor the simplified pieces are drawn 7 times faster.
"""
CREASE = 0.6
"""Angle between two faces from which their edge is shaded as a crease [rad]."""


@lru_cache(maxsize=1)
def link_meshes() -> dict[str, bytes]:
    """Return each link's visual as binary glTF, in the link's frame."""
    folder = package_dir() / "example-robot-data/robots/ur_description/meshes/ur10/visual"
    out = {}
    for link, name in _FILES.items():
        scene = trimesh.load_scene(folder / f"{name}.dae")
        pieces = []
        for part in scene.geometry.values():
            paint = _PAINT[int(part.visual.material.main_color[0])]
            pieces.append((_welded(part), paint))
        out[link] = painted(pieces)
    return out


def _welded(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return the mesh with shared vertices, few triangles, shaded smoothly except at creases.

    In the files every face has its own vertices. Here faces that meet at less than ``CREASE``
    share a vertex, whose normal is the mean of their normals, weighted by area.
    """
    points, index = np.unique(mesh.vertices.round(4), axis=0, return_inverse=True)
    faces = index.reshape(-1)[mesh.faces]
    faces = faces[(np.diff(np.sort(faces, axis=1), axis=1) > 0).all(axis=1)]
    if len(faces) > DENSE:
        points, faces = fast_simplification.simplify(points, faces, 1.0 - KEPT, agg=3)
    solid = trimesh.Trimesh(vertices=points, faces=faces, process=False)
    shaded = creased(solid, CREASE)
    weighted = shaded.face_normals * shaded.area_faces[:, None]
    normals = trimesh.unitize(shaded.faces_sparse @ weighted)
    return trimesh.Trimesh(
        vertices=shaded.vertices, faces=shaded.faces, vertex_normals=normals, process=False
    )


@lru_cache(maxsize=4)
def gripper_body(tool_length: float, tool_radius: float) -> bytes:
    """Return the gripper without fingers, in the frame of ``tool0``, as binary glTF.

    Args:
        tool_length: From flange to tcp along z [m].
        tool_radius: Radius of the simulator's tool capsule [m].
    """
    palm = 0.46 * tool_length
    pieces = [
        (rod((0, 0, 0), 0.014, 0.95 * tool_radius), STEEL),
        (rod((0, 0, 0.014), 0.008, 0.8 * tool_radius), ACCENT),
        (
            block(
                (1.9 * tool_radius, 1.3 * tool_radius, palm - 0.02),
                (0, 0, 0.5 * palm + 0.012),
                0.006,
            ),
            RUBBER,
        ),
        (
            block((2.5 * tool_radius, 0.9 * tool_radius, 0.012), (0, 0, palm + 0.006), 0.003),
            STEEL,
        ),
    ]
    return painted(pieces)


@lru_cache(maxsize=4)
def gripper_finger(tool_length: float) -> bytes:
    """Return one finger in its own frame: the pad faces -x, the tip ends beyond the tcp."""
    palm, tip = 0.46 * tool_length + 0.012, tool_length + 0.012
    length = tip - palm
    pieces = [
        (block((0.012, 0.024, length), (0.006, 0, palm + 0.5 * length), 0.003), STEEL),
        (block((0.006, 0.026, 0.03), (-0.002, 0, tip - 0.016), 0.002), RUBBER),
    ]
    return painted(pieces)


@lru_cache(maxsize=4)
def magnet_body(tool_length: float, tool_radius: float) -> bytes:
    """Return a round lifting magnet; sizes and frame as in :func:`gripper_body`."""
    face = 0.022
    neck = tool_length - face - 0.022
    return painted(
        [
            (rod((0, 0, 0), 0.014, 0.95 * tool_radius), STEEL),
            (rod((0, 0, 0.014), 0.008, 0.8 * tool_radius), ACCENT),
            (rod((0, 0, 0.022), neck, 0.5 * tool_radius), RUBBER),
            (rod((0, 0, tool_length - face), face - 0.003, 0.9 * tool_radius), RUBBER),
            (rod((0, 0, tool_length - 0.003), 0.003, 0.7 * tool_radius), STEEL),
        ]
    )
