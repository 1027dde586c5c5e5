"""Probabilistic movement primitives: a normal distribution over a person's trajectories.

One joint's position at phase ``z`` is a weighted sum of normalised Gaussians,

    q_j(z) = phi(z)^T w_j,   phi_i(z) = b_i(z) / sum_k b_k(z),
    b_i(z) = exp(-(z - c_i)^2 / (2 h^2)),   c_i evenly from 0 to 1,

and the weights of all joints together are normal, ``w ~ N(mu, Sigma)``. Each demonstration
gives one weight vector by ridge regression, ``w = (Phi^T Phi / T + lambda I)^-1 Phi^T q / T``;
mu is their mean, Sigma their covariance and a small smooth floor. From there, in closed form:

    mean       E[q(z)] = Phi(z) mu
    covariance Cov[q(z)] = Phi(z) Sigma Phi(z)^T
    observing  y = A w + e, e ~ N(0, R):  K = Sigma A^T (A Sigma A^T + R)^-1,
               mu* = mu + K (y - A mu),       Sigma* = (I - K A) Sigma (I - K A)^T + K R K^T

Source: docs/method.md 3.4; Paraschos, Daniel, Peters, Neumann, "Probabilistic Movement
Primitives", NIPS 2013, eqs. (1)-(6), and "Using probabilistic movement primitives in robotics",
Autonomous Robots 42, 2018, sections 3.1-3.3.

Deviates: lambda is per sample, so that it means the same for long and short demonstrations. The
floor ``floor^2 (I x exp(-(c_i - c_k)^2 / (2 l^2)))`` is added to Sigma: n demonstrations span
n - 1 directions only, and without it an observation off their span could not be met at all. The
covariance is in the Joseph form, which is the thesis' and stays positive semidefinite.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.errors import InvalidInput
from app.sim.core.arrays import Vec
from app.sim.primitives.kernels.primitives import N_BASIS

RIDGE = 1e-7
"""Default lambda of the regression."""
FLOOR = 0.01
"""Default standard deviation of the floor [m, rad]."""
FLOOR_LENGTH = 0.25
"""Correlation length of the floor along the phase (l)."""
EXACT = 1e-12
"""Variance of an observation called exact [m^2, rad^2]: one micrometre, one microradian."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProMP:
    """A movement primitive; arrays are read-only."""

    mean: Vec
    """Mean weights mu [m, rad], shape (n_joints, n_basis)."""
    cov: Vec
    """Covariance Sigma of the weights, joint by joint, shape (n_joints * n_basis,) * 2."""
    width: float
    """Width h of the Gaussians [phase]."""
    duration_s: float
    """Geometric mean of the demonstrations' durations [s]."""
    duration_spread: float
    """Standard deviation of the log of the durations."""
    residual: Vec
    """Root-mean-square residual of the regression per joint [m, rad], shape (n_joints,)."""

    def __post_init__(self) -> None:
        for array in (self.mean, self.cov, self.residual):
            array.setflags(write=False)

    @property
    def n_basis(self) -> int:
        """Gaussians per joint."""
        return int(self.mean.shape[1])

    @property
    def n_joints(self) -> int:
        """Number of joints."""
        return int(self.mean.shape[0])


def usual_width(n_basis: int) -> float:
    """Return the width of the Gaussians [phase]: 0.7 of the distance of their centres."""
    return 0.7 / (n_basis - 1)


def basis(phase: Vec, n_basis: int, width: float) -> Vec:
    """Return phi(z), rows that sum to one, shape (m, n_basis).

    Args:
        phase: Phases z, shape (m,).
        n_basis: Number of Gaussians, at least 2.
        width: Their width h [phase].
    """
    centres = np.linspace(0.0, 1.0, n_basis)
    bumps = np.exp(-((np.asarray(phase)[:, None] - centres) ** 2) / (2.0 * width**2))
    return np.asarray(bumps / bumps.sum(axis=1, keepdims=True))


