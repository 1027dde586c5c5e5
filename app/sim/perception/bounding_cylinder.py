"""The safety volume of docs/method.md 2.8: an upright cylinder around a person's key-points.

The singular value decomposition of the centred key-points gives the axes of a box; the box is
the bound of the key-points along them. In plan view the box is symmetric about its centre, so
that the axis of the smallest vertical cylinder around it passes through the centre, and its
radius is the distance of the farthest corner. The radius is multiplied by 1.1 and increased by
a flesh margin, because key-points lie inside the body and the hands extend beyond the wrists.
The top has the flesh margin too, above the box and above hands that point up from the wrists.

Where a key-point of arms or head is unseen for longer than the hold time, the cylinder widens
to its possible positions: every seen key-point bounds them by the length of the bones between.

Deviates: the thesis says "minimum-volume bounding box (SVD)"; axes by SVD give a small box, not
always the smallest. Flesh margin, hold time and the widening are ours. Unseen legs, usually
hidden by a table, are assumed below the hips.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.perception.keypoints import BODY_25, N_KEYPOINTS, K

RADIUS_FACTOR = 1.1
"""Factor on the radius (docs/method.md 2.8)."""
FLESH_MARGIN = 0.17
"""Added to the radius and to the top [m]. Around exact key-points of a person at work, 0.131 m
contain the whole surface of the median body and 0.145 m that of the 95th percentile (stature,
arms, shoulders); crown and fingertips determine both. The rest is for noise."""
GROWTH = 1.6
"""Speed at which the radius grows while nothing is seen and the hold time is over [m/s];
walking speed of ISO 13855."""
ABOVE_ROBOT = 5.0
"""Height of the top of an unknown person [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SafetyCylinder:
    """A vertical cylinder around a person."""

    center: Vec
    """x, y of the axis [m], shape (2,)."""
    radius: float
    """Radius with factor and margins [m]."""
    bottom: float
    """Height of the lowest corner of the box [m]; take the floor where it is hidden."""
    top: float
    """Height of the highest corner of the box, or of a hand raised above its wrist, with the
    flesh margin [m]."""
    velocity: Vec
    """Velocity of the axis [m/s], shape (2,)."""


_BONES = (
    ("mid_hip", "neck", 0.55),
    *((f"shoulder_{s}", "neck", 0.22) for s in "rl"),
    *((f"elbow_{s}", f"shoulder_{s}", 0.35) for s in "rl"),
    *((f"wrist_{s}", f"elbow_{s}", 0.30) for s in "rl"),
    *((f"hip_{s}", "mid_hip", 0.12) for s in "rl"),
    ("nose", "neck", 0.30),
    *((f"{part}_{s}", "nose", 0.16) for part in ("eye", "ear") for s in "rl"),
)
"""Largest bone lengths [m], at least those of the 95th percentile of men."""
_WRISTS, _ELBOWS = (tuple(K[f"{part}_{s}"] for s in "rl") for part in ("wrist", "elbow"))
_HIPS = tuple(K[name] for name in ("mid_hip", "hip_r", "hip_l"))
_BOUNDED = tuple(
    k
    for k, name in enumerate(BODY_25)
    if k not in _HIPS and any(name in bone[:2] for bone in _BONES)
)
"""Key-points that widen the cylinder when missing: arms, neck and face."""
HAND_M = 0.22
"""Length of a hand beyond the wrist [m], at least that of the 95th percentile of men."""


def _bone_distances() -> Vec:
    """Return the path length along bones between key-points [m], shape (25, 25)."""
    lengths = np.full((N_KEYPOINTS, N_KEYPOINTS), np.inf)
    np.fill_diagonal(lengths, 0.0)
    for one, other, length in _BONES:
        lengths[K[one], K[other]] = lengths[K[other], K[one]] = length
    for k in range(N_KEYPOINTS):
        lengths = np.minimum(lengths, lengths[:, k : k + 1] + lengths[k : k + 1])
    lengths.setflags(write=False)
    return lengths


_BONE_DISTANCES = _bone_distances()


def bounding_box(points: Vec) -> Vec:
    """Return the corners [m], shape (8, 3), of the box along the points' principal axes.

    Args:
        points: At least one, none missing [m], shape (n, 3).
    """
    middle = points.mean(axis=0)
    axes = np.linalg.svd(points - middle, full_matrices=True)[2]
    along = (points - middle) @ axes.T
    low, high = along.min(axis=0), along.max(axis=0)
    corners = np.array([[(low, high)[(k >> i) & 1][i] for i in range(3)] for k in range(8)])
    return np.asarray(middle + corners @ axes)


def safety_cylinder(
    points: Vec, velocity: Vec | None = None, flesh_margin: float = FLESH_MARGIN
) -> SafetyCylinder | None:
    """Return the safety cylinder around key-points, or None where all are missing.

    Args:
        points: Key-points [m], shape (25, 3), NaN where missing for longer than the hold time.
        velocity: Velocity of the cylinder's axis [m/s], shape (2,); zero where None.
        flesh_margin: Added to the radius and to the top [m].

    Source: docs/method.md 2.8. Deviates: see the head of this file.
    """
    seen = np.asarray(np.isfinite(points).all(axis=1))
    if not seen.any():
        return None
    corners = bounding_box(points[seen])
    center = 0.5 * (corners[0] + corners[7])[:2]
    radius = float(np.linalg.norm(corners[:, :2] - center, axis=1).max())
    fingertips = points[list(_WRISTS), 2] + HAND_M  # a hand may point up from any forearm
    top = float(np.nanmax([*corners[:, 2], *fingertips]))
    wide, high = _unseen_reach(points, seen, center)
    return SafetyCylinder(
        center=center,
        radius=max(RADIUS_FACTOR * radius, wide) + flesh_margin,
        bottom=float(corners[:, 2].min()),
        top=max(top, high) + flesh_margin,
        velocity=np.zeros(2) if velocity is None else np.array(velocity),
    )


def greatest_distance(before: Vec, now: Vec, members: Sequence[int]) -> float:
    """Return the greatest distance between two sets of key-points, and of their hands [m].

    Args:
        before: Key-points [m], shape (25, 3), NaN where missing.
        now: The same key-points at another time [m], shape (25, 3).
        members: Indices of the key-points that count; those that are missing in one set do not.
            Hands are stretched along the forearms.
    """
    moved = [now[members] - before[members]]
    for wrist, elbow in zip(_WRISTS, _ELBOWS, strict=True):
        tips = []
        for points in (before, now):
            along = points[wrist] - points[elbow]
            tips.append(points[wrist] + HAND_M * along / max(1e-6, np.linalg.norm(along)))
        moved.append((tips[1] - tips[0])[None])
    away = np.linalg.norm(np.concatenate(moved), axis=1)
    return float(np.max(away, where=np.isfinite(away), initial=0.0))


def _unseen_reach(points: Vec, seen: NDArray[np.bool_], center: Vec) -> tuple[float, float]:
    """Return bounds of the distance from the axis and height of unseen arms and heads [m]."""
    unseen = [k for k in _BOUNDED if not seen[k]]
    if not unseen:
        return 0.0, -np.inf
    there = np.flatnonzero(seen)
    lengths = _BONE_DISTANCES[unseen][:, there]
    lengths += HAND_M * np.isin(unseen, _WRISTS)[:, None]
    if not np.isfinite(lengths).any():  # Only legs are seen: the whole person is above them.
        lengths = np.full_like(lengths, _BONE_DISTANCES[K["wrist_r"], K["mid_hip"]] + 1.0)
    away = np.linalg.norm(points[there, :2] - center, axis=1)
    wide = (away + lengths).min(axis=1).max()
    return float(wide), float((points[there, 2] + lengths).min(axis=1).max())
