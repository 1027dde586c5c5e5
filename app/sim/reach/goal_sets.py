"""Training targets in a box of goals, and interpolation between them (docs/method.md 2.4, 4).

grid     every ``spacing`` along each axis           boxes of 8 targets
halton   a low-discrepancy sequence over the box     tetrahedra of 4 targets

The action for a goal between targets is the weighted mean of the policy's actions for the
targets of its box or tetrahedron.

Source: thesis 4.3.4 and, for the Halton set, its outlook 4.5. Deviates: points of the sequence
alone leave the faces of the box empty, and Delaunay tetrahedra between them and the corners
would span the whole box. The sequence therefore fills a box that is larger by half the grid's
spacing, and points outside are moved to the nearest point of the box.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

from app.errors import GoalOutside, InvalidInput
from app.sim.cells.parts import GoalRegion
from app.sim.core.arrays import Vec
from app.sim.core.jit import direct
from app.sim.core.kernels.bounds import are_inside
from app.sim.core.out_of_range import OutOfRangeValue
from app.sim.reach.kernels.interpolation_weights import (
    N_BOX,
    N_SIMPLEX,
    box_weights,
    simplex_weights,
)

N_HALTON = 54
"""Targets of a Halton set, as many as in the thesis' grid."""
MOST_HALTON = 2000
"""Largest number of targets of a Halton set."""
OF_GRID = ("grid", "in-turn")
"""Rules of training goals whose targets are the points of a grid."""
INTERPOLATING = (*OF_GRID, "halton")
"""Rules of training goals with targets to interpolate between."""
AXES = ("x", "y", "z")
N_CORNERS = 8
SLACK = 1e-9
"""Tolerance for rounding at the faces of the box [m]."""
_FLAT = 1e-12
"""Volume below which a tetrahedron is dropped [m^3]."""


def halton_targets(region: GoalRegion, n: int = N_HALTON) -> Vec:
    """Return targets of low discrepancy in a box [m], shape (n, 3); its corners come first.

    Args:
        n: Number of targets, including the 8 corners.

    Raises:
        InvalidInput: ``n`` is out of range, or a side of the box is shorter than the spacing of
            its grid.
    """
    if not N_CORNERS <= n <= MOST_HALTON:
        rule = f"must lie in [{N_CORNERS}, {MOST_HALTON}]: the corners are among them"
        raise InvalidInput("n_halton", n, rule)
    size = np.array(region.size)
    if min(region.counts()) < 2:  # nearly all points would be moved to a corner
        rule = (
            "needs a box with a volume for goals of a Halton set: every side at least spacing "
            f"= {region.spacing:g} m"
        )
        raise InvalidInput("goal_region.size", list(region.size), rule)
    low, high = region.box()
    corners = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    found = dict.fromkeys(map(tuple, np.where(corners, high, low).tolist()))
    rim = 0.5 * region.spacing
    sequence = scipy.stats.qmc.Halton(3, scramble=False).fast_forward(1)
    while len(found) < n:
        points = np.clip(low - rim + (size + 2.0 * rim) * sequence.random(n), low, high)
        found.update(dict.fromkeys(map(tuple, points.tolist())))
    return np.array(list(found)[:n])


@dataclass(frozen=True, slots=True, kw_only=True)
class InterpolationWeights:
    """Targets and weights of n goals; K is 8 in a grid, 4 among scattered targets."""

    which: NDArray[np.int64]
    """Numbers of targets, shape (n, K)."""
    weights: Vec
    """Their weights, which sum to one, shape (n, K)."""


class TargetInterpolation(Protocol):
    """Interpolation between training targets."""

    @property
    def targets(self) -> Vec:
        """The training targets [m], shape (n_targets, 3)."""

    def weights_at(self, goals: Vec, field: str = "goal") -> InterpolationWeights:
        """Return the targets around goals and their weights.

        Args:
            goals: Goals [m], shape (n, 3).
            field: Name of a goal in error messages.

        Raises:
            GoalOutside: A goal lies outside the box of targets.
            InvalidInput: A goal is not three finite numbers.
        """


def _inside(low: Vec, high: Vec, goals: Vec, field: str) -> Vec:
    """Return goals clipped to the box of targets within the rounding tolerance."""
    points = np.array(goals, dtype=np.float64, ndmin=2)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InvalidInput(field, list(np.shape(goals)), "must have the shape [n, 3]")
    if are_inside(points.ravel(), low, high):
        return points
    held = np.clip(points, low, high)
    # negated so that NaN is rejected too
    wrong = points[~(np.abs(held - points) <= SLACK).all(axis=1)]
    if len(wrong):
        goal = wrong[0].tolist()
        if not all(map(math.isfinite, goal)):
            raise InvalidInput(field, goal, "must be finite")
        raise GoalOutside(field, goal, outside_of(wrong[0], low, high, field))
    return held


