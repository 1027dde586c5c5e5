"""Variation of the elbow along the same palm path, an augmentation of demonstrations.

The thesis varies the elbow by conditioning the primitive on via points, which keeps the palm at
the via points only. :func:`vary_elbow` rotates the arm about the line from shoulder to palm,
its one degree of freedom for a given palm, and keeps the palm at every sample.
``python -m tools.make_primitives --elbow-spread`` applies it to each demonstration.

The other augmentations (execution time, pauses, starting phase, reversal) are drawn per episode
(``kernels/primitives.py``).

Source: docs/method.md 3.4, thesis section 5.3.3.
"""

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.human.anthropometry import MEDIAN
from app.sim.human.model import Hand
from app.sim.primitives.phase import min_jerk

PointsOf = Callable[[Vec], dict[str, Vec]]
"""From joint positions (18,) to the body's points by name [m], each (3,)."""
JUMP = 0.2
"""Largest change that the rotation may add to a joint between two samples [rad]."""


def draw_swivel(n_samples: int, rng: np.random.Generator, spread: float = 0.35) -> Vec:
    """Draw a smooth swivel angle of an elbow over a motion [rad], shape (n_samples,).

    One normal angle, reached within the first third of the motion and undone within the last,
    so that the postures at both ends stay unchanged.
    """
    z = np.linspace(0.0, 1.0, n_samples)
    return np.asarray(rng.normal(0.0, spread) * min_jerk(3.0 * z) * min_jerk(3.0 * (1.0 - z)))


def vary_elbow(q: Vec, hand: Hand, swivel: Vec, points: PointsOf) -> Vec:
    """Return a motion with one elbow rotated and both palms unchanged.

    The arm rotates about the line from shoulder to palm. Where this violates joint limits, or
    the shoulder angles would jump (near abduction of 90 deg), the swivel is halved repeatedly,
    and finally omitted.

    Args:
        q: Joint positions [m, rad], shape (T, 18).
        hand: Hand of the elbow, ``"r"`` or ``"l"``.
        swivel: Angle at each sample [rad], right-handed about shoulder to palm, shape (T,).
        points: Kinematics of the person.
    """
    first = 10 if hand == "r" else 14
    arm = slice(first, first + 4)
    for scale in (1.0, 0.5, 0.25, 0.125, 0.0625):
        out = q.copy()
        for i, turn in enumerate(scale * np.asarray(swivel)):
            before = q[i, arm] if i == 0 else out[i - 1, arm]
            out[i, arm] = _turned(q[i], hand, turn, points, before)
        inside = (out[:, arm] >= human.Q_MIN[arm]) & (out[:, arm] <= human.Q_MAX[arm])
        if inside.all() and np.abs(np.diff(out - q, axis=0)).max(initial=0.0) < JUMP:
            return out
    return q.copy()


def _turned(q: Vec, hand: Hand, turn: float, points: PointsOf, before: Vec) -> Vec:
    """Return the joints of an arm [rad], shape (4,), rotated about the line shoulder to palm.

    With R the upper arm's orientation in the torso, ``R' = T^T Rot(line, turn) T R``, read back
    as ``Ry(-flex) Rx(-+abduct) Rz(rotate)``; of its two solutions that nearer to ``before``.
    """
    arm = q[10:14] if hand == "r" else q[14:18]
    if turn == 0.0:
        return arm
    named, frames = points(q), human.body_frames(q, MEDIAN.vector(0.0))
    line = named[f"hand_{hand}"] - named[f"shoulder_{hand}"]
    torso, upper = frames["torso"][:3, :3], frames[f"upper_arm_{hand}"][:3, :3]
    about = Rotation.from_rotvec(turn * line / np.linalg.norm(line)).as_matrix()
    r = torso.T @ about @ upper
    side = -1.0 if hand == "r" else 1.0
    abduct = -side * np.arcsin(np.clip(r[1, 2], -1.0, 1.0))
    flex, rotate = -np.arctan2(r[0, 2], r[2, 2]), np.arctan2(r[1, 0], r[1, 1])
    one = np.array([flex, abduct, rotate, arm[3]])
    other = np.array([flex + np.pi, np.pi - abduct, rotate + np.pi, arm[3]])
    both = [
        before + np.remainder(arm - before + np.pi, 2 * np.pi) - np.pi for arm in (one, other)
    ]
    return min(both, key=lambda arm: float(np.abs(arm - before).sum()))
