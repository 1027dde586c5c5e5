"""Estimation of one person from key-points: safety cylinder and 18 joint angles with speeds.

Each frame is validated (``keypoint_check.py``), exchanged sides are corrected, outliers are
rejected by gating, and every key-point is filtered (``kalman_filter.py``). Closed forms on the
filtered points give the cylinder (``bounding_cylinder.py``) and the joint angles
(``keypoint_angles.py``); joint speeds are their derivative along the filtered speeds. The
estimator is causal; :meth:`PersonEstimator.at` predicts to any later time, which compensates
latency.

Degradations, named in the estimate:

- a missing key-point is predicted for ``HOLD_S``; then the joints it determines keep their
  angles (``held``) and the cylinder widens to the reach of the missing point;
- arms or legs with exchanged sides are exchanged back (``arms-swapped``, ...); after ``SWAP_S``
  the group is restarted, with sides from the direction the person faces (``sides-restarted``);
- if most key-points moved faster than a person can, the frame is rejected (``jump``); after
  ``HOLD_S`` without a credible frame the person is restarted (``restarted``);
- without detection for ``STALE_S``: ``stale``; after ``HOLD_S`` the last cylinder grows at
  walking speed and the joints are at rest;
- a poor fit of the model is a ``misfit`` (another body size, a bad tracker); beyond ``UNFIT``
  (kneeling, sitting, lying) there are no joint angles, only the cylinder;
- key-points in another frame or unit: ``foreign-frame``; the frame counts as empty;
- arms and legs both contradict the facing direction: ``mirrored``. Either both are exchanged or
  the frame is mirrored, which displaces people: after ``SWAP_S`` without other frames, such
  frames count as ``foreign-frame``.
"""

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from app.errors import InvalidInput, digits
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.human.kernels.kinematics import N_SIZE
from app.sim.human.person import Person
from app.sim.perception.bounding_cylinder import (
    GROWTH,
    SafetyCylinder,
    bounding_box,
    greatest_distance,
    safety_cylinder,
)
from app.sim.perception.kalman_filter import HOLD_S, PointFilter
from app.sim.perception.keypoint_angles import FITTED, fit_errors, joint_angles, joint_motion
from app.sim.perception.keypoint_check import UNSEEN, Keypoints, check_keypoints
from app.sim.perception.keypoints import (
    BODY_25,
    GROUPS,
    N_KEYPOINTS,
    Group,
    K,
    faces_backward,
    swap_sides,
    swapped_against,
)

Flag = Literal[
    "never-seen",
    "arms-swapped",
    "legs-swapped",
    "sides-restarted",
    "people-swapped",
    "people-dropped",
    "replaced",
    "foreign-frame",
    "mirrored",
    "outliers",
    "jump",
    "restarted",
    "clock-jump",
    "stale",
    "misfit",
]
STALE_S = 0.25
"""Age of the newest credible key-point from which an estimate is stale [s]."""
SWAP_S = 0.5
"""Time until a group with exchanged sides is restarted, and a mirrored frame rejected [s]."""
MISFIT = 0.10
"""Median distance of the model's joints, or one of a wrist, that counts as misfit [m]."""
UNFIT = 0.25
"""Misfit of the trunk beyond which there are no joint angles [m]; the median model fits
statures between the 1st and 99th percentile within 0.2 m."""
QD_MAX = 8.0
"""Bound of estimated joint speeds [rad/s, m/s], against noise near singularities."""
_SWAPPED: dict[Group, Flag] = {"arms": "arms-swapped", "legs": "legs-swapped"}
"""Groups with a side check; eyes and ears are too close to each other for it."""
_DECIDING = [K[name] for name in (*FITTED, "mid_hip", "hip_r", "hip_l")]
"""Key-points that determine joint angles."""
_MIRRORED = "arms and legs are mirrored (does one axis point the other way here?)"


@dataclass(frozen=True, slots=True, kw_only=True)
class PersonEstimate:
    """Estimate of one person at one time."""

    t: float
    """Time of the estimate [s]."""
    age_s: float
    """Time since the newest credible key-point [s]; inf without any."""
    cylinder: SafetyCylinder | None
    """Safety cylinder of docs/method.md 2.8; None if no person was ever seen."""
    person: Person | None
    """Joint angles and speeds; None before pelvis and trunk were seen together, and if the
    model does not fit the key-points."""
    held: tuple[str, ...]
    """Joints that keep their last angle for lack of key-points."""
    missing: tuple[str, ...]
    """Key-points unseen for longer than the hold time."""
    outliers: tuple[str, ...]
    """Key-points of the last frame far from all others."""
    misfit_m: float
    """Median distance of the model's joints from the filtered key-points [m]; NaN unknown."""
    flags: tuple[Flag, ...]
    """Degradations of the estimate."""
    unusable: tuple[str, ...] = ()
    """Key-points of the last frame with unusable values."""
    implausible: str | None = None
    """Reason why the last key-points cannot be in the cell's frame; None otherwise."""
    carried_s: float = 0.0
    """Longest prediction of an unseen key-point of trunk or arms [s], at most the hold time."""
    displaced_m: float = 0.0
    """Greatest distance of a key-point of trunk or arms, or of a hand, at ``t`` from where it
    was last measured [m]."""
    wrist_misfit_m: float = 0.0
    """Greatest distance of a wrist of the model from its filtered key-point [m]."""

    @property
    def stale(self) -> bool:
        """Whether no credible key-point is recent."""
        return "stale" in self.flags or "never-seen" in self.flags


