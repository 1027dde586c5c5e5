"""Smooth surfaces from round cones, for the model of the person.

A body part is the smooth union of round cones (capsules with two radii, optionally flattened),
sampled as a distance field on a grid and meshed by marching cubes. Each cone is evaluated only
where it can matter, so that a whole person takes well under a second.

Source: I. Quilez, "distance functions" and "smooth minimum" (polynomial form).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates
from skimage.measure import marching_cubes

from app.sim.core.arrays import Vec
from web.viewer.people.mannequin import Surface

Field = Callable[[Vec], Vec]
"""Maps points (..., 3) [m] to distances [m]; negative inside."""


@dataclass(frozen=True, slots=True)
class Cone:
    """A round cone: the hull of two balls, flattened along the axes by ``flat``."""

    start: tuple[float, float, float]
    """Centre of the first ball [m]."""
    end: tuple[float, float, float]
    """Centre of the second ball [m]."""
    r_start: float
    """Radius of the first ball [m]."""
    r_end: float
    """Radius of the second ball [m]."""
    flat: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Scale along x, y, z about the middle of the cone."""
    blend: float = 0.04
    """Width of the smooth union with the preceding cones [m]."""

    def distance(self, points: Vec) -> Vec:
        """Return the distance of points (..., 3) from the surface [m]."""
        start, end, flat = np.array(self.start), np.array(self.end), np.array(self.flat)
        middle = 0.5 * (start + end)
        local = (points - middle) / flat
        a, axis = (start - middle) / flat, (end - start) / flat
        length2 = float(axis @ axis)
        t = np.clip((local - a) @ axis / length2, 0.0, 1.0) if length2 > 0.0 else 0.0
        t = np.asarray(t)[..., None]
        radius = (self.r_start + t * (self.r_end - self.r_start))[..., 0]
        gap = np.linalg.norm(local - a - t * axis, axis=-1) - radius
        return np.asarray(gap * flat.min())

    def bounds(self, margin: float) -> tuple[Vec, Vec]:
        """Return the corners of a box that holds the cone and ``margin`` [m] around it."""
        grow = max(self.r_start, self.r_end) * np.array(self.flat) + margin
        ends = np.array([self.start, self.end])
        return ends.min(axis=0) - grow, ends.max(axis=0) + grow


def smooth_min(a: Vec, b: Vec, width: float) -> Vec:
    """Return the polynomial smooth minimum of two distance fields [m]."""
    h = np.maximum(width - np.abs(a - b), 0.0) / width
    return np.asarray(np.minimum(a, b) - 0.25 * width * h * h)


class Grid:
    """A box of sample points.

    Args:
        low: Lower corner [m], shape (3,).
        high: Upper corner [m], shape (3,).
        spacing: Distance of neighbouring points [m].
    """

    def __init__(self, low: Sequence[float], high: Sequence[float], spacing: float) -> None:
        self.low, self.spacing = np.array(low, dtype=np.float64), spacing
        self.shape = tuple(
            int(np.ceil((h - l) / spacing)) + 1 for l, h in zip(low, high, strict=True)
        )

    def _axes(self, window: tuple[slice, ...]) -> list[Vec]:
        return [
            self.low[i] + self.spacing * np.arange(window[i].start, window[i].stop)
            for i in range(3)
        ]

    def sample(self, field: Field) -> Vec:
        """Return a field's values on the whole grid."""
        window = tuple(slice(0, n) for n in self.shape)
        return field(np.stack(np.meshgrid(*self._axes(window), indexing="ij"), axis=-1))

    def union(self, cones: Sequence[Cone]) -> Vec:
        """Return the smooth union of cones, each evaluated near itself only [m]."""
        values = np.full(self.shape, 0.1)
        for cone in cones:
            low, high = cone.bounds(0.06 + cone.blend)
            first = np.floor((low - self.low) / self.spacing).astype(int)
            last = np.ceil((high - self.low) / self.spacing).astype(int) + 1
            window = tuple(
                slice(int(max(a, 0)), int(min(b, n)))
                for a, b, n in zip(first, last, self.shape, strict=True)
            )
            points = np.stack(np.meshgrid(*self._axes(window), indexing="ij"), axis=-1)
            values[window] = smooth_min(values[window], cone.distance(points), cone.blend)
        return values

    def mesh(self, values: Vec, smooth: float = 0.7, hidden: Vec | None = None) -> Surface:
        """Return the zero surface of sampled values.

        Args:
            values: Distances on the grid [m].
            smooth: Standard deviation of the Gaussian that smooths the grid's steps [spacings].
            hidden: Distances to a covering body on the grid [m]; parts of the surface more than
                4 mm inside it are left out.
        """
        soft = gaussian_filter(values, smooth) if smooth > 0.0 else values
        soft = np.pad(soft, 1, constant_values=float(np.abs(values).max()))
        vertices, faces, _, _ = marching_cubes(soft, 0.0, gradient_direction="descent")  # type: ignore[no-untyped-call]
        vertices -= 1.0
        if hidden is not None:
            seen = map_coordinates(hidden, vertices.T, order=1, mode="nearest") > -0.004
            faces = faces[seen[faces].any(axis=1)]
            kept, index = np.unique(faces, return_inverse=True)
            vertices, faces = vertices[kept], index.reshape(faces.shape)
        return Surface(
            vertices=vertices * self.spacing + self.low, faces=faces.astype(np.uint32)
        )


def mirrored(surface: Surface) -> Surface:
    """Return the surface mirrored from left to right (y to -y)."""
    return Surface(
        vertices=surface.vertices * [1.0, -1.0, 1.0],
        faces=np.ascontiguousarray(surface.faces[:, ::-1]),
    )
