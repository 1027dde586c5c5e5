"""Several people from one tracker: each keeps the own track, whatever the numbering."""

import itertools
from collections.abc import Sequence

import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.perception.multi_person_tracker import MultiPersonTracker, match_people
from app.sim.perception.person_estimator import PersonEstimate
from tests.sim.postures import posture
from tests.sim.tracked_person import CELL, seen, work

DT = 1.0 / 30.0


def two_people() -> tuple[MultiPersonTracker, np.ndarray, np.ndarray]:
    """Two people tracked for a second, 0.9 m apart."""
    one, other = work(1, 12.0)[1], work(2, 12.0)[1] + np.eye(18)[0] * 0.9
    people = MultiPersonTracker(2, CELL.body)
    for k in range(30):
        for estimate in people.update(k * DT, [seen(one[k]), seen(other[k])]):
            assert estimate.flags == ()
    return people, one, other


def test_two_people_exchanged_are_put_right_and_named_once() -> None:
    people, one, other = two_people()
    for k in (30, 31):
        found = people.update(k * DT, [seen(other[k]), seen(one[k])])
        for estimate, truth in zip(found, (one, other), strict=True):
            assert estimate.flags == (("people-swapped",) if k == 30 else ())
            assert estimate.person is not None
            np.testing.assert_allclose(estimate.person.q[:2], truth[k, :2], atol=0.05)


def test_one_of_two_people_missing_is_stale_and_the_other_goes_on() -> None:
    people, _, other = two_people()
    for k in range(30, 42):
        first, second = people.update(k * DT, [seen(other[k])])
    assert first.stale and not second.stale
    assert people.at(42 * DT)[0].stale


def test_a_new_person_takes_the_free_track() -> None:
    one, other = work(1, 12.0)[1], work(2, 12.0)[1] + np.eye(18)[0] * 0.9
    people = MultiPersonTracker(2, CELL.body)
    first, second = people.update(0.0, [seen(one[0])])
    assert first.flags == () and second.flags == ("never-seen",)
    first, second = people.update(DT, [seen(other[1]), seen(one[1])])
    assert second.flags == () and second.person is not None
    np.testing.assert_allclose(second.person.q[:2], other[1, :2], atol=0.01)


def test_wrong_people_are_refused_by_place_and_leave_no_trace() -> None:
    people, one, other = two_people()
    a, b = seen(one[30]), seen(other[30])
    with pytest.raises(InvalidInput, match="at most 64"):
        people.update(30 * DT, [a] * 65)
    with pytest.raises(InvalidInput) as caught:
        people.update(30 * DT, [a, b[:24]])
    assert caught.value.field == "people[1].keypoints"
    with pytest.raises(InvalidInput, match="later"):
        people.update(29 * DT, [a, b, b])
    with pytest.raises(InvalidInput, match="as many"):
        people.update(30 * DT, [a, b], [None])
    assert all(estimate.flags == () for estimate in people.update(30 * DT, [a, b]))


@pytest.mark.parametrize("n", [0, 5])
def test_more_people_than_a_cell_holds_are_refused(n: int) -> None:
    with pytest.raises(InvalidInput, match="n_people"):
        MultiPersonTracker(n, CELL.body)


def at(distance: float, x: float = 0.0) -> np.ndarray:
    """Key-points of a person who stands so far from the base along y."""
    points = posture("standing", CELL.floor_z)
    return points - [0.2 - x, 1.4 - distance, 0.0]


def following(estimates: tuple[PersonEstimate, ...]) -> list[float]:
    """y of everybody followed [m]."""
    return [
        round(float(one.cylinder.center[1]), 1)
        for one in estimates
        if one.cylinder is not None and not one.stale
    ]


