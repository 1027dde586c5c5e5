"""Via points of a movement primitive: postures, speeds and places of the body it must meet.

A joint via point is linear in the weights. A place of the body (a palm, an elbow) is not: it is
linearised at the present weights ``w_k``, with the Jacobian J of the body's point at
``q_k = Phi w_k``,

    A = J Phi,   y = p* - p(q_k) + J q_k,   w_{k+1} = w_0 + K_k (y - A w_0),

an iterated Kalman update toward the least change of the weights, in the metric of Sigma, that
meets all points. Its last millimetres are slow, so after some updates Newton steps from ``w_k``
itself go on until the body's own kinematics meet ``p*``. With the mean as ``w_0`` it conditions
the primitive; with a draw from the primitive as ``w_0`` it makes a sample (Matheron's rule),
and then every *sample* meets the points, not only their mean.

Source: docs/method.md 3.4; Paraschos et al. 2018, sections 3.3 and 3.4; iterated update: Bell
and Cathey 1993; Matheron's rule: Wilson et al. 2021. Deviates: Paraschos conditions on the task
space through samples of an extended model; linearising needs none and is exact at its end.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from app.errors import InvalidInput
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.primitives.promp import ProMP, basis, basis_slope, gain, observe, positions

PointsOf = Callable[[Vec], dict[str, Vec]]
"""From joint positions (18,) to the body's points by name [m], each (3,)."""

NEAR_M = 1e-4
"""The iteration ends when every exact point is met to this [m]."""
MET = 1e-3
"""An exact via point counts as met to this [m, rad]."""
SLACK = 5e-4
"""Largest excess of weights over joint limits [m, rad]; ``sampling.follow`` clips it."""
LONGEST = 0.5
"""Longest change of a weight in one step [m, rad]."""
MAX_STEPS = 25
"""Steps after which a via point is taken as out of reach."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JointVia:
    """Some joints at given values at one phase."""

    phase: float
    """Phase in [0, 1]."""
    q: Vec
    """Values, shape (k,): positions [m, rad], or derivatives by the phase."""
    joints: tuple[str, ...] = human.JOINT_NAMES
    """Names of the k joints."""
    cov: Vec | None = None
    """Covariance of the values, shape (k, k); None: exactly."""
    derivative: Literal[0, 1] = 0
    """0: positions; 1: dq/dz, which is the speed times the duration."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PointVia:
    """A point of the body at a given place at one phase."""

    phase: float
    """Phase in [0, 1]."""
    position: Vec
    """Place, robot base frame [m], shape (3,)."""
    point: str = "hand_r"
    """Name of the point (``human.POINT_NAMES``)."""
    cov: Vec | None = None
    """Covariance of the place [m^2], shape (3, 3); None: exactly."""


Via = JointVia | PointVia


def points_of(size: Vec) -> PointsOf:
    """Return the kinematics of a person whose pelvis is at a height [m]."""
    return partial(human.joint_points, size=size)


def require_vias(vias: Sequence[Via]) -> None:
    """Raise InvalidInput for the first via point that breaks a rule, naming both."""
    for i, via in enumerate(vias):
        place = f"vias[{i}]"
        if not 0.0 <= via.phase <= 1.0:
            raise InvalidInput(f"{place}.phase", via.phase, "must lie in [0, 1]")
        values = via.q if isinstance(via, JointVia) else via.position
        size = len(via.joints) if isinstance(via, JointVia) else 3
        if np.shape(values) != (size,) or not np.isfinite(values).all():
            raise InvalidInput(place, np.asarray(values).tolist(), f"must be {size} numbers")
        if via.cov is not None and np.shape(via.cov) != (size, size):
            raise InvalidInput(f"{place}.cov", np.shape(via.cov), f"must be ({size}, {size})")
        if via.cov is not None and not _is_covariance(via.cov):
            rule = "must be finite, symmetric, positive semidefinite"
            raise InvalidInput(f"{place}.cov", via.cov.tolist(), rule)
        if isinstance(via, JointVia):
            _require_joints(place, via)
        elif via.point not in human.POINT_NAMES:
            raise InvalidInput(
                f"{place}.point", via.point, "is no point of the body", human.POINT_NAMES
            )


def _is_covariance(cov: Vec) -> bool:
    if not np.isfinite(cov).all() or not np.allclose(cov, cov.T, atol=1e-12):
        return False
    return bool(np.linalg.eigvalsh(cov).min() >= -1e-12)


def _require_joints(place: str, via: JointVia) -> None:
    for name, value in zip(via.joints, via.q, strict=True):
        if name not in human.JOINT_NAMES:
            raise InvalidInput(f"{place}.joints", name, "is no joint", human.JOINT_NAMES)
        j = human.JOINT_NAMES.index(name)
        low, high = human.Q_MIN[j] - SLACK, human.Q_MAX[j] + SLACK
        if via.derivative == 0 and via.cov is None and not low <= value <= high:
            rule = f"must lie in [{human.Q_MIN[j]:g}, {human.Q_MAX[j]:g}]"
            raise InvalidInput(f"{place}.q.{name}", float(value), rule)


def point_jacobian(q: Vec, point: str, points: PointsOf, step: float = 1e-5) -> Vec:
    """Return d p / d q of a point of the body by central differences, shape (3, 18)."""
    out = np.empty((3, len(q)))
    for j in range(len(q)):
        moved = q.copy()
        moved[j] = q[j] + step
        ahead = points(moved)[point]
        moved[j] = q[j] - step
        out[:, j] = (ahead - points(moved)[point]) / (2.0 * step)
    return out