def fit(
    demonstrations: Sequence[Vec],
    durations: Vec,
    *,
    n_basis: int = N_BASIS,
    width: float | None = None,
    ridge: float = RIDGE,
    floor: float = FLOOR,
) -> ProMP:
    """Fit a primitive to demonstrations of one task.

    Args:
        demonstrations: Joint positions [m, rad] at even times, shape (T_i, n_joints) each;
            T_i may differ.
        durations: Durations [s], shape (n,).
        n_basis: Gaussians per joint.
        width: Their width [phase]; None: :func:`usual_width`.
        ridge: lambda of the regression, per sample.
        floor: Standard deviation added to every weight, smoothly along the phase [m, rad].
    """
    motions = _checked(demonstrations, durations, n_basis)
    width = usual_width(n_basis) if width is None else width
    weights, squares = [], []
    for motion in motions:
        phi = basis(np.linspace(0.0, 1.0, len(motion)), n_basis, width)
        found = weights_of(motion, phi, ridge)
        weights.append(found)
        squares.append(np.mean((motion - phi @ found.T) ** 2, axis=0))
    return of_weights(
        np.array(weights),
        durations,
        width=width,
        floor=floor,
        residual=np.sqrt(np.mean(squares, axis=0)),
    )


def weights_of(motion: Vec, phi: Vec, ridge: float = RIDGE) -> Vec:
    """Return the weights of one motion by ridge regression, shape (n_joints, n_basis).

    Args:
        motion: Positions [m, rad], shape (T, n_joints).
        phi: Basis at its samples, shape (T, n_basis).
        ridge: lambda of the regression, per sample.
    """
    gram = phi.T @ phi / len(phi) + ridge * np.eye(phi.shape[1])
    return np.asarray(np.linalg.solve(gram, phi.T @ motion / len(phi)).T)


def of_weights(
    weights: Vec,
    durations: Vec,
    *,
    width: float | None = None,
    floor: float = FLOOR,
    residual: Vec | None = None,
) -> ProMP:
    """Return the primitive of demonstrations whose weights are known.

    Args:
        weights: Weights of each demonstration, shape (n, n_joints, n_basis).
        durations: Durations [s], shape (n,).
        width: Width of the Gaussians [phase]; None: :func:`usual_width`.
        floor: Standard deviation added to every weight, smoothly along the phase [m, rad].
        residual: Residual of the regression [m, rad], shape (n_joints,); None: nothing.
    """
    n, n_joints, n_basis = weights.shape
    away = (weights - weights.mean(axis=0)).reshape(n, -1)
    cov = away.T @ away / max(n - 1, 1)
    cov += np.kron(np.eye(n_joints), _floor(n_basis, floor))
    logs = np.log(np.asarray(durations, dtype=np.float64))
    return ProMP(
        mean=weights.mean(axis=0),
        cov=cov,
        width=usual_width(n_basis) if width is None else width,
        duration_s=float(np.exp(logs.mean())),
        duration_spread=float(logs.std(ddof=1)) if n > 1 else 0.0,
        residual=np.zeros(n_joints) if residual is None else np.array(residual),
    )


def _checked(demonstrations: Sequence[Vec], durations: Vec, n_basis: int) -> list[Vec]:
    """Return the demonstrations as arrays, validated."""
    if len(demonstrations) == 0 or len(demonstrations) != len(durations):
        rule = f"must be at least one and as many as durations ({len(durations)})"
        raise InvalidInput("demonstrations", len(demonstrations), rule)
    motions = [np.asarray(motion, dtype=np.float64) for motion in demonstrations]
    n_joints = motions[0].shape[-1]
    for i, (motion, duration) in enumerate(zip(motions, durations, strict=True)):
        place = f"demonstrations[{i}]"
        if motion.ndim != 2 or motion.shape[1] != n_joints or len(motion) < n_basis:
            rule = f"must have shape (at least {n_basis}, {n_joints})"
            raise InvalidInput(f"{place}.shape", motion.shape, rule)
        if not np.isfinite(motion).all():
            row = int(np.argmin(np.isfinite(motion).all(axis=1)))
            raise InvalidInput(f"{place}[{row}]", motion[row].tolist(), "must be finite")
        if not (np.isfinite(duration) and duration > 0.0):
            raise InvalidInput(f"durations[{i}]", duration, "must be above 0 s")
    return motions


def _floor(n_basis: int, floor: float) -> Vec:
    centres = np.linspace(0.0, 1.0, n_basis)
    apart = centres[:, None] - centres
    return np.asarray(floor**2 * np.exp(-(apart**2) / (2.0 * FLOOR_LENGTH**2)))


def positions(promp: ProMP, weights: Vec, phase: Vec) -> Vec:
    """Return the joint positions of given weights [m, rad], shape (..., m, n_joints).

    Args:
        weights: Weights, shape (..., n_joints, n_basis).
        phase: Phases in [0, 1], shape (m,).
    """
    phi = basis(phase, promp.n_basis, promp.width)
    return np.asarray(phi @ np.swapaxes(weights, -1, -2))


