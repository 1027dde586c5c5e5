"""Each term of the reward, and their sum."""

import pytest

from app.sim.pick.kernels.reward import RewardWeights, reward, speed_near_target
from app.sim.scenario.kernels.episode import progress

WEIGHTS = RewardWeights(
    c_d=0.5, c_th=0.25, c_c=1.0, c_step=0.02, c_v=2.0, d_v=0.1, c_s=3.0, gamma=1.0
)


def total(**changes: object) -> float:
    step = {
        "d_old": 0.5, "d": 0.5, "tilt_old": 0.3, "tilt": 0.3, "speed": 0.4,
        "collided": False, "succeeded": False, "weights": WEIGHTS,
    }  # fmt: skip
    return reward(*(step | changes).values())


def test_coming_closer_pays_and_moving_away_costs_the_same() -> None:
    assert progress(0.5, 0.4, 0.5, 1.0) == pytest.approx(0.05)
    assert progress(0.4, 0.5, 0.5, 1.0) == pytest.approx(-0.05)


def test_standing_still_costs_the_step_only() -> None:
    assert total() == pytest.approx(-0.02)


def test_collision_costs_and_success_pays() -> None:
    assert total(collided=True) == pytest.approx(-1.02)
    assert total(succeeded=True) == pytest.approx(2.98)


def test_upright_tool_pays() -> None:
    assert total(tilt=0.1) == pytest.approx(0.25 * 0.2 - 0.02)


def test_speed_costs_near_the_target_only() -> None:
    assert speed_near_target(0.4, 0.1, WEIGHTS) == pytest.approx(-0.8)
    assert speed_near_target(0.4, 0.11, WEIGHTS) == 0.0


def test_discounted_progress_pays_for_being_near() -> None:
    assert progress(0.5, 0.5, 1.0, 0.9) == pytest.approx(0.05)
