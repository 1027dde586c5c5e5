"""Tests of episodes observed through a tracker."""

from dataclasses import replace

import numpy as np
import pytest

from app.policies.checkpoints import pretrained
from app.policies.evaluation.pick import selection_rules
from app.policies.evaluation.pick.episodes import PickBench, observe_exactly
from app.policies.evaluation.pick.tracker import (
    ROWS,
    KeypointObserver,
    KeypointSensorRow,
    between,
)
from app.policies.evaluation.registry import evaluate
from app.policies.evaluation.rows import EvaluationRequest
from app.sim.human import model as human
from app.sim.perception.keypoint_sensor_model import KeypointSensorSettings

N = 6


@pytest.fixture(scope="module")
def evaluator():
    request = EvaluationRequest(episodes=N, seed=99)
    bench = PickBench(pretrained.load("pick"), request)
    return bench.evaluator(bench.usual)


def misses(evaluator, row, seed=1):
    """Return the largest difference of observed and true joints at each step [m, rad]."""
    observer, found = KeypointObserver(row, seed), []

    def compared(batch, rows):
        observed, true = observer(batch, rows), observe_exactly(batch, rows)
        found.extend(np.abs(observed.q - true.q).max(axis=(1, 2)))
        np.testing.assert_array_equal(observed.size, true.size)
        return observed

    episodes = evaluator.run(selection_rules.critic(0.2), observe=compared)
    return np.array(found), episodes


def test_a_motion_between_two_states_meets_both_and_goes_straight_on_before():
    rng = np.random.default_rng(2)
    q0, q1 = (human.rest_posture(*rng.uniform(-1, 1, 3)) for _ in range(2))
    qd0, qd1 = rng.uniform(-0.5, 0.5, (2, 18))
    at = between(1.0, q0, qd0, 1.05, q1, qd1)
    np.testing.assert_allclose(at(1.0), q0)
    np.testing.assert_allclose(at(1.05), q1)
    np.testing.assert_allclose((at(1.00001) - q0) / 1e-5, qd0, atol=0.02)
    np.testing.assert_allclose((q1 - at(1.04999)) / 1e-5, qd1, atol=0.02)
    np.testing.assert_allclose(at(0.99), q0 - 0.01 * qd0)


def test_an_exact_tracker_without_delay_shows_nearly_the_true_state(evaluator):
    clean = KeypointSensorRow(
        tracker=KeypointSensorSettings(latency_s=0.0, noise=0.0, missing=0.0)
    )
    found, _ = misses(evaluator, clean)
    assert np.median(found) < 0.02


def test_later_frames_show_less_of_the_truth(evaluator):
    errors = [np.mean(misses(evaluator, ROWS[name])[0]) for name in ("33ms", "100ms", "200ms")]
    assert errors[0] < errors[1] < errors[2]


def test_the_same_seed_gives_the_same_episodes(evaluator):
    row = ROWS["100ms-noise-missing"]
    (one, first), (two, second) = (misses(evaluator, row, 5) for _ in range(2))
    np.testing.assert_array_equal(one, two)
    np.testing.assert_array_equal(first.duration_s, second.duration_s)


def test_a_tracker_without_frames_shows_no_person(evaluator):
    blind = ROWS["100ms"]
    look = KeypointObserver(replace(blind, tracker=replace(blind.tracker, lost=1.0)), 1)
    evaluator.batch.reset()
    seen = look(evaluator.batch, np.arange(N))
    no_person = evaluator.batch.world.people.no_person
    np.testing.assert_array_equal(seen.q, np.tile(no_person, (N, 1, 1)))
    assert not seen.qd.any()


def test_only_running_rows_are_looked_at(evaluator):
    look = KeypointObserver(ROWS["33ms"], 1)
    evaluator.batch.reset()
    assert look(evaluator.batch, np.arange(N)).q.shape == (N, 1, 18)
    assert look(evaluator.batch, np.array([1, 4])).q.shape == (2, 1, 18)
    assert len(look.wrist_errors) == 2 * (N + 2)


def test_the_protocol_has_a_row_for_every_tracker_and_says_how_good_it_is():
    result = evaluate("pick-tracker", pretrained.load("pick"), episodes=4, seed=4)
    assert [row["name"] for row in result["results"]] == ["exact", *ROWS]
    assert result["results"][0]["wrist_error_median_mm"] == 0.0
    assert result["settings"]["trackers"]["200ms"]["tracker"]["latency_s"] == 0.2
    assert result["episodes"] == 4