@pytest.mark.parametrize("seed", range(20))
def test_the_match_is_the_best_of_all_assignments(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, m = rng.integers(1, 5), rng.integers(0, 6)
    tracks = [at(y, x) for x, y in rng.uniform(0.0, 3.0, (n, 2))]
    people = [at(y, x) for x, y in rng.uniform(0.0, 3.0, (m, 2))]
    gates = rng.uniform(0.3, 3.0, n).tolist()

    def score(order: Sequence[int | None]) -> tuple[int, float]:
        apart = [
            float(np.linalg.norm(tracks[i] - people[j], axis=1)[0])
            for i, j in enumerate(order)
            if j is not None
        ]
        limits = [gates[i] for i, j in enumerate(order) if j is not None]
        right = all(d <= gate for d, gate in zip(apart, limits, strict=True))
        return (-len(apart), sum(apart)) if right else (1, 0.0)

    choices: list[int | None] = [*range(m), *[None] * n]
    best = min(score(order) for order in itertools.permutations(choices, int(n)))
    assert score(match_people(tracks, people, gates)) == pytest.approx(best)


def test_of_a_crowd_the_nearest_are_followed_and_the_rest_is_named() -> None:
    people = MultiPersonTracker(2, CELL.body, floor_z=CELL.floor_z)
    crowd = [at(4.0), at(1.2), at(6.0), at(2.5), at(9.0)]
    estimates = people.update(0.0, crowd)
    assert following(estimates) == [1.2, 2.5]
    assert all(one.flags == ("people-dropped",) for one in estimates)
    assert [(one.index, one.reason) for one in people.unassigned] == [
        (0, "farther"),
        (2, "farther"),
        (4, "farther"),
    ]
    assert following(people.update(DT, crowd[::-1])) == [1.2, 2.5]
    assert people.update(2 * DT, [at(1.2), at(2.5)])[0].flags == ("people-swapped",)
    assert people.unassigned == ()


def test_a_person_who_comes_nearer_than_the_farthest_followed_takes_that_track() -> None:
    people = MultiPersonTracker(1, CELL.body, floor_z=CELL.floor_z)
    followed, replaced = [], []
    for k in range(90):  # one stands at 2 m, another walks past to 1 m
        y = 3.5 - 1.0 * k * DT
        (estimate,) = people.update(k * DT, [at(2.0), at(max(y, 1.0), x=1.0)])
        followed.append(following((estimate,))[0])
        replaced.append("replaced" in estimate.flags)
        assert "people-dropped" in estimate.flags and len(people.unassigned) == 1
    assert followed[0] == 2.0 and followed[-1] == 1.0
    assert sum(replaced) == 1 and people.unassigned[0].index == 0


def test_two_people_at_one_distance_do_not_take_turns() -> None:
    rng = np.random.default_rng(5)
    people, n = MultiPersonTracker(1, CELL.body, floor_z=CELL.floor_z), 0
    for k in range(90):
        crowd = [at(2.0, x) + 0.02 * rng.standard_normal((25, 3)) for x in (-0.6, 0.6)]
        n += "replaced" in people.update(k * DT, crowd)[0].flags
    assert n == 0


def test_a_ghost_of_one_frame_takes_no_track() -> None:
    people = MultiPersonTracker(1, CELL.body, floor_z=CELL.floor_z)
    for k in range(20):
        crowd = [at(2.0), at(0.8)] if k % 5 == 4 else [at(2.0)]
        (estimate,) = people.update(k * DT, crowd)
        assert following((estimate,)) == [2.0] and "replaced" not in estimate.flags


@pytest.mark.parametrize(("n_tracks", "rate_hz"), [(1, 5.0), (1, 60.0), (2, 30.0), (4, 10.0)])
def test_no_unfollowed_person_is_nearer_for_long_whatever_people_do(
    n_tracks: int, rate_hz: float
) -> None:
    """Six people walk to and fro at 1.5 m/s, and are listed in any order."""
    rng = np.random.default_rng(n_tracks)
    people = MultiPersonTracker(n_tracks, CELL.body, floor_z=CELL.floor_z)
    phases, paces = rng.uniform(0.0, 6.0, 6), rng.uniform(0.4, 0.8, 6)
    nearer_s = 0.0
    for k in range(round(8.0 * rate_hz)):
        t = k / rate_hz
        away = 3.0 + 2.0 * np.sin(phases + paces * t)
        crowd = [at(y, 1.5 * (i - 2.5)) for i, y in enumerate(away)]
        order = rng.permutation(6)
        estimates = people.update(t, [crowd[i] for i in order])
        rest = [one.distance_m for one in people.unassigned if one.distance_m is not None]
        assert len(rest) >= 6 - n_tracks
        seen_ones = [i for i in range(6) if i not in {one.index for one in people.unassigned}]
        farthest = max(float(np.hypot(*crowd[order[i]][:, :2].T).min()) for i in seen_ones)
        nearer_s = nearer_s + 1.0 / rate_hz if min(rest) < farthest - 0.11 else 0.0
        assert nearer_s <= 2.0 / rate_hz
        assert len(following(estimates)) == n_tracks


def test_a_newcomer_takes_the_track_of_a_lost_person_only_where_it_may_be_the_same() -> None:
    people = MultiPersonTracker(1, CELL.body, floor_z=CELL.floor_z)
    people.update(0.0, [at(1.0)])
    for k in range(1, 90):
        (estimate,) = people.update(k * DT, [at(5.0), at(3.0)] if k > 15 else [])
        reached = 1.0 + 0.2 + 1.6 * k * DT
        if reached < 3.0:  # the person lost may still be at 1 m
            assert following((estimate,)) in ([], [1.0]) and estimate.age_s > 0.9 * k * DT
            assert estimate.stale or k * DT < 0.3
        else:
            assert following((estimate,)) == [3.0] and not estimate.stale
    assert [one.index for one in people.unassigned] == [0]


def test_a_newcomer_starts_a_track_of_its_own_and_the_lost_person_comes_back() -> None:
    people = MultiPersonTracker(2, CELL.body, floor_z=CELL.floor_z)
    people.update(0.0, [at(1.0)])
    for k in range(1, 60):
        lost, new = people.update(k * DT, [at(5.0)] if k > 18 else [])
    assert lost.stale and following((new,)) == [5.0]
    both = people.update(60 * DT, [at(5.0), at(1.5)])
    assert following(both) == [1.5, 5.0] and both[0].flags == ("restarted",)


def test_a_person_nearer_than_the_lost_may_be_is_followed() -> None:
    people = MultiPersonTracker(1, CELL.body, floor_z=CELL.floor_z)
    people.update(0.0, [at(6.0)])
    for k in range(1, 25):
        (estimate,) = people.update(k * DT, [at(1.0)] if k > 20 else [])
    assert following((estimate,)) == [1.0] and not estimate.stale


def test_a_skeleton_in_another_frame_costs_no_other_person_anything() -> None:
    people, one, other = two_people()
    for k in range(30, 45):
        a, b = people.update(k * DT, [1000.0 * seen(one[k]), seen(other[k])])
        assert "foreign-frame" in a.flags and "millimetres" in str(a.implausible)
        assert b.flags in ((), ("people-swapped",)) and b.implausible is None
        assert [(o.index, o.reason) for o in people.unassigned] == [(0, "foreign-frame")]
    assert a.stale and a.age_s == pytest.approx(15 * DT)


def test_a_tracker_of_another_frame_has_never_seen_anybody() -> None:
    people = MultiPersonTracker(1, CELL.body, floor_z=CELL.floor_z)
    for k in range(60):
        points = posture("standing", CELL.floor_z) + [0.0, 0.0, 2.0]
        (estimate,) = people.update(k * DT, [points])
        assert {"never-seen", "foreign-frame", "stale"} <= set(estimate.flags)
        assert estimate.person is estimate.cylinder is None and estimate.age_s == np.inf


def test_an_empty_skeleton_takes_no_track() -> None:
    people = MultiPersonTracker(1, CELL.body, floor_z=CELL.floor_z)
    (estimate,) = people.update(0.0, [np.full((25, 3), np.nan), at(1.5), np.zeros((25, 3))])
    assert following((estimate,)) == [1.5] and people.unassigned == ()
