"""Several people from one tracker: each keeps the own track, whatever the numbering."""

import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.people_estimate import PeopleEstimator
from tests.sim.tracked_person import CELL, seen, work

DT = 1.0 / 30.0


def two_people() -> tuple[PeopleEstimator, np.ndarray, np.ndarray]:
    """Two people tracked for a second, 0.9 m apart."""
    one, other = work(1, 12.0)[1], work(2, 12.0)[1] + np.eye(18)[0] * 0.9
    people = PeopleEstimator(2, CELL.body)
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
    people = PeopleEstimator(2, CELL.body)
    first, second = people.update(0.0, [seen(one[0])])
    assert first.flags == () and second.flags == ("never-seen",)
    first, second = people.update(DT, [seen(other[1]), seen(one[1])])
    assert second.flags == () and second.person is not None
    np.testing.assert_allclose(second.person.q[:2], other[1, :2], atol=0.01)


def test_wrong_people_are_refused_by_place_and_leave_no_trace() -> None:
    people, one, other = two_people()
    a, b = seen(one[30]), seen(other[30])
    with pytest.raises(InvalidInput, match="at most 2"):
        people.update(30 * DT, [a, b, b])
    with pytest.raises(InvalidInput) as caught:
        people.update(30 * DT, [a, 1000.0 * b])
    assert caught.value.field == "people[1].keypoints"
    with pytest.raises(InvalidInput, match="as many"):
        people.update(30 * DT, [a, b], [None])
    assert all(estimate.flags == () for estimate in people.update(30 * DT, [a, b]))


@pytest.mark.parametrize("n", [0, 5])
def test_more_people_than_a_cell_holds_are_refused(n: int) -> None:
    with pytest.raises(InvalidInput, match="n_people"):
        PeopleEstimator(n, CELL.body)