class PersonEstimator:
    """Estimator of one person from a stream of frames.

    Args:
        size: The person's size [m], shape (12,) (``Cell.body``).
        floor_z: Height of the floor [m]; None: heights are not checked.
    """

    def __init__(self, size: Vec, floor_z: float | None = None) -> None:
        if np.shape(size) != (N_SIZE,) or not np.isfinite(size).all():
            rule = f"must be {N_SIZE} finite numbers"
            raise InvalidInput("size", np.asarray(size).tolist(), rule)
        self._size, self._floor_z = size, floor_z
        self._points = PointFilter(N_KEYPOINTS)
        self._center = PointFilter(1)
        self._t = self._seen_at = self._mirrored_at = self._mirror_seen_at = -math.inf
        self._swapped_at: dict[Group, float] = {}
        self._q: Vec | None = None
        self.last_points: Vec | None = None
        """Known key-points at the last frame [m], shape (25, 3); None: never seen."""
        self._measured = np.full((N_KEYPOINTS, 3), np.nan)
        self.frame_flags: tuple[Flag, ...] = ()
        """Flags of the last frame."""
        self._frame: Keypoints | None = None
        self._unfit = False

    def update(
        self, t: float, keypoints: ArrayLike, confidences: ArrayLike | None = None
    ) -> PersonEstimate:
        """Process one frame and return the estimate at its time; see :meth:`take`."""
        self.take(t, keypoints, confidences)
        return self.at(t)

    def take(
        self, t: float, keypoints: ArrayLike, confidences: ArrayLike | None = None
    ) -> None:
        """Process one frame.

        Args:
            t: Time of the frame [s], later than the previous one.
            keypoints: Order of BODY_25, cell's frame [m], shape (25, 3); NaN where missing.
            confidences: Confidences in [0, 1], shape (25,); 1 where None.

        Raises:
            InvalidInput: See :func:`~app.sim.perception.keypoint_check.check_keypoints`, or
                ``t`` is not later than the previous time; the state is unchanged.
        """
        self.take_frame(t, check_keypoints(keypoints, confidences, floor_z=self._floor_z))

    def take_frame(self, t: float, frame: Keypoints, fresh: bool = False) -> None:
        """Process one validated frame; see :meth:`take`.

        Args:
            t: Time of the frame [s], later than the previous one.
            frame: Key-points.
            fresh: Whether the frame shows another person; the state is then reset.

        Raises:
            InvalidInput: ``t`` is not later than the previous time; the state is unchanged.
        """
        if not math.isfinite(t) or t <= self._t:
            raise InvalidInput("t", t, f"must be finite and later than {digits(self._t)} s")
        if fresh:
            self._forget()
        flags: list[Flag] = []
        if all(faces_backward(frame.points, group) for group in _SWAPPED):
            flags.append("mirrored")
            if self._mirrored_for(t) > SWAP_S:
                frame = replace(UNSEEN, implausible=_MIRRORED)
        elif frame.seen.any():
            self._mirror_seen_at = -math.inf
        if frame.implausible is not None:
            flags.append("foreign-frame")
        given = frame.points.copy(), frame.confidences.copy()
        points, trust = self._put_sides_right(t, *given, flags)
        rejected = self._points.gate(t, points)
        n_rejected = int(rejected.sum())
        n_judged = int((self._points.known(t) & (trust > 0.0)).sum())
        if n_rejected:
            flags.append("jump" if 2 * n_rejected > n_judged else "outliers")
        # A jump rejects the whole frame, since the rest belongs to the same wrong person.
        drop = np.ones_like(rejected) if "jump" in flags else rejected
        points[drop], trust[drop] = np.nan, 0.0
        restart = math.isfinite(self._seen_at) and not self._points.known(t).any()
        if (trust > 0.0).any():
            if restart:
                flags.append("restarted")
            self._seen_at = t
        self._points.update(t, points, trust)
        self._t, self.frame_flags, self._frame = t, tuple(flags), frame
        self._remember(t)

    def _mirrored_for(self, t: float) -> float:
        """Count a mirrored frame; return the time since the first of them in a row [s]."""
        is_first = t - self._mirror_seen_at > HOLD_S
        self._mirrored_at, self._mirror_seen_at = (t if is_first else self._mirrored_at), t
        return t - self._mirrored_at

    def _forget(self) -> None:
        """Reset to the initial state."""
        self._points.forget(list(range(N_KEYPOINTS)))
        self._center.forget([0])
        self._seen_at, self._mirror_seen_at, self._unfit = -math.inf, -math.inf, False
        self._swapped_at.clear()
        self._q = self.last_points = None

    def _put_sides_right(
        self, t: float, points: Vec, trust: Vec, flags: list[Flag]
    ) -> tuple[Vec, Vec]:
        """Return key-points and confidences with corrected sides."""
        expected = self._points.at(t)[0]
        for group, flag in _SWAPPED.items():
            members = GROUPS[group]
            known = bool(np.isfinite(expected[members]).any())
            since = self._swapped_at.get(group, t)
            if known and t - since > SWAP_S:
                self._points.forget(members)
                del self._swapped_at[group]
                flags.append("sides-restarted")
                known = False
            if known:
                swapped = swapped_against(points, expected, group)
            else:
                swapped = faces_backward(points, group)
            if not swapped:
                if np.isfinite(points[members]).any():
                    self._swapped_at.pop(group, None)
                continue
            if known:
                self._swapped_at.setdefault(group, t)
            points, trust = swap_sides(points, group), swap_sides(trust, group)
            flags.append(flag)
        return points, trust

    def _remember(self, t: float) -> None:
        """Update joint angles and the centre of the cylinder."""
        points = self._points.at(t)[0]
        seen = self._points.seen_at == t
        self._measured[seen] = points[seen]
        known = np.isfinite(points).all(axis=1)
        if not known.any():
            return
        before = human.rest_posture(0.0, 0.0, 0.0) if self._q is None else self._q
        q, held = joint_angles(points, before, self._size)
        if self._q is not None or not held[:5].any():
            self._q = q
            self._unfit = fit_errors(q, self._size, points)[1] > UNFIT
        corners = bounding_box(points[known])
        center = 0.5 * (corners[:1] + corners[7:])
        if self._center.gate(t, center).any():
            self._center.forget([0])
        self._center.update(t, center, np.ones(1))
        self.last_points = points

    def unseen_s(self, t: float) -> float:
        """Return the time since the last credible key-point [s]; inf: never."""
        return max(0.0, t - self._seen_at)

    def expected(self, t: float) -> Vec:
        """Return the predicted key-points at ``t`` [m], shape (25, 3), NaN where unknown."""
        return self._points.at(t)[0]

    def _require_now(self, t: float) -> None:
        if not math.isfinite(t) or t < self._t:
            raise InvalidInput(
                "t", t, f"must be finite and not earlier than {digits(self._t)} s"
            )

    def at(self, t: float) -> PersonEstimate:
        """Return the estimate at ``t`` [s], not earlier than the last frame.

        Raises:
            InvalidInput: ``t`` is earlier than the last frame, or not finite.
        """
        self._require_now(t)
        flags, age = list(self.frame_flags), t - self._seen_at
        points, speeds = self._points.at(t)
        known = np.isfinite(points).all(axis=1)
        person, held, (misfit, _, wrist_misfit) = self._person(points, speeds)
        if self.last_points is None:
            flags.append("never-seen")
        elif age > STALE_S:
            flags.append("stale")
        if max(wrist_misfit, misfit) > MISFIT:
            flags.append("misfit")
        return PersonEstimate(
            t=t,
            age_s=age,
            cylinder=self._cylinder_at(t, points, age),
            person=None if self._unfit else person,
            held=tuple(human.JOINT_NAMES[int(j)] for j in np.flatnonzero(held)),
            missing=tuple(BODY_25[int(k)] for k in np.flatnonzero(~known)),
            outliers=() if self._frame is None else self._frame.outliers,
            misfit_m=misfit,
            flags=tuple(flags),
            unusable=() if self._frame is None else self._frame.unusable,
            implausible=None if self._frame is None else self._frame.implausible,
            carried_s=self._carried_at(t),
            displaced_m=greatest_distance(self._measured, points, _DECIDING),
            wrist_misfit_m=wrist_misfit,
        )

    def _carried_at(self, t: float) -> float:
        """Return the longest current prediction of a key-point of trunk and arms [s]."""
        carried = t - self._points.seen_at[_DECIDING]
        return float(carried[carried <= HOLD_S].max(initial=0.0))

    def person_at(self, t: float) -> Person | None:
        """Return only joint angles and speeds of :meth:`at` at ``t`` [s]."""
        self._require_now(t)
        return self._person(*self._points.at(t))[0]

    def _person(
        self, points: Vec, speeds: Vec
    ) -> tuple[Person | None, NDArray[np.bool_], tuple[float, float, float]]:
        """Return joint angles and speeds, the held joints, and the errors of the fit [m]."""
        if self._q is None:
            return None, np.ones(18, dtype=np.bool_), (math.nan, math.nan, 0.0)
        q, qd, held = joint_motion(points, speeds, self._q, self._size, QD_MAX)
        return Person(q=q, qd=qd, size=self._size), held, fit_errors(q, self._size, points)

    def _cylinder_at(self, t: float, points: Vec, age: float) -> SafetyCylinder | None:
        """Return the cylinder around known key-points at ``t``, else the last one, grown."""
        if self.last_points is None:
            return None
        if np.isfinite(points).any():
            velocity = self._center.at(t)[1][0, :2]
            return safety_cylinder(points, np.nan_to_num(velocity))
        last = safety_cylinder(self.last_points)
        growth = GROWTH * max(0.0, age - HOLD_S)
        return None if last is None else replace(last, radius=last.radius + growth)
