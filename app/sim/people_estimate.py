"""From frames of key-points of several people to one estimate of each.

A tracker numbers its people anew in every frame, and exchanges them when they cross. Every
person seen is given to the track it continues, by where that track's key-points were expected;
so exchanged people are put right, and whose number has changed is named (``people-swapped``).
Who continues no track starts a free one. Each track degrades as ``person_estimate.py`` says.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from app.errors import InvalidInput
from app.sim.kernels.people import MAX_PEOPLE
from app.sim.keypoints import N_KEYPOINTS, check_keypoints
from app.sim.person_estimate import EstimatorSettings, PersonEstimate, PersonEstimator
from app.sim.ports import Vec

_NOBODY = np.full((N_KEYPOINTS, 3), np.nan)


def match_people(expected: Sequence[Vec], seen: Sequence[Vec], gate: float) -> list[int | None]:
    """Return for every track which of the people seen continues it, or None.

    The assignment with the most matches counts, of those the one with the least sum of median
    distances; all are tried (4 people: at most 209).

    Args:
        expected: Key-points expected of each track [m], shape (25, 3) each, NaN unknown.
        seen: Key-points of each person seen [m], shape (25, 3) each, NaN missing.
        gate: Median distance beyond which a person is no continuation [m].
    """
    cost = np.full((len(expected), len(seen)), np.inf)
    for i, track in enumerate(expected):
        for j, person in enumerate(seen):
            away = np.linalg.norm(track - person, axis=1)
            if np.isfinite(away).any():
                distance = float(np.nanmedian(away))
                cost[i, j] = distance if distance <= gate else np.inf
    choices: list[int | None] = [*range(len(seen)), *[None] * len(expected)]
    best: list[int | None] = [None] * len(expected)
    least = (math.inf, math.inf)
    for order in set(itertools.permutations(choices, len(expected))):
        costs = [cost[i, j] for i, j in enumerate(order) if j is not None]
        score = (-len(costs), float(sum(costs)))
        if math.isfinite(score[1]) and score < least:
            best, least = list(order), score
    return best


class PeopleEstimator:
    """The estimates of several people whose frames come together, in any order.

    Args:
        n_people: Most people at once, at most four.
        size: The person's size [m], shape (12,) (``Cell.body``).
        settings: Noise, margins and times, the same for all.
    """

    def __init__(
        self, n_people: int, size: Vec, settings: EstimatorSettings | None = None
    ) -> None:
        if not 1 <= n_people <= MAX_PEOPLE:
            raise InvalidInput("n_people", n_people, f"must lie in [1, {MAX_PEOPLE}]")
        self.settings = settings or EstimatorSettings()
        self._tracks = [PersonEstimator(size, self.settings) for _ in range(n_people)]
        self._order: list[int | None] = [None] * n_people

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
                order; nobody may be seen.
            confidences: Trust in them, shape (25,) each; 1 where None.

        Raises:
            InvalidInput: As for one person, and more people than tracks; nothing is taken in.
        """
        trust = [None] * len(people) if confidences is None else list(confidences)
        if len(people) > len(self._tracks):
            rule = f"must be at most {len(self._tracks)}"
            raise InvalidInput("people", len(people), rule)
        if len(trust) != len(people):
            raise InvalidInput("confidences", len(trust), "must be as many as people")
        least = self.settings.min_confidence
        frames = [
            check_keypoints(points, trust[j], least, f"people[{j}].")
            for j, points in enumerate(people)
        ]
        order = self._continue(t, [frame.points for frame in frames])
        estimates = []
        for i, (track, j) in enumerate(zip(self._tracks, order, strict=True)):
            points = _NOBODY if j is None else frames[j].points
            estimate = track.update(t, points, None if j is None else frames[j].confidences)
            if j is not None and self._order[i] not in (None, j):
                estimate = replace(estimate, flags=(*estimate.flags, "people-swapped"))
            if j is not None:
                estimate = replace(estimate, strays=frames[j].strays)
            estimates.append(estimate)
        self._order = [k if j is None else j for j, k in zip(order, self._order, strict=True)]
        return tuple(estimates)

    def _continue(self, t: float, seen: list[Vec]) -> list[int | None]:
        """Return who continues each track; every person seen gets one.

        Who continues none starts a free track, or else shows up as a jump of a lost one.
        """
        limits = self.settings.filter
        expected = [track.expected(t) for track in self._tracks]
        order = match_people(expected, seen, limits.gate + limits.max_speed * limits.hold_s)
        new = [j for j in range(len(seen)) if j not in order]
        unknown = [bool(np.isnan(points).all()) for points in expected]
        for i in sorted(range(len(order)), key=lambda i: not unknown[i]):
            if new and order[i] is None:
                order[i] = new.pop(0)
        return order

    def at(self, t: float) -> tuple[PersonEstimate, ...]:
        """Return the estimates at ``t`` [s], not earlier than the last frame."""
        return tuple(track.at(t) for track in self._tracks)
