"""From frames of key-points of several people to one estimate of each.

A tracker numbers its people anew in every frame, and exchanges them when they cross. Every
person seen is given to the track it continues, by where that track's key-points were expected;
so exchanged people are put right, and whose number has changed is named (``people-swapped``).
The nearest of the others start the free tracks: that of a lost person who can have walked there
at 1.6 m/s since, or one that never saw anybody. Each track degrades as ``person_estimate.py``
says.

A frame may show more people than there are tracks. Then the nearest are followed: somebody who
was already there in the frame before and is nearer to the robot's base than the farthest one
followed, by more than ``NEARER_M``, takes that track (``replaced``). The margin is above the
noise of a tracker, so that two people at one distance do not take turns. All others are named
(:class:`Unfollowed`, ``people-dropped``). A skeleton that cannot stand in the cell's frame
continues no track; the tracks not seen in that frame say ``foreign-frame``.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import linear_sum_assignment

from app.errors import InvalidInput
from app.sim.core.arrays import Vec
from app.sim.people.kernels.people import MAX_PEOPLE
from app.sim.perception.keypoint_check import UNSEEN, Keypoints, check_keypoints
from app.sim.perception.person_estimator import (
    EstimatorSettings,
    Flag,
    PersonEstimate,
    PersonEstimator,
)

MAX_SKELETONS = 64
"""Most people that a frame may show."""
NEARER_M = 0.1
"""By how much nearer than the farthest person followed somebody takes that track [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Unfollowed:
    """A person in a frame that no track follows."""

    index: int
    """Place in the frame."""
    reason: Literal["farther", "jump", "foreign-frame"]
    """Farther away than those who are followed are, or may be; not credible yet; in another
    frame."""
    distance_m: float | None
    """Horizontal distance of the nearest key-point to the robot's base [m]; None: unknown."""
    detail: str | None = None
    """Why this cannot be a person in the cell's frame; None where it can."""


def match_people(
    expected: Sequence[Vec], seen: Sequence[Vec], gates: Sequence[float]
) -> list[int | None]:
    """Return for every track which of the people seen continues it, or None.

    The assignment with the most matches counts, of those the one with the least sum of median
    distances.

    Args:
        expected: Key-points expected of each track [m], shape (25, 3) each, NaN unknown.
        seen: Key-points of each person seen [m], shape (25, 3) each, NaN missing.
        gates: Median distance beyond which a person is no continuation of each track [m].
    """
    cost = np.array([[_apart(track, one) for one in seen] for track in expected])
    cost = cost.reshape(len(expected), len(seen))
    allowed = cost <= np.array(gates)[:, None]
    # Dearer than all that is allowed together: one match more is worth any distance.
    cost[~allowed] = 1.0 + cost[allowed].sum()
    matched: list[int | None] = [None] * len(expected)
    for i, j in zip(*linear_sum_assignment(cost), strict=True):
        if allowed[i, j]:
            matched[int(i)] = int(j)
    return matched


def _apart(one: Vec, other: Vec) -> float:
    """Return the median distance of key-points that both have [m]; inf where none is."""
    away = np.linalg.norm(one - other, axis=1)
    there = away[np.isfinite(away)]
    return float(np.median(there)) if len(there) else np.inf


def _from_base(points: Vec) -> float:
    """Return the horizontal distance of the nearest key-point to the base [m]; inf: none."""
    away = np.hypot(points[:, 0], points[:, 1])
    return float(np.min(away, where=np.isfinite(away), initial=np.inf))


class MultiPersonTracker:
    """The estimates of several people whose frames come together, in any order.

    Args:
        n_people: Most people followed at once, at most four.
        size: The person's size [m], shape (12,) (``Cell.body``).
        settings: Noise, margins and times, the same for all.
        floor_z: Height of the floor [m]; None: heights over it are not judged.
    """

    def __init__(
        self,
        n_people: int,
        size: Vec,
        settings: EstimatorSettings | None = None,
        floor_z: float | None = None,
    ) -> None:
        if not 1 <= n_people <= MAX_PEOPLE:
            raise InvalidInput("n_people", n_people, f"must lie in [1, {MAX_PEOPLE}]")
        self.settings, self._floor_z = settings or EstimatorSettings(), floor_z
        self._tracks = [PersonEstimator(size, self.settings, floor_z) for _ in range(n_people)]
        self._order: list[int | None] = [None] * n_people
        self._flags: list[tuple[Flag, ...]] = [()] * n_people
        self._foreign: str | None = None
        self.observed: list[PersonEstimate | None] = [None] * n_people
        """Estimate of each track at the last frame that showed its person; None: none did."""
        self._waiting: list[Vec] = []
        self._waiting_since = 0.0
        self.unfollowed: tuple[Unfollowed, ...] = ()
        """People in the newest frame that no track follows, nearest first."""

    def update(
        self,
        t: float,
        people: Sequence[ArrayLike],
        confidences: Sequence[ArrayLike | None] | None = None,
    ) -> tuple[PersonEstimate, ...]:
        """Take one frame of all people in and return the estimate of each track.

        Args:
            t: When the frame was taken [s].
            people: Key-points of each person seen [m], shape (25, 3) each, in the tracker's
                order; nobody may be seen, or more than are followed.
            confidences: Trust in them, shape (25,) each; 1 where None.

        Raises:
            InvalidInput: As for one person, and more than 64 people; nothing is taken in.
        """
        trust = [None] * len(people) if confidences is None else list(confidences)
        if len(people) > MAX_SKELETONS:
            raise InvalidInput("people", len(people), f"must be at most {MAX_SKELETONS}")
        if len(trust) != len(people):
            raise InvalidInput("confidences", len(trust), "must be as many as people")
        least = self.settings.min_confidence
        frames = [
            check_keypoints(points, trust[j], least, f"people[{j}].", self._floor_z)
            for j, points in enumerate(people)
        ]
        seen = {j: frame.points for j, frame in enumerate(frames) if frame.seen.any()}
        order, replaced = self._assign(t, seen)
        for i, (track, j) in enumerate(zip(self._tracks, order, strict=True)):
            track.take_frame(t, UNSEEN if j is None else frames[j], fresh=i in replaced)
        self._tell(t, frames, order, replaced)
        estimates = self.at(t)
        for i, track in enumerate(self._tracks):
            if track.unseen_s(t) == 0.0:
                self.observed[i] = estimates[i]
        return estimates

    def _assign(self, t: float, seen: Mapping[int, Vec]) -> tuple[list[int | None], set[int]]:
        """Return who continues each track, and which tracks are taken over by others."""
        limits = self.settings.filter
        expected = [track.expected(t) for track in self._tracks]
        gates = [
            limits.gate + limits.max_speed * min(track.unseen_s(t), limits.hold_s)
            for track in self._tracks
        ]
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
        for i, j in enumerate(order):  # The rest show up as jumps of those who are lost.
            if new and j is None and i not in unknown:
                order[i] = new.pop(0)
        return order, replaced

    def _free_track(self, t: float, points: Vec, free: Sequence[int]) -> int | None:
        """Return which of the tracks that expect nobody a newcomer starts; None for none.

        The track of a lost person who can have walked there, else one that never saw anybody.
        Other lost people are not forgotten for a newcomer: they may still be there.
        """
        here = np.nanmedian(points, axis=0)
        apart = {
            i: float(np.linalg.norm(here - np.nanmedian(last, axis=0))) - self._walked(t, i)
            for i in free
            if (last := self._tracks[i].last_points) is not None
        }
        own = min(apart, key=apart.__getitem__, default=None)
        if own is not None and apart[own] <= self.settings.filter.gate:
            return own
        return next((i for i in free if i not in apart), None)

    def _walked(self, t: float, i: int) -> float:
        """Return how far the person of a track can have got unseen [m]."""
        return self.settings.cylinder.growth * self._tracks[i].unseen_s(t)

    def _nearest(self, t: float, i: int) -> float:
        """Return how near to the base the unseen person of a track may be [m]."""
        last = self._tracks[i].last_points
        return 0.0 if last is None else max(0.0, _from_base(last) - self._walked(t, i))

    def _was_waiting(self, t: float, points: Vec) -> bool:
        """Return whether a person not followed was here in the frame before."""
        limits = self.settings.filter
        since = min(max(t - self._waiting_since, 0.0), limits.hold_s)
        gate = limits.gate + limits.max_speed * since
        return any(_apart(points, before) <= gate for before in self._waiting)

    def _tell(
        self,
        t: float,
        frames: Sequence[Keypoints],
        order: Sequence[int | None],
        replaced: set[int],
    ) -> None:
        """Note the people not followed, and the flags of each track that follow from them."""
        jumps = {
            j
            for track, j in zip(self._tracks, order, strict=True)
            if j is not None and "jump" in track.frame_flags
        }
        unfollowed = [
            Unfollowed(
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
        self.unfollowed = tuple(sorted(unfollowed, key=lambda one: one.distance_m or np.inf))
        self._waiting_since = t
        self._waiting = [frames[one.index].points for one in unfollowed if not one.detail]
        self._foreign = next((frame.implausible for frame in frames if frame.implausible), None)
        dropped = any(one.reason == "farther" for one in unfollowed)
        for i, (j, before) in enumerate(zip(order, self._order, strict=True)):
            flags: list[Flag] = ["replaced"] if i in replaced else []
            another = i in replaced or "restarted" in self._tracks[i].frame_flags
            if not another and None not in (j, before) and before != j:
                flags.append("people-swapped")
            if dropped:
                flags.append("people-dropped")
            if self._foreign and j is None:
                # Somebody is there, and nothing is known of where: as old as can be.
                never = math.isinf(self._tracks[i].unseen_s(t))
                flags += ["foreign-frame", "stale"] if never else ["foreign-frame"]
            self._flags[i] = tuple(flags)
        self._order = [k if j is None else j for j, k in zip(order, self._order, strict=True)]

    def at(self, t: float) -> tuple[PersonEstimate, ...]:
        """Return the estimates at ``t`` [s], not earlier than the last frame."""
        return tuple(
            self._noted(track.at(t), flags)
            for track, flags in zip(self._tracks, self._flags, strict=True)
        )

    def _noted(self, estimate: PersonEstimate, flags: tuple[Flag, ...]) -> PersonEstimate:
        """Return the estimate of one track with the flags that come from all tracks."""
        if not flags:
            return estimate
        foreign = self._foreign if "foreign-frame" in flags else estimate.implausible
        return replace(estimate, flags=(*estimate.flags, *flags), implausible=foreign)