def moments(promp: ProMP, phase: Vec) -> tuple[Vec, Vec]:
    """Return mean and covariance of the joint positions at each phase.

    Args:
        phase: Phases in [0, 1], shape (m,).

    Returns:
        Mean [m, rad], shape (m, n_joints), and covariance, shape (m, n_joints, n_joints),
        without the residual of the regression.
    """
    rows = basis(phase, promp.n_basis, promp.width)
    n, k = promp.n_joints, promp.n_basis
    half = np.tensordot(rows, promp.cov.reshape(n, k, n, k), axes=(1, 1))
    return rows @ promp.mean.T, np.einsum("mjkl,ml->mjk", half, rows)


def gain(promp: ProMP, rows: Vec, noise: Vec) -> Vec:
    """Return ``K = Sigma A^T (A Sigma A^T + R)^-1``, shape (n_weights, m).

    Args:
        rows: Observation matrix A of the weights, shape (m, n_weights).
        noise: Covariance R of the observation, shape (m, m); EXACT is added.
    """
    spread = rows @ promp.cov
    total = spread @ rows.T + noise + EXACT * np.eye(len(rows))
    return np.asarray(np.linalg.solve(total, spread).T)


def observe(promp: ProMP, rows: Vec, values: Vec, noise: Vec) -> ProMP:
    """Return the primitive after an observation ``y = A w + e``, ``e ~ N(0, R)``.

    Args:
        rows: A, shape (m, n_weights), weights joint by joint.
        values: y, shape (m,).
        noise: R, shape (m, m); zero: exactly.

    Source: Paraschos et al. 2013, eqs. (5) and (6).
    """
    factor = gain(promp, rows, noise)
    mean = promp.mean.ravel() + factor @ (values - rows @ promp.mean.ravel())
    keep = np.eye(len(mean)) - factor @ rows
    cov = keep @ promp.cov @ keep.T + factor @ (noise + EXACT * np.eye(len(rows))) @ factor.T
    return replace(promp, mean=mean.reshape(promp.mean.shape), cov=0.5 * (cov + cov.T))


def draw_like(weights: Vec, n: int, rng: np.random.Generator, floor: float = FLOOR) -> Vec:
    """Draw weights from the primitive of given demonstrations, (n, n_joints, n_basis).

    The normal distribution of :func:`of_weights`, without its covariance: normal multiples of
    the demonstrations' differences from their mean, and of the floor.

    Args:
        weights: Weights of each demonstration, shape (m, n_joints, n_basis).
        n: Number of draws.
        floor: Standard deviation of the floor [m, rad].
    """
    mean = weights.mean(axis=0)
    away = (weights - mean) / np.sqrt(max(len(weights) - 1, 1))
    sizes, directions = np.linalg.eigh(_floor(weights.shape[-1], floor))
    root = directions * np.sqrt(np.clip(sizes, 0.0, None))
    # einsum: BLAS would share this little work out to threads, and wait for them.
    drawn = np.einsum("nm,mjk->njk", rng.standard_normal((n, len(weights))), away)
    return np.asarray(mean + drawn + rng.standard_normal(drawn.shape) @ root.T)


def gain_of_ends(weights: Vec, floor: float) -> Vec:
    """Return K of an exact condition on all joints at both ends, (n_weights, 2 n_joints).

    Equal to :func:`gain` of :func:`of_weights` with rows of all joints at z = 0, then at
    z = 1, without the covariance of the weights.

    Args:
        weights: Weights of each demonstration, shape (m, n_joints, n_basis).
        floor: Standard deviation of the floor [m, rad].
    """
    m, n_joints, n_basis = weights.shape
    phi = basis(np.array([0.0, 1.0]), n_basis, usual_width(n_basis))
    away = (weights - weights.mean(axis=0)) / np.sqrt(max(m - 1, 1))
    ends = np.swapaxes(away @ phi.T, 1, 2).reshape(m, -1)
    ground = _floor(n_basis, floor)
    along, alike = ground @ phi.T, phi @ ground @ phi.T
    spread = np.einsum("mw,me->we", away.reshape(m, -1), ends)
    total = ends.T @ ends + np.kron(alike, np.eye(n_joints)) + EXACT * np.eye(2 * n_joints)
    for joint in range(n_joints):
        spread[joint * n_basis : (joint + 1) * n_basis, joint::n_joints] += along
    return np.asarray(np.linalg.solve(total, spread.T).T)