def outside_of(goal: Vec, low: Vec, high: Vec, field: str) -> tuple[OutOfRangeValue, ...]:
    """Return the axes along which a goal lies outside a box.

    Args:
        goal: Goal [m], shape (3,).
        low: Lower corner of the box [m], shape (3,).
        high: Upper corner of the box [m], shape (3,).
        field: Name of the goal in error messages.
    """
    return tuple(
        OutOfRangeValue(
            field=f"{field}.{axis}",
            value=float(goal[i]),
            low=float(low[i]),
            high=float(high[i]),
        )
        for i, axis in enumerate(AXES)
        if not low[i] - SLACK <= goal[i] <= high[i] + SLACK
    )


class GridInterpolation:
    """Trilinear interpolation in the boxes of a grid.

    Args:
        targets: Points of the grid [m], z varying fastest, then y, shape (n_targets, 3).

    Raises:
        InvalidInput: The targets are not such a grid.
    """

    def __init__(self, targets: Vec) -> None:
        self.targets = np.array(targets, dtype=np.float64)
        """The grid's points [m], shape (n_targets, 3)."""
        self._low, self._high = self.targets.min(axis=0), self.targets.max(axis=0)
        self._weigh: Callable[..., None] | None = None
        self._x, self._y, self._z = (np.unique(self.targets[:, i]) for i in range(3))
        planes = np.meshgrid(self._x, self._y, self._z, indexing="ij")
        points = np.stack(planes, axis=-1).reshape(-1, 3)
        if not np.array_equal(points, self.targets):
            rule = "must be all points of a grid, z varying fastest, then y"
            raise InvalidInput("targets", list(self.targets.shape), rule)

    def weights_at(self, goals: Vec, field: str = "goal") -> InterpolationWeights:
        """Return the corners of each goal's box and their trilinear weights, shape (n, 8) each.

        Args:
            goals: Goals [m], shape (n, 3).
            field: Name of the goals in messages.

        Raises:
            GoalOutside: A goal lies outside the targets.
        """
        inside = _inside(self._low, self._high, goals, field)
        which = np.empty((len(inside), N_BOX), dtype=np.int64)
        weights = np.empty((len(inside), N_BOX))
        arguments = self._x, self._y, self._z, inside, which, weights
        if self._weigh is None:
            self._weigh = direct(box_weights, arguments)
        self._weigh(*arguments)
        return InterpolationWeights(which=which, weights=weights)


class DelaunayInterpolation:
    """Barycentric interpolation in the Delaunay tetrahedra of scattered targets.

    Args:
        targets: Points whose hull is a box [m], shape (n_targets, 3).

    Raises:
        InvalidInput: A corner of the box is not a target.
    """

    def __init__(self, targets: Vec) -> None:
        self.targets = np.array(targets, dtype=np.float64)
        """The points [m], shape (n_targets, 3)."""
        low, high = self.targets.min(axis=0), self.targets.max(axis=0)
        self._low, self._high = low, high
        at_corner = ((self.targets == low) | (self.targets == high)).all(axis=1)
        if at_corner.sum() != N_CORNERS or not (low < high).all():
            rule = "must have the 8 corners of their box among them, once each"
            raise InvalidInput("targets", int(at_corner.sum()), rule)
        simplices = scipy.spatial.Delaunay(self.targets).simplices
        edges = self.targets[simplices[:, :3]] - self.targets[simplices[:, 3:]]
        kept = np.abs(np.linalg.det(edges)) > 6.0 * _FLAT
        self.corners = np.ascontiguousarray(simplices[kept], dtype=np.int64)
        """Targets of each tetrahedron, shape (m, 4)."""
        self._last = self.targets[self.corners[:, 3]]
        self._inverse = np.ascontiguousarray(np.linalg.inv(edges[kept].transpose(0, 2, 1)))

    def weights_at(self, goals: Vec, field: str = "goal") -> InterpolationWeights:
        """Return the corners of each goal's tetrahedron and their weights, shape (n, 4) each.

        Args:
            goals: Goals [m], shape (n, 3).
            field: Name of the goals in messages.

        Raises:
            GoalOutside: A goal lies outside the targets.
        """
        inside = _inside(self._low, self._high, goals, field)
        which = np.empty((len(inside), N_SIMPLEX), dtype=np.int64)
        weights = np.empty((len(inside), N_SIMPLEX))
        simplex_weights(self.corners, self._inverse, self._last, inside, which, weights)
        return InterpolationWeights(which=which, weights=weights)


def interpolation_of(targets: Vec, rule: str) -> TargetInterpolation:
    """Return the interpolation between targets [m], (n, 3), of a grid or of a Halton set.

    Raises:
        InvalidInput: The rule has no targets.
    """
    if rule in OF_GRID:
        return GridInterpolation(targets)
    if rule == "halton":
        return DelaunayInterpolation(targets)
    raise InvalidInput("goals", rule, "has no targets to interpolate", INTERPOLATING)
