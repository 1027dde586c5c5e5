"""Meshes and colours of blocks, towers and clutter slots."""

from functools import lru_cache

import trimesh

from app.sim.cells.colours import FAILURES, TRAY, Rgb, blend
from app.sim.core.arrays import Vec
from web.viewer.solid_meshes import material, painted, rod, slab

RIM = material((160, 167, 175), metallic=0.3, roughness=0.45)
PLATE_SIDE = 0.16
"""Side of a tower's base plate [m]."""
GHOST_GROWTH = 1.02
"""Factor by which a goal block is drawn larger, to be visible around a real block."""


def failure_color(chance: float) -> Rgb:
    """Return the colour of a clutter slot with a failure probability."""
    return blend(FAILURES, chance)


@lru_cache(maxsize=64)
def block_body(color: Rgb, half_size: tuple[float, float, float]) -> bytes:
    """Return a block with a steel disc on top for the magnet, as binary glTF.

    Args:
        color: Colour of the block, 0 to 255.
        half_size: Half of length, width and height [m]; the origin is the centre.
    """
    x, y, z = half_size
    disc = rod((0.0, 0.0, z - 0.001), 0.0014, 0.42 * min(x, y))
    return painted(
        [
            (_block(half_size), material(color, roughness=0.5)),
            (disc, material((214, 217, 221), metallic=0.4, roughness=0.35)),
        ]
    )


@lru_cache(maxsize=16)
def ghost_body(half_size: tuple[float, float, float]) -> trimesh.Trimesh:
    """Return the surface of a missing goal block; sizes as in :func:`block_body`."""
    x, y, z = half_size
    return _block((GHOST_GROWTH * x, GHOST_GROWTH * y, 0.98 * z))


def _block(half_size: tuple[float, float, float]) -> trimesh.Trimesh:
    x, y, z = half_size
    bevel = min(0.003, 0.3 * z)
    return slab((2 * x, 2 * y, 2 * z), (0.0, 0.0, 0.0), 0.3 * min(x, y), bevel, sections=32)


def tower_plate(color: Rgb, height: float) -> bytes:
    """Return the plate under a tower: grey, with a top in the tower's colour, as glTF.

    Its top is ``height`` [m] over the table.
    """
    side, top = PLATE_SIDE, 0.004
    red, green, blue = (round(0.72 * channel + 66) for channel in color)
    return painted(
        [
            (slab((side, side, height), (0.0, 0.0, 0.5 * height), 0.02, 0.002), RIM),
            (
                slab((side - 0.012, side - 0.012, top), (0.0, 0.0, height), 0.016, 0.001),
                material((red, green, blue), roughness=0.65),
            ),
        ]
    )


def tray(points: Vec, height: float, margin: float) -> bytes:
    """Return the plate under all clutter slots as binary glTF.

    Args:
        points: Positions of the slots [m], shape (n, 2).
        height: Its top over the table [m].
        margin: Distance from the outermost slots to its edges [m].
    """
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    size, center = high - low, 0.5 * (low + high)
    body = slab((*size, height), (*center, 0.5 * height), 0.02, 0.002)
    return painted([(body, material(TRAY, roughness=0.6))])


def tile(width: float, depth: float) -> trimesh.Trimesh:
    """Return a clutter slot as a thin plate on z = 0, sizes in [m]."""
    return slab((width, depth, 0.002), (0.0, 0.0, 0.001), 0.012, 0.0006, sections=32)
