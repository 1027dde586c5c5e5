"""Shaded images of capsules, cylinders and boxes by ray casting, in numpy.

Every solid is intersected with the rays of those pixels that its bounding box covers; the
nearest hit of a ray is shaded with a sky, one directional light and its shadows. Two rays per
pixel and direction smooth the edges. No graphics library and no display is needed.
"""

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.cells.colours import Rgb
from app.sim.envs.solids import Floats, Solid, dot, single

Image = NDArray[np.uint8]
"""Rows from the top, columns from the left, red, green, blue."""
Rows = NDArray[np.int64]
Point = tuple[float, float, float]

SAMPLES = 2
"""Rays per pixel in each direction."""
LIGHT = np.array([0.42, -0.38, 0.82], dtype=np.float32)
"""Direction to the light, normalised below."""
LIGHT /= np.linalg.norm(LIGHT)
ACROSS = np.stack([np.cross(LIGHT, [1, 0, 0]), np.cross(LIGHT, [0, 1, 0])]).astype(np.float32)
"""Two directions across the light: a shadow lies within the bounds of its solid along them."""
DIRECT, AMBIENT_UP, AMBIENT_DOWN = 0.66, 0.46, 0.26
"""Share of the light; of the sky on what faces up, and on what faces down."""
SHINE, SHININESS = 0.16, 24.0
SKY: Rgb = (206, 217, 230)
HORIZON: Rgb = (238, 241, 245)
FLOOR: Rgb = (214, 219, 226)
LINE: Rgb = (176, 186, 197)
FOV = 0.7
"""Vertical field of view [rad]."""
GRID_M = 0.5
"""Distance of the lines on the floor [m]."""
FADE_M = 9.0
"""Distance from the camera at which the floor has the colour of the horizon [m]."""
LIFT_M = 2e-3
"""Distance from a surface at which a ray to the light begins [m]."""


def _linear(colour: Rgb) -> Floats:
    return (single(colour) / 255.0) ** 2.2


class _Hits(NamedTuple):
    """Hits of the rays of a camera, an entry per ray."""

    t: Floats
    """Distances [m], inf for the sky."""
    normal: Floats
    """Unit normals."""
    colour: Floats
    """Colours, linear, 0 to 1."""
    solid: NDArray[np.bool_]
    """Whether it is a solid, not floor or sky."""


