"""Tests of measures of joint trajectories: limits, and steps at segment boundaries."""

import numpy as np
import pytest

from app.policies.evaluation.reach.episodes import target_goals
from app.policies.evaluation.reach.smoothness import Paths, measure, record_paths, shown_episode
from app.sim.cells.cell import load_cell
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.robot.actions import ActionSettings
from app.sim.scenario.kernels.episode import SUCCESS
from tests.policies.straight_controller import Straight

CELL = load_cell("shared-workspace")
GOALS = target_goals(CELL.goal_region.targets(), 20)


def driven(degree: int) -> tuple[Paths, ReachBatch]:
    settings = ReachSettings(action=ActionSettings(degree=degree))
    batch = ReachBatch(CELL, len(GOALS), 5, settings)
    return record_paths(batch, Straight(), GOALS), batch


@pytest.fixture(scope="module", params=[2, 3])
def paths(request: pytest.FixtureRequest) -> tuple[Paths, int, ReachBatch]:
    found, batch = driven(request.param)
    return found, request.param, batch


def test_limits_are_kept_and_speeds_are_continuous(paths) -> None:
    found, degree, batch = paths
    row = measure(found, degree, batch.arm)
    assert row["position_margin_rad"] > 0.0
    assert row["speed_rad_s"] <= row["speed_limit_rad_s"] + 1e-9
    assert row["acceleration_rad_s2"] <= row["acceleration_limit_rad_s2"] + 1e-9
    assert row["speed_jump_rad_s"] < 1e-9
    if degree == 3:
        assert row["jerk_rad_s3"] <= row["jerk_limit_rad_s3"] + 1e-6
        assert row["acceleration_jump_rad_s2"] < 1e-9
    else:
        assert row["acceleration_jump_rad_s2"] > 1.0


def test_a_speed_that_jumps_is_found(paths) -> None:
    found, degree, batch = paths
    jumping = found.qd.copy()
    jumping[10, 3, 1] += 1e-4
    row = measure(found._replace(qd=jumping), degree, batch.arm)
    assert row["speed_jump_rad_s"] > 1e-5


def test_a_position_that_jumps_is_found(paths) -> None:
    found, degree, batch = paths
    jumping = found.q.copy()
    jumping[10:, 3, 1] += 1e-6
    row = measure(found._replace(q=jumping), degree, batch.arm)
    assert row["position_jump_rad"] == pytest.approx(1e-6, rel=1e-3)


def test_paths_end_where_episodes_end(paths) -> None:
    found, _, batch = paths
    lengths = np.isfinite(found.distance).sum(axis=0)
    np.testing.assert_array_equal(lengths, np.round(batch.state.elapsed / 0.02) + 1)
    np.testing.assert_array_equal(np.isfinite(found.q).all(axis=2), np.isfinite(found.distance))
    won = np.flatnonzero(found.outcome == SUCCESS)
    assert (found.distance[lengths[won] - 1, won] < 0.1).all()


def test_the_shown_episode_is_the_longest_success(paths) -> None:
    found, _, _ = paths
    shown = shown_episode(found, 0.02)
    lengths = np.isfinite(found.distance).sum(axis=0)
    assert found.outcome[shown["episode"]] == SUCCESS
    assert len(shown["q_rad"]) == lengths[found.outcome == SUCCESS].max()
    np.testing.assert_allclose(shown["q_rad"][0], CELL.robot.home_q)


def test_without_a_success_there_is_nothing_to_show(paths) -> None:
    found, _, _ = paths
    assert shown_episode(found._replace(outcome=np.full(20, 2)), 0.02) is None