def joint_rows(promp: ProMP, via: JointVia) -> Vec:
    """Return A of a joint via point, shape (k, n_weights)."""
    shape = basis if via.derivative == 0 else basis_slope
    phi = shape(np.array([via.phase]), promp.n_basis, promp.width)[0]
    rows = np.zeros((len(via.joints), promp.n_joints, promp.n_basis))
    for i, name in enumerate(via.joints):
        rows[i, human.JOINT_NAMES.index(name)] = phi
    return rows.reshape(len(rows), -1)


def _point_rows(promp: ProMP, via: PointVia, weights: Vec, points: PointsOf) -> tuple[Vec, Vec]:
    phase = np.array([via.phase])
    q = positions(promp, weights, phase)[0]
    jacobian = point_jacobian(q, via.point, points)
    rows = np.kron(jacobian, basis(phase, promp.n_basis, promp.width))
    return np.asarray(rows), np.asarray(via.position - points(q)[via.point] + jacobian @ q)


def _stacked(
    promp: ProMP, vias: Sequence[Via], weights: Vec, points: PointsOf
) -> tuple[Vec, Vec]:
    """Return A, shape (m, n_weights), and y, shape (m,), linearised at ``weights``."""
    rows: list[Vec] = []
    values: list[Vec] = []
    for via in vias:
        if isinstance(via, JointVia):
            rows.append(joint_rows(promp, via))
            values.append(np.asarray(via.q, dtype=np.float64))
        else:
            some, value = _point_rows(promp, via, weights, points)
            rows.append(some)
            values.append(value)
    return np.concatenate(rows), np.concatenate(values)


def noise_of(vias: Sequence[Via]) -> Vec:
    """Return R, the vias' covariances along its diagonal, shape (m, m)."""
    sizes = [len(via.joints) if isinstance(via, JointVia) else 3 for via in vias]
    out, at = np.zeros((sum(sizes), sum(sizes))), 0
    for via, size in zip(vias, sizes, strict=True):
        if via.cov is not None:
            out[at : at + size, at : at + size] = via.cov
        at += size
    return out


def miss(promp: ProMP, weights: Vec, via: Via, points: PointsOf) -> float:
    """Return by how much weights miss a via point [m, rad]: distance, or greatest of joints."""
    if isinstance(via, JointVia):
        return float(np.abs(joint_rows(promp, via) @ weights.ravel() - via.q).max())
    q = positions(promp, weights, np.array([via.phase]))[0]
    return float(np.linalg.norm(points(q)[via.point] - via.position))


def worst_miss(promp: ProMP, weights: Vec, vias: Sequence[Via], points: PointsOf) -> float:
    """Return by how much weights miss the exact via points at most [m, rad]."""
    exact = [miss(promp, weights, via, points) for via in vias if via.cov is None]
    return max(exact, default=0.0)


def meet(
    promp: ProMP, start: Vec, vias: Sequence[Via], points: PointsOf, n_updates: int = 3
) -> Vec:
    """Return weights near ``start``, in the metric of Sigma, that meet the via points.

    Args:
        promp: Primitive; its Sigma is the metric.
        start: Weights w_0, shape (n_joints, n_basis).
        vias: Via points; those with a covariance are met as closely as it asks.
        points: Kinematics of the person.
        n_updates: Iterated updates from ``start``; more of them end nearer to it.

    Returns:
        Weights, shape (n_joints, n_basis); whether they meet is for the caller to see.
    """
    weights, before, share = start, np.zeros_like(start), 1.0
    for _ in range(n_updates if vias else 0):
        change = _change(promp, start, weights, vias, points)
        if np.abs(change).max() < 1e-7:
            break
        # Updates that go to and fro about their end are damped.
        share *= 0.5 if (change * before).sum() < 0.0 else 1.0
        weights, before = weights + share * change, change
    exact = [via for via in vias if via.cov is None]
    for _ in range(MAX_STEPS):
        if worst_miss(promp, weights, exact, points) < NEAR_M:
            break
        weights = weights + _change(promp, weights, weights, exact, points)
    return weights


def _change(
    promp: ProMP, start: Vec, weights: Vec, vias: Sequence[Via], points: PointsOf
) -> Vec:
    """Return the step from ``weights`` to the update of ``start`` linearised there."""
    rows, values = _stacked(promp, vias, weights, points)
    full = start.ravel() + gain(promp, rows, noise_of(vias)) @ (values - rows @ start.ravel())
    change = full.reshape(start.shape) - weights
    # A long step leaves the range of its own linearisation.
    return np.asarray(change * (LONGEST / max(float(np.abs(change).max()), LONGEST)))


def condition(promp: ProMP, vias: Sequence[Via], points: PointsOf) -> ProMP:
    """Return the primitive given its via points: mean and covariance of the weights.

    A normal distribution knows no joint limits; samples keep them
    (``app.sim.primitives.sampling``).

    Args:
        promp: Primitive of the 18 joints.
        vias: Via points.
        points: Kinematics of the person.

    Raises:
        InvalidInput: A via point is malformed, or the exact ones cannot be met together.
    """
    require_vias(vias)
    if not vias:
        return promp
    weights = meet(promp, promp.mean, vias, points, n_updates=40)
    _require_met(promp, weights, vias, points)
    rows, values = _stacked(promp, vias, weights, points)
    return replace(observe(promp, rows, values, noise_of(vias)), mean=weights)


def _require_met(promp: ProMP, weights: Vec, vias: Sequence[Via], points: PointsOf) -> None:
    for i, via in enumerate(vias):
        missed = miss(promp, weights, via, points)
        if via.cov is None and missed > MET:
            rule = f"cannot be met with the others: {missed:.3g} m or rad away"
            raise InvalidInput(f"vias[{i}]", via, rule)
