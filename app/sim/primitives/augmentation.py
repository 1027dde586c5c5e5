"""More motions from one: the augmentation of METHOD 3.4, each item a function of its own.

A motion is an array ``q`` of joint positions at equal steps ``dt``. Every function returns a
new motion at the same step and keeps the joint limits where ``q`` does:

- :func:`change_duration`: execution time;
- :func:`insert_pauses`: random pauses, reached and left smoothly;
- :func:`vary_elbow`: another elbow at the same hand trajectory;
- :func:`start_anywhere`: random starting phase;
- :func:`turn_back`: reversed trajectories.

:func:`augment` draws all of them. The thesis varies the elbow by conditioning the primitive on
via points (``app.sim.primitives.via_points`` does that too, and keeps the palm at the via
points only);
:func:`vary_elbow` turns the arm about the line from shoulder to palm instead, the one freedom a
palm at a given place leaves the arm, and so keeps the palm at every sample.

Source: METHOD 3.4, thesis section 5.3.3.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.errors import InvalidInput
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.human.anthropometry import MEDIAN
from app.sim.human.model import Hand
from app.sim.primitives.phase import min_jerk, read
from app.sim.primitives.via_points import PointsOf

SETTLE_S = 0.25
"""Time in which a pause is reached from full pace, and left [s]."""
JUMP = 0.2
"""What a turned elbow may add to a joint's change from one sample to the next [rad]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pause:
    """One stop on the way."""

    at_s: float
    """Time of the unpaused motion at which it stands still [s]."""
    length_s: float
    """How long it stands still [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Augmentation:
    """What :func:`augment` draws. The source gives no numbers; these are ours."""

    pace_spread: float = 0.25
    """Standard deviation of the log of the execution time."""
    pauses_per_motion: float = 0.4
    """Mean number of pauses (Poisson)."""
    pause_s: tuple[float, float] = (0.2, 1.5)
    """Least and greatest length of a pause [s]."""
    swivel_spread: float = 0.35
    """Standard deviation of each elbow's turn [rad]."""
    latest_start: float = 0.0
    """Greatest starting phase; 0: from the beginning."""
    p_reversed: float = 0.5
    """Probability that a motion goes backward."""


def change_duration(q: Vec, factor: float) -> Vec:
    """Return the motion slower or faster along the same path.

    Args:
        q: Joint positions, shape (T, n).
        factor: New duration by old, above 0; rounded to whole steps.

    Returns:
        Joint positions, shape (T', n), ``T' - 1 = round(factor (T - 1))``; ends unchanged.
    """
    if not (np.isfinite(factor) and factor > 0.0):
        raise InvalidInput("factor", factor, "must be above 0")
    steps = max(1, round(factor * (len(q) - 1)))
    return read(q, np.linspace(0.0, 1.0, steps + 1))


def draw_pauses(
    duration_s: float,
    rng: np.random.Generator,
    mean_number: float = 0.4,
    length_s: tuple[float, float] = (0.2, 1.5),
) -> list[Pause]:
    """Draw pauses at random times of a motion, none so near another that they would merge.

    Args:
        duration_s: Duration of the motion [s].
        rng: Source of chance.
        mean_number: Mean of the Poisson number drawn; those that find no room are dropped.
        length_s: Least and greatest length of one [s].
    """
    kept: list[float] = []
    if duration_s > SETTLE_S:
        times = rng.uniform(
            0.5 * SETTLE_S, duration_s - 0.5 * SETTLE_S, rng.poisson(mean_number)
        )
        for at in times:
            if all(abs(at - other) >= SETTLE_S for other in kept):
                kept.append(float(at))
    return [Pause(at_s=at, length_s=float(rng.uniform(*length_s))) for at in sorted(kept)]


def insert_pauses(q: Vec, dt: float, pauses: Sequence[Pause]) -> Vec:
    """Return the motion with pauses, along the same path and nowhere faster.

    The pace falls from 1 to 0 as ``1 - min_jerk`` within SETTLE_S, stays 0, and rises alike.

    Args:
        q: Joint positions, shape (T, n).
        dt: Step between them [s].
        pauses: Stops; SETTLE_S / 2 from both ends and SETTLE_S from one another at least.

    Returns:
        Joint positions, shape (T', n), ``SETTLE_S + length_s`` longer for each pause.
    """
    duration = dt * (len(q) - 1)
    ordered = sorted(pauses, key=lambda pause: pause.at_s)
    _require_room(ordered, duration)
    longer = duration + sum(SETTLE_S + pause.length_s for pause in ordered)
    steps = int(np.ceil(longer / dt - 1e-9))
    return read(q, _paused_time(np.arange(steps + 1.0) * dt, ordered) / duration)


def _require_room(pauses: Sequence[Pause], duration: float) -> None:
    edges = [-0.5 * SETTLE_S, *(pause.at_s for pause in pauses), duration + 0.5 * SETTLE_S]
    for i, pause in enumerate(pauses):
        least = min(edges[i + 1] - edges[i], edges[i + 2] - edges[i + 1])
        if not least >= SETTLE_S - 1e-9:
            rule = f"must be {SETTLE_S / 2} s from the ends and {SETTLE_S} s from the next"
            raise InvalidInput(f"pauses[{i}].at_s", pause.at_s, rule)
        if not pause.length_s >= 0.0:
            raise InvalidInput(f"pauses[{i}].length_s", pause.length_s, "must be at least 0")


