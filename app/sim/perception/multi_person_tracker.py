"""Tracking of several people from frames of key-points: data association and track management.

A tracker may number people differently in every frame. Each detection is assigned to the track
whose predicted key-points are nearest; a changed number is flagged (``people-swapped``).
Remaining detections start free tracks: that of a lost person who can have walked there at
1.6 m/s, or an unused one. ``person_estimator.py`` describes how each track degrades.

If a frame shows more people than tracks, the nearest are tracked: a detection present in the
previous frame and nearer to the robot's base than the farthest tracked person by more than
``NEARER_M`` takes over that track (``replaced``). The margin exceeds the noise of a tracker, so
that two people at equal distance do not alternate. All others are listed
(:class:`UnassignedDetection`, ``people-dropped``). A skeleton that cannot stand in the cell's
frame, or has no usable key-point, is assigned to no track; tracks not seen in that frame are
flagged ``foreign-frame``.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import scipy
from numpy.typing import ArrayLike

from app.errors import InvalidInput
from app.sim.core.arrays import Vec
from app.sim.people.kernels.people import MAX_PEOPLE
from app.sim.perception.bounding_cylinder import GROWTH
from app.sim.perception.kalman_filter import GATE, HOLD_S, MAX_SPEED
from app.sim.perception.keypoint_check import UNSEEN, Keypoints, check_keypoints
from app.sim.perception.person_estimator import Flag, PersonEstimate, PersonEstimator

MAX_SKELETONS = 64
"""Largest number of people in a frame."""
NEARER_M = 0.1
"""Difference in distance at which a nearer person takes over a track [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UnassignedDetection:
    """A detection assigned to no track."""

    index: int
    """Index in the frame."""
    reason: Literal["farther", "jump", "foreign-frame"]
    """Farther away than all tracked people; not credible yet; in another frame."""
    distance_m: float | None
    """Horizontal distance of the nearest key-point to the robot's base [m]; None: unknown."""
    detail: str | None = None
    """Reason why the key-points cannot be in the cell's frame; None otherwise."""


def match_people(
    expected: Sequence[Vec], seen: Sequence[Vec], gates: Sequence[float]
) -> list[int | None]:
    """Return the detection assigned to each track, or None.

    The assignment maximises the number of matches, then minimises the sum of median distances.

    Args:
        expected: Predicted key-points of each track [m], shape (25, 3) each, NaN unknown.
        seen: Detected key-points of each person [m], shape (25, 3) each, NaN missing.
        gates: Largest median distance of a match for each track [m].
    """
    cost = np.array([[_median_distance(track, one) for one in seen] for track in expected])
    cost = cost.reshape(len(expected), len(seen))
    allowed = cost <= np.array(gates)[:, None]
    # Costlier than all allowed matches together: the number of matches comes first.
    cost[~allowed] = 1.0 + cost[allowed].sum()
    matched: list[int | None] = [None] * len(expected)
    for i, j in zip(*scipy.optimize.linear_sum_assignment(cost), strict=True):
        if allowed[i, j]:
            matched[int(i)] = int(j)
    return matched


def _median_distance(one: Vec, other: Vec) -> float:
    """Return the median distance of common key-points [m]; inf without any."""
    away = np.linalg.norm(one - other, axis=1)
    there = away[np.isfinite(away)]
    return float(np.median(there)) if len(there) else np.inf


def _from_base(points: Vec) -> float:
    """Return the horizontal distance of the nearest key-point to the base [m]; inf: none."""
    away = np.hypot(points[:, 0], points[:, 1])
    return float(np.min(away, where=np.isfinite(away), initial=np.inf))


class MultiPersonTracker:
    """Tracks of several people from common frames.

    Args:
        n_people: Number of tracks, at most four.
        size: The person's size [m], shape (12,) (``Cell.body``).
        floor_z: Height of the floor [m]; None: heights are not checked.
    """

    def __init__(self, n_people: int, size: Vec, floor_z: float | None = None) -> None:
        if not 1 <= n_people <= MAX_PEOPLE:
            raise InvalidInput("n_people", n_people, f"must lie in [1, {MAX_PEOPLE}]")
        self._floor_z = floor_z
        self._tracks = [PersonEstimator(size, floor_z) for _ in range(n_people)]
        self._order: list[int | None] = [None] * n_people
        self._flags: list[tuple[Flag, ...]] = [()] * n_people
        self._foreign: str | None = None
        self.observed: list[PersonEstimate | None] = [None] * n_people
        """Estimate of each track at the last frame that showed its person; None: never."""
        self._waiting: list[Vec] = []
        self._waiting_since = 0.0
        self.unassigned: tuple[UnassignedDetection, ...] = ()
        """Detections of the newest frame assigned to no track, nearest first."""

    def update(
        self,
        t: float,
        people: Sequence[ArrayLike],
        confidences: Sequence[ArrayLike | None] | None = None,
    ) -> tuple[PersonEstimate, ...]:
        """Process one frame of all people and return the estimate of each track.

        Args:
            t: Time of the frame [s].
            people: Key-points of each detection [m], shape (25, 3) each; any number up to 64.
            confidences: Confidences of the key-points, shape (25,) each; 1 where None.

        Raises:
            InvalidInput: As for one person, or more than 64 people; the state is then
            unchanged.
        """
        trust = [None] * len(people) if confidences is None else list(confidences)
        if len(people) > MAX_SKELETONS:
            raise InvalidInput("people", len(people), f"must be at most {MAX_SKELETONS}")
        if len(trust) != len(people):
            raise InvalidInput("confidences", len(trust), "must be as many as people")
        frames = [
            check_keypoints(points, trust[j], f"people[{j}].", self._floor_z)
            for j, points in enumerate(people)
        ]
        seen = {j: frame.points for j, frame in enumerate(frames) if frame.seen.any()}
        order, replaced = self._assign(t, seen)
        for i, (track, j) in enumerate(zip(self._tracks, order, strict=True)):
            track.take_frame(t, UNSEEN if j is None else frames[j], fresh=i in replaced)
        self._set_flags(t, frames, order, replaced)
        estimates = self.at(t)
        for i, track in enumerate(self._tracks):
            if track.unseen_s(t) == 0.0:
                self.observed[i] = estimates[i]
        return estimates

    def _assign(self, t: float, seen: Mapping[int, Vec]) -> tuple[list[int | None], set[int]]:
        """Return the detection of each track, and the tracks taken over by other people."""
        expected = [track.expected(t) for track in self._tracks]
        gates = [GATE + MAX_SPEED * min(track.unseen_s(t), HOLD_S) for track in self._tracks]
        there = list(seen)
        matched = match_people(expected, list(seen.values()), gates)
        order = [None if k is None else there[k] for k in matched]
        new = sorted(set(there) - set(order), key=lambda j: _from_base(seen[j]))
        unknown = [i for i, points in enumerate(expected) if np.isnan(points).all()]
        for one in list(new):
            free = self._free_track(t, seen[one], [i for i in unknown if order[i] is None])
            if free is not None:
                new.remove(one)
                order[free] = one
        replaced = set[int]()
        away = [
            self._nearest(t, i) if j is None else _from_base(seen[j])
            for i, j in enumerate(order)
        ]
        for one in [j for j in new if self._was_waiting(t, seen[j])]:
            far = int(np.argmax(away))
            if _from_base(seen[one]) + NEARER_M < away[far]:
                new.remove(one)
                order[far], away[far] = one, _from_base(seen[one])
                replaced.add(far)
        for i, j in enumerate(order):  # The others become jumps of lost tracks.
            if new and j is None and i not in unknown:
                order[i] = new.pop(0)
        return order, replaced

    def _free_track(self, t: float, points: Vec, free: Sequence[int]) -> int | None:
        """Return the free track that a new detection starts, or None.

        It is the track of a lost person who can have walked there, else an unused track. Other
        lost tracks are kept, since their people may still be present.
        """
        here = np.nanmedian(points, axis=0)
        apart = {
            i: float(np.linalg.norm(here - np.nanmedian(last, axis=0))) - self._walked(t, i)
            for i in free
            if (last := self._tracks[i].last_points) is not None
        }
        own = min(apart, key=apart.__getitem__, default=None)
        if own is not None and apart[own] <= GATE:
            return own
        return next((i for i in free if i not in apart), None)

    def _walked(self, t: float, i: int) -> float:
        """Return the distance that the person of a track can have walked unseen [m]."""
        return GROWTH * self._tracks[i].unseen_s(t)

    def _nearest(self, t: float, i: int) -> float:
        """Return the smallest possible distance of a track's unseen person to the base [m]."""
        last = self._tracks[i].last_points
        return 0.0 if last is None else max(0.0, _from_base(last) - self._walked(t, i))

    def _was_waiting(self, t: float, points: Vec) -> bool:
        """Return whether an untracked detection was present in the previous frame."""
        gate = GATE + MAX_SPEED * min(max(t - self._waiting_since, 0.0), HOLD_S)
        return any(_median_distance(points, before) <= gate for before in self._waiting)

    def _set_flags(
        self,
        t: float,
        frames: Sequence[Keypoints],
        order: Sequence[int | None],
        replaced: set[int],
    ) -> None:
        """Store untracked detections and the flags of each track that follow from them."""
        jumps = {
            j
            for track, j in zip(self._tracks, order, strict=True)
            if j is not None and "jump" in track.frame_flags
        }
        unassigned = [
            UnassignedDetection(
                index=j,
                reason="foreign-frame"
                if frame.implausible
                else "jump"
                if j in jumps
                else "farther",
                distance_m=None if frame.implausible else _from_base(frame.points),
                detail=frame.implausible,
            )
            for j, frame in enumerate(frames)
            if frame.implausible or (frame.seen.any() and (j in jumps or j not in order))
        ]
        distances = [
            math.inf if one.distance_m is None else one.distance_m for one in unassigned
        ]
        self.unassigned = tuple(unassigned[i] for i in np.argsort(distances, kind="stable"))
        self._waiting_since = t
        self._waiting = [frames[one.index].points for one in unassigned if not one.detail]
        self._foreign = next((frame.implausible for frame in frames if frame.implausible), None)
        dropped = any(one.reason == "farther" for one in unassigned)
        for i, (j, before) in enumerate(zip(order, self._order, strict=True)):
            flags: list[Flag] = ["replaced"] if i in replaced else []
            another = i in replaced or "restarted" in self._tracks[i].frame_flags
            if not another and None not in (j, before) and before != j:
                flags.append("people-swapped")
            if dropped:
                flags.append("people-dropped")
            if self._foreign and j is None:
                # A person is present at an unknown place: the estimate counts as stale.
                never = math.isinf(self._tracks[i].unseen_s(t))
                flags += ["foreign-frame", "stale"] if never else ["foreign-frame"]
            self._flags[i] = tuple(flags)
        self._order = [k if j is None else j for j, k in zip(order, self._order, strict=True)]

    def at(self, t: float) -> tuple[PersonEstimate, ...]:
        """Return the estimates at ``t`` [s], not earlier than the last frame."""
        found = []
        for track, flags in zip(self._tracks, self._flags, strict=True):
            one = track.at(t)
            foreign = self._foreign if "foreign-frame" in flags else one.implausible
            found.append(replace(one, flags=(*one.flags, *flags), implausible=foreign))
        return tuple(found)
