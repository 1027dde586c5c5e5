"""Solids with bevelled edges and physically based materials, as binary glTF."""

from collections.abc import Sequence

import numpy as np
import trimesh
from trimesh.visual.material import PBRMaterial

from app.sim.core.arrays import Vec


def material(
    color: tuple[int, int, int], *, metallic: float = 0.0, roughness: float = 0.6
) -> PBRMaterial:
    """Return a physically based material.

    Args:
        color: Base colour, sRGB 0 to 255.
        metallic: 0 for paint and plastic, 1 for bare metal.
        roughness: 0 for a mirror, 1 for chalk.
    """
    linear = [round(255.0 * (channel / 255.0) ** 2.2) for channel in color]
    return PBRMaterial(  # type: ignore[no-untyped-call]
        baseColorFactor=(*linear, 255),
        metallicFactor=metallic,
        roughnessFactor=roughness,
        doubleSided=False,
    )


def creased(mesh: trimesh.Trimesh, angle: float) -> trimesh.Trimesh:
    """Return the mesh shaded smoothly except at edges of at least ``angle`` [rad]."""
    shaded: trimesh.Trimesh = trimesh.graph.smooth_shade(mesh, angle=angle, facet_minarea=None)
    shaded.metadata.clear()  # the groups of faces, which a glTF would carry
    return shaded


def block(size: Sequence[float], center: Sequence[float], bevel: float) -> trimesh.Trimesh:
    """Return a box with bevelled edges; sizes and centre in [m], shape (3,)."""
    return slab(size, center, 1.5 * bevel, bevel, sections=16)


def slab(
    size: Sequence[float],
    center: Sequence[float],
    radius: float,
    bevel: float,
    sections: int = 64,
) -> trimesh.Trimesh:
    """Return a plate with rounded corners and chamfered edges.

    Args:
        size: Edge lengths [m], shape (3,).
        center: Centre [m], shape (3,).
        radius: Radius of the four vertical edges [m].
        bevel: Width of the chamfer at top and bottom [m].
        sections: Points around the outline, a multiple of four.
    """
    half = 0.5 * np.asarray(size, dtype=np.float64)
    angles = 2.0 * np.pi * (np.arange(sections) + 0.5) / sections
    outline = np.column_stack([np.cos(angles), np.sin(angles)])
    middle = np.sign(outline) * (half[:2] - radius)
    levels = (
        (radius - bevel, -half[2]),
        (radius, bevel - half[2]),
        (radius, half[2] - bevel),
        (radius - bevel, half[2]),
    )
    rings = [np.column_stack([middle + r * outline, np.full(sections, z)]) for r, z in levels]
    mesh: trimesh.Trimesh = trimesh.convex.convex_hull(np.vstack(rings))
    mesh.apply_translation(center)
    mesh.unmerge_vertices()  # so that edges stay crisp
    return mesh


def rod(base: Sequence[float], height: float, radius: float) -> trimesh.Trimesh:
    """Return an upright cylinder on ``base`` [m], shape (3,), with a smooth side."""
    cylinder = trimesh.creation.cylinder(radius, height, sections=40)
    cylinder.apply_translation(np.asarray(base) + (0.0, 0.0, 0.5 * height))
    return creased(cylinder, 1.0)


def painted(pieces: Sequence[tuple[trimesh.Trimesh, PBRMaterial]]) -> bytes:
    """Return meshes with their materials as one binary glTF."""
    scene = trimesh.Scene()
    for mesh, paint in pieces:
        mesh.visual = trimesh.visual.TextureVisuals(material=paint)  # type: ignore[no-untyped-call]
        scene.add_geometry(mesh)
    data = scene.export(file_type="glb", include_normals=True)  # type: ignore[no-untyped-call]
    assert isinstance(data, bytes)
    return data


def torus(radius: float, thickness: float) -> tuple[Vec, Vec]:
    """Return vertices [m] and faces of a ring in the xy plane."""
    ring = trimesh.creation.torus(radius, thickness, major_sections=64, minor_sections=12)
    return np.asarray(ring.vertices), np.asarray(ring.faces)


def disc(radius: float) -> tuple[Vec, Vec]:
    """Return vertices [m] and faces of a disc in the xy plane, facing up."""
    angles = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
    return fan(radius * np.column_stack([np.cos(angles), np.sin(angles)]), 0.0)


def fan(outline: Vec, z: float) -> tuple[Vec, Vec]:
    """Return vertices [m] and faces of the area in an outline, shape (n, 2), at a height."""
    n = len(outline)
    vertices = np.column_stack([[*outline, outline.mean(axis=0)], np.full(n + 1, z)])
    index = np.arange(n)
    return vertices, np.column_stack([np.full(n, n), index, (index + 1) % n])
