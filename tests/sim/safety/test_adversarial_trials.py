"""Inside the assumptions no contact finds a link in motion; outside them some do."""

from dataclasses import replace

import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.robot.actions import ActionSettings
from app.sim.safety.adversarial_trials import TrialSettings, run_trial
from app.sim.safety.kernels.adversarial_trials import MODE, POLICY
from app.sim.safety.layer import SafetySettings

NO_MARGINS = SafetySettings(reaction_time=0.0, protective_distance=0.0)
WORKER = TrialSettings(safety=NO_MARGINS)
WALKER = TrialSettings(safety=NO_MARGINS, cell="shared-workspace", people=("walker",))
PLACES = pytest.mark.parametrize("place", [WORKER, WALKER], ids=["worker", "walker"])


@PLACES
def test_inside_the_assumptions_no_contact_finds_a_link_in_motion(place):
    """1,000 episodes each; the slow test and ``evaluate safety-ssm`` run 100,000."""
    result = run_trial(place, 1000, seed=5)
    assert result.n_contacts > 300
    assert result.n_moving == 0
    assert result.fastest_person <= 1.6
    assert 0.0 < result.stopped_share < result.slowed_share < 0.9


@PLACES
def test_a_delay_that_is_known_is_made_up_for(place):
    known = replace(place, true_delay=0.1, safety=replace(NO_MARGINS, tracker_delay=0.1))
    result = run_trial(known, 500, seed=6)
    assert result.n_contacts > 200
    assert result.n_moving == 0


@PLACES
def test_outside_the_assumptions_robots_in_motion_are_met(place):
    assert run_trial(replace(place, true_delay=0.1), 200, seed=7).n_moving > 20
    fast = run_trial(replace(place, human_speed=2.5), 200, seed=7)
    assert fast.n_moving > 20
    assert 2.4 < fast.fastest_person <= 2.5


@PLACES
def test_people_three_percent_faster_than_assumed_are_enough_to_be_met_in_motion(place):
    """So the trial is hard and the rule no more cautious than it must be."""
    assert run_trial(replace(place, human_speed=1.65), 500, seed=7).n_moving > 10


def test_jerk_limited_policies_are_stopped_in_time_too():
    cubic = replace(WALKER, action=ActionSettings(degree=3))
    result = run_trial(cubic, 300, seed=4)
    assert result.n_contacts > 120
    assert result.n_moving == 0


@PLACES
def test_power_and_force_limiting_keeps_contacts_slow_and_stops_less(place):
    touched = run_trial(replace(place, safety=replace(NO_MARGINS, pfl=True)), 500, seed=8)
    assert touched.n_moving == 0
    assert touched.fastest_link > 0.01
    assert touched.stopped_share < run_trial(place, 500, seed=8).stopped_share


def test_two_workers_and_a_walker_are_watched_together():
    crowd = replace(WORKER, people=("worker", "worker", "walker"))
    result = run_trial(crowd, 200, seed=9)
    assert result.n_contacts > 60
    assert result.n_moving == 0


def test_without_the_layer_the_same_people_are_hit():
    free = run_trial(replace(WORKER, monitored=False), 100, seed=5)
    assert free.n_moving > 40
    assert free.stopped_share == 0.0


def test_every_policy_and_every_behaviour_takes_part_evenly():
    rows = run_trial(WORKER, 64, seed=1).rows
    pairs, counts = np.unique(rows[:, [POLICY, MODE]], axis=0, return_counts=True)
    assert pairs.tolist() == [[policy, mode] for policy in range(4) for mode in range(4)]
    assert (counts == 4).all()


def test_the_same_seed_gives_the_same_bits_in_any_cut():
    whole = run_trial(WORKER, 40, seed=2).rows
    parts = [run_trial(WORKER, 20, seed=2, first=k).rows for k in (0, 20)]
    assert np.array_equal(whole, np.concatenate(parts))


def test_no_episodes_and_no_people_are_refused():
    with pytest.raises(InvalidInput, match="episodes"):
        run_trial(WORKER, 0, seed=1)
    with pytest.raises(InvalidInput, match="people"):
        run_trial(replace(WORKER, people=()), 5, seed=1)


def test_a_layer_that_needs_measured_velocities_is_refused():
    with pytest.raises(InvalidInput, match="use_measured_velocity"):
        run_trial(
            replace(WALKER, safety=replace(NO_MARGINS, use_measured_velocity=True)), 5, seed=1
        )


@pytest.mark.slow
@PLACES
def test_fifty_thousand_episodes_without_a_moving_contact(place):
    result = run_trial(place, 50_000, seed=12)
    assert result.n_contacts > 20_000
    assert result.n_moving == 0