class Raycaster:
    """Draws scenes that are seen by one camera, held upright.

    Args:
        position: Position of the camera [m].
        look_at: Point in the middle of the image [m].
        width: Columns of the images [px].
        height: Rows of the images [px].
        floor_z: Height of the floor [m].
        still: Opaque solids that are in every image; they are intersected once.
    """

    def __init__(
        self,
        position: Point,
        look_at: Point,
        width: int,
        height: int,
        floor_z: float,
        still: Sequence[Solid] = (),
    ) -> None:
        self._shape = (SAMPLES * height, SAMPLES * width)
        self._eye, self._floor_z = single(position), floor_z
        ahead = single(look_at) - self._eye
        ahead /= np.linalg.norm(ahead)
        right = np.cross(ahead, single([0.0, 0.0, 1.0]))
        right /= np.linalg.norm(right)
        self._axes = np.stack([right, np.cross(ahead, right), ahead]).astype(np.float32)
        self._focus = float(0.5 * self._shape[0] / np.tan(0.5 * FOV))
        rows, columns = (
            (np.arange(n, dtype=np.float32) + 0.5 - 0.5 * n) / self._focus for n in self._shape
        )
        view = np.ones((*self._shape, 3), dtype=np.float32)
        view[..., 0], view[..., 1] = columns[None], rows[:, None]
        self._rays = view @ self._axes
        self._rays /= np.linalg.norm(self._rays, axis=-1, keepdims=True)
        self._half = LIGHT - self._rays
        self._half /= np.linalg.norm(self._half, axis=-1, keepdims=True)
        self._still = self._background()
        self._still_solids = tuple(still)
        self._paint(self._still, still)
        nowhere = np.zeros(0, dtype=np.int64)
        self._still_lit = np.ones(height * width, dtype=np.float32)
        self._shade(self._still, self._still_lit, still, nowhere)

    def _background(self) -> _Hits:
        """Return the image of the floor and the sky."""
        down = self._rays[..., 2]
        drop = np.float32(self._floor_z) - self._eye[2]
        t = np.where(down < -1e-6, drop / np.minimum(down, -1e-6), 0.0)
        t = np.where(t > 0.0, t, np.inf).astype(np.float32)
        high = np.clip(1.5 * np.maximum(down, 0.0), 0.0, 1.0)[..., None]
        sky = (1.0 - high) * _linear(HORIZON) + high * _linear(SKY)
        reach = np.where(np.isfinite(t), t, 0.0)
        place = (self._eye + reach[..., None] * self._rays)[..., :2] / GRID_M
        apart = np.abs(place - np.round(place)) * GRID_M
        width = np.maximum(0.004, reach / self._focus)
        line = (apart < width[..., None]).any(axis=-1)[..., None]
        ground = np.where(line, _linear(LINE), _linear(FLOOR))
        fade = np.where(np.isfinite(t), np.clip(reach / FADE_M, 0.0, 1.0) ** 2, 1.0)
        colour = ground + fade[..., None] * (sky - ground)
        normal = np.zeros((*self._shape, 3), dtype=np.float32)
        normal[..., 2] = 1.0
        return _Hits(
            t, normal, colour.astype(np.float32), np.zeros(self._shape, dtype=np.bool_)
        )

    def draw(self, solids: Sequence[Solid]) -> Image:
        """Return an image of solids on the floor, uint8, shape (height, width, 3)."""
        hits = _Hits._make(part.copy() for part in self._still)
        opaque = [one for one in solids if one.opacity >= 1.0]
        self._paint(hits, opaque)
        step = (slice(None, None, SAMPLES),) * 2
        changed = np.flatnonzero(hits.t[step] < self._still.t[step])
        lit = self._still_lit.copy()
        lit[changed] = 1.0
        self._shade(hits, lit, self._still_solids, changed)
        self._shade(hits, lit, opaque, None)
        colour = self._lighten(hits, lit)
        for solid in solids:
            if solid.opacity < 1.0:
                self._veil(solid, colour, hits.t)
        shifts = product(range(SAMPLES), repeat=2)
        mean = sum(colour[i::SAMPLES, k::SAMPLES] for i, k in shifts) / np.float32(SAMPLES**2)
        return np.asarray(255.0 * np.clip(mean, 0.0, 1.0) ** (1 / 2.2) + 0.5, dtype=np.uint8)

    def _paint(self, hits: _Hits, solids: Sequence[Solid]) -> None:
        """Add the hits of solids."""
        for solid in solids:
            part = self._window(solid)
            near, facing = self._cast(solid, part)
            first = near < hits.t[part]
            hits.t[part][first], hits.normal[part][first] = near[first], facing[first]
            hits.colour[part][first], hits.solid[part][first] = _linear(solid.colour), True

    def _window(self, solid: Solid) -> tuple[slice, slice]:
        """Return the rows and columns that a solid can cover."""
        seen = (solid.corners() - self._eye) @ self._axes.T
        if (seen[:, 2] < 0.05).any():  # a corner is beside or behind the camera
            return slice(0, self._shape[0]), slice(0, self._shape[1])
        at = self._focus * seen[:, :2] / seen[:, 2:] + 0.5 * single(self._shape[::-1])
        low, high = at.min(axis=0).astype(int) - 1, at.max(axis=0).astype(int) + 2
        spans = zip(low[::-1], high[::-1], self._shape, strict=True)
        rows, columns = (slice(max(0, min(a, n)), max(0, min(b, n))) for a, b, n in spans)
        return rows, columns

    def _cast(self, solid: Solid, part: tuple[slice, slice]) -> tuple[Floats, Floats]:
        rays = self._rays[part]
        t, normal = solid.hit(self._eye, rays.reshape(-1, 3))
        return t.reshape(rays.shape[:2]), normal.reshape(rays.shape)

    def _shade(
        self, hits: _Hits, lit: Floats, solids: Sequence[Solid], rows: Rows | None
    ) -> None:
        """Write 0 to ``lit`` for pixels in the shadow of a solid.

        Args:
            hits: Hits of the camera's rays.
            lit: Share of the light that arrives, shape (height * width,); changed.
            solids: Solids that cast shadows.
            rows: Pixels that may be in one; None for all.
        """
        if not solids:
            return
        step = (slice(None, None, SAMPLES),) * 2
        chosen = np.arange(lit.size) if rows is None else rows
        t = hits.t[step].reshape(-1)[chosen]
        reach = (
            np.where(np.isfinite(t), t, 0.0)[:, None] * self._rays[step].reshape(-1, 3)[chosen]
        )
        points = self._eye + reach + LIFT_M * hits.normal[step].reshape(-1, 3)[chosen]
        u, v = points @ ACROSS[0], points @ ACROSS[1]
        boxes = [
            (box.min(axis=0), box.max(axis=0))
            for box in (one.corners() @ ACROSS.T for one in solids)
        ]
        low, high = (f([b[k] for b in boxes], axis=0) for k, f in enumerate((np.min, np.max)))
        some = _inside(u, v, low, high)
        chosen, points, u, v = chosen[some], points[some], u[some], v[some]
        for solid, (low, high) in zip(solids, boxes, strict=True):
            near = _inside(u, v, low, high)
            near = near[lit[chosen[near]] > 0.0]
            if len(near):
                dark = np.isfinite(solid.hit(points[near], LIGHT)[0])
                lit[chosen[near[dark]]] = 0.0

    def _lighten(self, hits: _Hits, lit: Floats) -> Floats:
        """Return colours under the light that arrives; the sky keeps its own."""
        rows, columns = (n // SAMPLES for n in self._shape)
        soft = _blurred(lit.reshape(rows, columns))
        light = soft.repeat(SAMPLES, axis=0).repeat(SAMPLES, axis=1)
        facing = np.maximum(hits.normal @ LIGHT, 0.0)
        up = 0.5 + 0.5 * hits.normal[..., 2]
        bright = AMBIENT_DOWN + (AMBIENT_UP - AMBIENT_DOWN) * up + DIRECT * facing * light
        # Full light leaves the floor's colour; far floor and sky are as bright as they are.
        fade = np.clip(hits.t / FADE_M, 0.0, 1.0) ** 2
        bare = bright / np.float32(AMBIENT_UP + DIRECT * LIGHT[2])
        bright = np.where(hits.solid, bright, bare + fade * (1.0 - bare))
        colour = hits.colour * bright[..., None]
        shiny = hits.solid & (light > 0.0)
        along = np.maximum(dot(hits.normal[shiny], self._half[shiny]), 0.0)
        colour[shiny] += (SHINE * along**SHININESS * light[shiny])[:, None]
        return np.asarray(colour, dtype=np.float32)

    def _veil(self, solid: Solid, colour: Floats, t: Floats) -> None:
        """Blend a translucent solid with the background."""
        part = self._window(solid)
        near, normal = self._cast(solid, part)
        first = near < t[part]
        bright = 0.75 + 0.35 * (normal[first] @ LIGHT)
        over = bright[:, None] * _linear(solid.colour)
        colour[part][first] = (1 - solid.opacity) * colour[part][first] + solid.opacity * over


def _blurred(image: Floats) -> Floats:
    """Return an image averaged over 3 x 3 pixels."""
    wide = np.pad(image, 1, mode="edge")
    rows = wide[:-2] + wide[1:-1] + wide[2:]
    return single((rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:]) / 9.0)


def _inside(u: Floats, v: Floats, low: Floats, high: Floats) -> Rows:
    """Return whether points of a plane lie within a rectangle."""
    return np.flatnonzero((u > low[0]) & (u < high[0]) & (v > low[1]) & (v < high[1]))
