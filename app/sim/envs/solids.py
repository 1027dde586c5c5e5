"""Convex solids that rays are intersected with: capsules, upright cylinders and boxes.

Source: ray and capsule by Quilez, "Intersectors" (2016); boxes and cylinders by the slab method
of Kay and Kajiya (1986).

A solid has a colour and an opacity; below 1 it is translucent, without shadow. ``corners``
returns those of a box around it [m], shape (8, 3). ``hit`` intersects rays of given origins [m]
and unit directions, each of shape (n, 3) or (3,); it returns the distance to the first point
[m], inf where there is none, shape (n,), and its unit normal, shape (n, 3).
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from app.sim.cells.colours import Rgb

Floats = NDArray[np.float32]


_UNIT = np.array(list(product((-1.0, 1.0), repeat=3)), dtype=np.float32)


def single(values: ArrayLike) -> Floats:
    """Return values in single precision."""
    return np.asarray(values, dtype=np.float32)


@dataclass(frozen=True, slots=True, kw_only=True)
class Capsule:
    """All points within ``radius`` of a segment; a sphere where both ends are equal."""

    start: ArrayLike
    end: ArrayLike
    radius: float
    colour: Rgb
    opacity: float = 1.0

    def corners(self) -> Floats:
        """Return the corners of a box around it [m], shape (8, 3)."""
        ends = np.stack([single(self.start), single(self.end)])
        low, high = ends.min(axis=0) - self.radius, ends.max(axis=0) + self.radius
        return single(0.5 * (low + high) + 0.5 * (high - low) * _UNIT)

    def hit(self, origin: Floats, ray: Floats) -> tuple[Floats, Floats]:
        """Intersect rays."""
        a, b = single(self.start), single(self.end)
        axis, away = b - a, origin - a
        length2 = max(float(axis @ axis), 1e-12)
        along, offset = ray @ axis, away @ axis
        slope = dot(ray, away)
        square = length2 - along**2
        half = length2 * slope - offset * along
        rest = length2 * (dot(away, away) - self.radius**2) - offset**2
        root = half**2 - square * rest
        side = (-half - np.sqrt(np.maximum(root, 0.0))) / np.maximum(square, 1e-12)
        share = np.clip((offset + side * along) / length2, 0.0, 1.0)
        # Between the ends the hit of the round side, beyond them that of a sphere.
        nearest = away - (share >= 0.5)[:, None] * axis
        slope = dot(ray, nearest)
        ball = slope**2 - dot(nearest, nearest) + self.radius**2
        ends = np.where(ball >= 0.0, -slope - np.sqrt(np.maximum(ball, 0.0)), np.inf)
        middle = (share > 0.0) & (share < 1.0)
        t = np.where(root >= 0.0, np.where(middle, side, ends), np.inf)
        t = np.where(t > 0.0, t, np.inf).astype(np.float32)
        point = away + np.where(np.isfinite(t), t, 0.0)[:, None] * ray
        share = np.clip(point @ axis / length2, 0.0, 1.0)
        return t, ((point - share[:, None] * axis) / self.radius).astype(np.float32)


@dataclass(frozen=True, slots=True, kw_only=True)
class Cylinder:
    """An upright cylinder on ``base``, the middle of its lower face."""

    base: ArrayLike
    height: float
    radius: float
    colour: Rgb
    opacity: float = 1.0

    def corners(self) -> Floats:
        """Return the corners of a box around it [m], shape (8, 3)."""
        middle = single(self.base) + single([0.0, 0.0, 0.5 * self.height])
        return middle + single([self.radius, self.radius, 0.5 * self.height]) * _UNIT

    def hit(self, origin: Floats, ray: Floats) -> tuple[Floats, Floats]:
        """Intersect rays."""
        away = origin - single(self.base)
        flat, start = ray[..., :2], away[..., :2]
        square = np.maximum(dot(flat, flat), 1e-12)
        half = dot(flat, start)
        root = half**2 - square * (dot(start, start) - self.radius**2)
        width = np.sqrt(np.maximum(root, 0.0))
        low, high = _slab(away[..., 2], ray[..., 2], 0.0, self.height)
        enter, leave = (-half - width) / square, (-half + width) / square
        t = np.maximum(enter, low)
        met = (root > 0.0) & (t < np.minimum(leave, high)) & (t > 0.0)
        t = np.where(met, t, np.inf).astype(np.float32)
        point = start + np.where(met, t, 0.0)[:, None] * flat
        round_side = (enter > low)[:, None]
        normal = np.zeros((len(t), 3), dtype=np.float32)
        normal[:, :2] = np.where(round_side, point / self.radius, 0.0)
        normal[:, 2] = np.where(round_side[:, 0], 0.0, -np.sign(ray[..., 2]))
        return t, normal


@dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """A box that may be turned about the vertical."""

    center: ArrayLike
    half_size: ArrayLike
    colour: Rgb
    yaw: float = 0.0
    opacity: float = 1.0

    def _turn(self) -> Floats:
        """Return the rotation from the box's axes to the scene's, shape (3, 3)."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return single([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

    def corners(self) -> Floats:
        """Return its corners [m], shape (8, 3)."""
        return single(single(self.center) + single(self.half_size) * _UNIT @ self._turn().T)

    def hit(self, origin: Floats, ray: Floats) -> tuple[Floats, Floats]:
        """Intersect rays."""
        turn, half = self._turn(), single(self.half_size)
        away, ray = single((origin - single(self.center)) @ turn), single(ray @ turn)
        pairs = [_slab(away[..., k], ray[..., k], -half[k], half[k]) for k in range(3)]
        lows = np.stack(np.broadcast_arrays(*(low for low, _ in pairs)), axis=-1)
        t = lows.max(axis=-1)
        leave = np.minimum(np.minimum(pairs[0][1], pairs[1][1]), pairs[2][1])
        t = np.where((t < leave) & (t > 0.0), t, np.inf).astype(np.float32)
        face = lows.argmax(axis=-1)
        normal = np.zeros((len(t), 3), dtype=np.float32)
        sign = np.take_along_axis(np.broadcast_to(ray, lows.shape), face[:, None], axis=1)
        np.put_along_axis(normal, face[:, None], -np.sign(sign), axis=1)
        return t, normal @ turn.T


Solid = Capsule | Cylinder | Box


def dot(a: Floats, b: Floats) -> Floats:
    """Return the inner products along the last axes."""
    return np.asarray(np.einsum("...k,...k->...", a, b), dtype=np.float32)


def _slab(start: Floats, ray: Floats, low: float, high: float) -> tuple[Floats, Floats]:
    """Return the distances at which rays enter and leave the space between two planes."""
    safe = np.where(np.abs(ray) < 1e-9, np.float32(1e-9), ray)
    first, second = (low - start) / safe, (high - start) / safe
    return np.minimum(first, second), np.maximum(first, second)