def _paused_time(t: Vec, pauses: Sequence[Pause]) -> Vec:
    """Return the time of the unpaused motion [s] at times ``t`` of the paused one [s]."""
    own = t.copy()
    for pause in pauses:
        # In time that already knows the earlier pauses: brake, stand, speed up.
        lost = SETTLE_S + pause.length_s
        begin = pause.at_s - 0.5 * SETTLE_S
        x = (own - begin) / SETTLE_S
        y = (own - begin - SETTLE_S - pause.length_s) / SETTLE_S
        way = pause.at_s - SETTLE_S * _way_left(x) + SETTLE_S * _way_left(1.0 - y)
        own = np.where(x < 0.0, own, np.where(y > 1.0, own - lost, way))
    return own


def _way_left(x: Vec) -> Vec:
    """Return the integral of ``1 - min_jerk`` from x to 1: 1/2 at 0, nothing from 1 on."""
    x = np.clip(x, 0.0, 1.0)
    return np.asarray(0.5 - x + x**4 * (2.5 + x * (-3.0 + x)))


def draw_swivel(n_samples: int, rng: np.random.Generator, spread: float = 0.35) -> Vec:
    """Draw a smooth turn of an elbow over a motion [rad], shape (n_samples,).

    One normal angle, taken on within the first third of the motion and given back within the
    last, so that the postures at both ends stay and motions can follow one another.
    """
    z = np.linspace(0.0, 1.0, n_samples)
    return np.asarray(rng.normal(0.0, spread) * min_jerk(3.0 * z) * min_jerk(3.0 * (1.0 - z)))


def vary_elbow(q: Vec, hand: Hand, swivel: Vec, points: PointsOf) -> Vec:
    """Return the motion with one elbow elsewhere and both palms as they are.

    The arm turns as one about the line from shoulder to palm. Where that leaves the joint
    limits, or the shoulder's angles would jump (they do where the arm is raised straight to the
    side), the whole turn is halved until it does not; at last it is none.

    Args:
        q: Joint positions [m, rad], shape (T, 18).
        hand: Whose elbow, ``"r"`` or ``"l"``.
        swivel: Turn at each sample [rad], right-handed about shoulder to palm, shape (T,).
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
    """Return one arm's joints [rad], shape (4,), turned about the line shoulder to palm.

    With R the upper arm's orientation in the torso, ``R' = T^T Rot(line, turn) T R``, read back
    as ``Ry(-flex) Rx(-+abduct) Rz(rotate)``; of its two solutions that nearer to ``before``.
    """
    arm = q[10:14] if hand == "r" else q[14:18]
    if turn == 0.0:
        return arm
    named, frames = points(q), human.body_frames(q, MEDIAN.vector(0.0))
    line = named[f"hand_{hand}"] - named[f"shoulder_{hand}"]
    torso, upper = frames["torso"][:3, :3], frames[f"upper_arm_{hand}"][:3, :3]
    r = torso.T @ _about(line / np.linalg.norm(line), turn) @ upper
    side = -1.0 if hand == "r" else 1.0
    abduct = -side * np.arcsin(np.clip(r[1, 2], -1.0, 1.0))
    flex, rotate = -np.arctan2(r[0, 2], r[2, 2]), np.arctan2(r[1, 0], r[1, 1])
    one = np.array([flex, abduct, rotate, arm[3]])
    other = np.array([flex + np.pi, np.pi - abduct, rotate + np.pi, arm[3]])
    both = [
        before + np.remainder(way - before + np.pi, 2 * np.pi) - np.pi for way in (one, other)
    ]
    return min(both, key=lambda way: float(np.abs(way - before).sum()))


def _about(axis: Vec, angle: float) -> Vec:
    """Return the rotation by an angle [rad] about a unit axis (Rodrigues), shape (3, 3)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    return np.asarray(turn)


def start_anywhere(q: Vec, phase: float) -> Vec:
    """Return the motion from a phase on, under way at its first sample.

    Args:
        q: Joint positions, shape (T, n).
        phase: Where it starts, in [0, 1).

    Returns:
        Joint positions at the same step, shape (T', n); the end stays, to within one step.
    """
    if not 0.0 <= phase < 1.0:
        raise InvalidInput("phase", phase, "must lie in [0, 1)")
    step = 1.0 / (len(q) - 1)
    steps = int(np.ceil((1.0 - phase) / step - 1e-9))
    return read(q, np.minimum(phase + step * np.arange(steps + 1), 1.0))


def turn_back(q: Vec) -> Vec:
    """Return the motion backward in time, shape (T, n)."""
    return q[::-1].copy()


def augment(
    q: Vec, dt: float, rng: np.random.Generator, how: Augmentation, points: PointsOf
) -> Vec:
    """Return a motion drawn from one: direction, elbows, time, pauses and start.

    Args:
        q: Joint positions [m, rad], shape (T, 18).
        dt: Step between them [s].
        rng: Source of chance; the same state gives the same motion.
        how: What to draw.
        points: Kinematics of the person.
    """
    out = turn_back(q) if rng.random() < how.p_reversed else q.copy()
    hands: tuple[Hand, Hand] = ("r", "l")
    for hand in hands:
        out = vary_elbow(out, hand, draw_swivel(len(out), rng, how.swivel_spread), points)
    out = change_duration(out, float(np.exp(rng.normal(0.0, how.pace_spread))))
    pauses = draw_pauses(dt * (len(out) - 1), rng, how.pauses_per_motion, how.pause_s)
    out = insert_pauses(out, dt, pauses)
    return start_anywhere(out, float(rng.uniform(0.0, how.latest_start)))
