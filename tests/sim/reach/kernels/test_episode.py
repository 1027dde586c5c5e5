"""How an episode stands after a period."""

import pytest

from app.sim.pick.kernels.episode import COLLISION, RUNNING, SUCCESS, TIMEOUT, UNFEASIBLE
from app.sim.reach.kernels.episode import outcome_of


@pytest.mark.parametrize(
    ("collided", "touched", "near", "unfeasible", "time_left", "ends", "expected"),
    [
        (False, False, False, False, 1.0, True, RUNNING),
        (False, False, True, False, 1.0, True, SUCCESS),
        (False, False, True, True, 0.0, True, SUCCESS),
        (True, True, True, False, 1.0, True, COLLISION),
        (False, False, False, True, 1.0, True, UNFEASIBLE),
        (False, False, False, False, 0.0, True, TIMEOUT),
        (True, True, True, False, 1.0, False, RUNNING),
        (False, True, False, False, 1.0, False, RUNNING),
        (False, True, True, False, 1.0, False, COLLISION),
        (False, True, False, False, 0.0, False, COLLISION),
        (False, True, False, True, 1.0, False, COLLISION),
        (False, False, True, False, 1.0, False, SUCCESS),
    ],
)
def test_success_needs_an_episode_without_any_collision(
    collided: bool,
    touched: bool,
    near: bool,
    unfeasible: bool,
    time_left: float,
    ends: bool,
    expected: int,
) -> None:
    assert outcome_of(collided, touched, near, unfeasible, time_left, ends) == expected
