"""Samples of a movement primitive that meet via points and keep the joint limits.

A draw beyond joint limits is *rejected*, so that samples follow the normal distribution
truncated at the limits. After ``tries`` draws one is *projected* instead: the limit becomes a
via point where a joint exceeds it most, repeatedly.

Joint via points are linear and met by Matheron's rule; body via points are met for each draw
(``via_points.meet``).

Source: docs/method.md 3.4; Paraschos et al. 2018, section 3.3; Wilson et al., "Pathwise
conditioning of Gaussian processes", JMLR 22, 2021. Deviates: the source's primitives have no
joint limits.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from app.errors import InvalidInput
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.primitives.promp import ProMP, draw_weights, gain, observe, positions, weight_root
from app.sim.primitives.via_points import (
    MAX_STEPS,
    MET,
    SLACK,
    JointVia,
    PointsOf,
    PointVia,
    Via,
    joint_rows,
    meet,
    noise_of,
    require_vias,
    worst_miss,
)

GRID = np.linspace(0.0, 1.0, 121)
"""Phases at which joint limits are checked."""

AnyVia = TypeVar("AnyVia", JointVia, PointVia)


def beyond_limits(promp: ProMP, weights: Vec) -> Vec:
    """Return the excess of each joint over its limits [m, rad], shape (..., m, 18)."""
    q = positions(promp, weights, GRID)
    over = np.maximum(human.Q_MIN - q, q - human.Q_MAX)
    return np.asarray(np.maximum(over, 0.0))


def into_limits(promp: ProMP, start: Vec, vias: Sequence[Via], points: PointsOf) -> Vec:
    """Return weights near ``start`` that keep the joint limits and meet the via points.

    Args:
        promp: Primitive.
        start: Weights, shape (18, n_basis).
        vias: Via points.
        points: Kinematics of the person.

    Raises:
        InvalidInput: None were found: a via point asks for a posture beyond the limits.
    """
    held: list[Via] = []
    for _ in range(MAX_STEPS):
        weights = meet(promp, start, [*vias, *held], points)
        over = beyond_limits(promp, weights)
        if worst_miss(promp, weights, vias, points) > MET:
            break
        if over.max() <= SLACK:
            return weights
        held += _limits_passed(promp, weights, over)
    names = sorted({name for via in held if isinstance(via, JointVia) for name in via.joints})
    within = f" inside the limits of {', '.join(names)}" if names else ""
    raise InvalidInput("vias", len(vias), f"cannot be met together{within}")


def _limits_passed(promp: ProMP, weights: Vec, over: Vec) -> list[Via]:
    """Return the limits as via points, one for each joint that leaves them, where most."""
    q = positions(promp, weights, GRID)
    found: list[Via] = []
    for j in np.flatnonzero(over.max(axis=0) > SLACK):
        at = int(np.argmax(over[:, j]))
        limit = np.clip(q[at, j : j + 1], human.Q_MIN[j], human.Q_MAX[j])
        found.append(JointVia(phase=float(GRID[at]), q=limit, joints=(human.JOINT_NAMES[j],)))
    return found


def sample(
    promp: ProMP,
    n: int,
    rng: np.random.Generator,
    points: PointsOf,
    vias: Sequence[Via] = (),
    tries: int = 20,
) -> Vec:
    """Draw motions that meet the via points and keep the joint limits.

    Args:
        promp: Primitive of the 18 joints, before conditioning on ``vias``.
        n: Number of motions.
        rng: Source of chance.
        points: Kinematics of the person.
        vias: Via points every motion meets; those with a covariance as closely as it asks.
        tries: Draws that may be rejected for each motion before one is projected.

    Returns:
        Weights, shape (n, 18, n_basis); to be gone through by :func:`follow`.
    """
    require_vias(vias)
    exact = [via for via in vias if via.cov is None]
    places = [via for via in vias if isinstance(via, PointVia)]
    narrowed, draw = _linear_part(promp, [via for via in vias if isinstance(via, JointVia)])
    out = np.empty((n, *promp.mean.shape))
    for i in range(n):
        for _ in range(max(tries, 1)):
            first, drawn = draw(rng), [_drawn(via, rng) for via in places]
            out[i] = meet(narrowed, first, drawn, points)
            met = worst_miss(promp, out[i], exact, points) <= MET
            if met and beyond_limits(promp, out[i]).max() <= SLACK:
                break
        else:
            out[i] = into_limits(narrowed, first, drawn, points)
    return out


def _linear_part(
    promp: ProMP, vias: Sequence[JointVia]
) -> tuple[ProMP, Callable[[np.random.Generator], Vec]]:
    """Return the primitive given its joint via points, and a function that draws from it.

    A draw is ``w + K (y + e - A w)``, w from the primitive and e from the vias' covariances.
    """
    root = weight_root(promp)
    if not vias:
        return promp, lambda rng: draw_weights(promp, 1, rng, root)[0]
    rows = np.concatenate([joint_rows(promp, via) for via in vias])
    values = np.concatenate([via.q for via in vias])
    factor = gain(promp, rows, noise_of(vias))

    def draw(rng: np.random.Generator) -> Vec:
        free = draw_weights(promp, 1, rng, root)[0]
        seen = np.concatenate([_drawn(via, rng).q for via in vias])
        change = factor @ (seen - rows @ free.ravel())
        return np.asarray(free + change.reshape(free.shape))

    return observe(promp, rows, values, noise_of(vias)), draw


def _drawn(via: AnyVia, rng: np.random.Generator) -> AnyVia:
    """Return a via point moved by a draw from its covariance; exact ones stay."""
    if via.cov is None:
        return via
    if isinstance(via, JointVia):
        return replace(via, q=rng.multivariate_normal(via.q, via.cov))
    return replace(via, position=rng.multivariate_normal(via.position, via.cov))


def follow(promp: ProMP, weights: Vec, phase: Vec) -> Vec:
    """Return the joint positions of sampled weights, inside the limits, shape (..., m, 18).

    Args:
        promp: Primitive.
        weights: Weights from :func:`sample`, shape (..., 18, n_basis).
        phase: Phases in [0, 1], shape (m,).
    """
    return np.clip(positions(promp, weights, phase), human.Q_MIN, human.Q_MAX)
