"""People of known velocity and of observed speed, and the terms that name the decisive part."""

from dataclasses import replace

import numpy as np
import pytest

from app.errors import SimulationError
from app.sim.collision.checker import capsule_shapes, no_people
from app.sim.human.kernels import kinematics as body
from app.sim.safety.layer import SafetyLayer, SafetySettings
from tests.sim.safety.people_before_robot import (
    ARM,
    NONE,
    PAN,
    REST,
    ahead,
    apart,
    tool,
    walker,
)

WALKS = replace(SafetySettings(), use_measured_velocity=True)


@pytest.mark.parametrize(
    ("going", "required"),
    [
        ({}, 0.3 + 0.1 * 0.15),
        ({"toward": 0.8}, 0.3 + (0.8 + 0.1) * 0.15),
        ({"toward": -0.8}, 0.3 + 0.1 * 0.15),
        ({"growth": 0.4}, 0.3 + (0.4 + 0.1) * 0.15),
        ({"growth": -0.4}, 0.3 + 0.1 * 0.15),
    ],
)
def test_whose_velocity_is_known_needs_what_he_covers_at_it(going, required):
    """By hand, at rest: D + (v toward the robot + allowed change) (0.1 s + 0.05 s).

    To a millimetre: the nearest link is not exactly where the person walks to.
    """
    layer, low, high = SafetyLayer(ARM, WALKS), 0.0, 1.5
    for _ in range(30):
        middle = 0.5 * (low + high)
        full = layer.decide(REST, NONE, NONE, NONE, walker(middle, **going)).override == 1.0
        low, high = (low, middle) if full else (middle, high)
    assert apart(walker(high, **going)) == pytest.approx(required, abs=1e-3)


def test_who_walks_past_needs_hardly_more_than_who_stands():
    layer = SafetyLayer(ARM, WALKS)
    assert layer.decide(REST, NONE, NONE, NONE, walker(0.34, across=1.0)).override == 1.0
    assert layer.decide(REST, NONE, NONE, NONE, walker(0.34, toward=1.0)).override == 0.0


@pytest.mark.parametrize(("toward", "stated"), [(0.8, 0.9), (0.0, 0.1), (-0.8, 0.1)])
def test_the_stated_speed_is_that_toward_the_robot_plus_the_change(toward, stated):
    layer, people = SafetyLayer(ARM, WALKS), walker(0.4, toward=toward)
    decision = layer.decide(REST, NONE, NONE, NONE, people)
    _, terms = layer.terms(decision, NONE, people)
    assert terms.human_speed == pytest.approx(stated, abs=3e-3)
    assert terms.separation == pytest.approx(apart(people), abs=1e-9)


@pytest.mark.parametrize("settings", [WALKS, SafetySettings()])
def test_who_is_not_known_to_go_on_is_taken_to_be_as_fast_as_assumed(settings):
    people = replace(walker(0.5), going=None) if settings.use_measured_velocity else walker(0.5)
    layer = SafetyLayer(ARM, settings)
    decision = layer.decide(REST, NONE, NONE, NONE, people)
    assert decision.override == 0.0
    assert layer.terms(decision, NONE, people)[1].human_speed == 1.6


@pytest.mark.parametrize(
    ("people", "speed"),
    [
        (replace(walker(0.5), going=np.array([[1.2, -1.6, 0.5]])), 2.5),
        (replace(walker(0.5), going=np.array([[0.3, 0.4, -0.1]])), 1.6),
        (replace(walker(0.5), going=None, cylinder_speed=np.array([2.5])), 2.5),
        (replace(ahead(0.5), speed=np.array([2.5])), 2.5),
        (replace(ahead(0.5), speed=np.array([1.5])), 1.6),
    ],
)
def test_who_is_observed_faster_than_assumed_counts_at_that_speed(people, speed):
    """By hand, at rest: the distance less that speed times (0.1 s + 0.05 s) may be kept."""
    for more, admitted in ((-1e-6, True), (1e-6, False)):
        protected = apart(people) - speed * 0.15 + more
        layer = SafetyLayer(ARM, replace(SafetySettings(), protective_distance=protected))
        decision = layer.decide(REST, NONE, NONE, NONE, people)
        assert (decision.override == 1.0) is admitted
    assert layer.terms(decision, NONE, people)[1].human_speed == pytest.approx(speed)


@pytest.mark.parametrize(("observed", "speed"), [(2.5, 2.5), (1.0, 1.6)])
def test_who_cannot_be_extrapolated_counts_at_the_observed_speed(observed, speed):
    people = replace(
        walker(0.3), going=np.full((1, 3), np.nan), cylinder_speed=np.array([observed])
    )
    layer = SafetyLayer(ARM, WALKS)
    decision = layer.decide(REST, NONE, NONE, NONE, people)
    assert layer.terms(decision, NONE, people)[1].human_speed == speed


def test_observed_speeds_of_capsules_must_be_numbers():
    with pytest.raises(SimulationError):
        fast = replace(ahead(0.5), speed=np.array([np.nan]))
        SafetyLayer(ARM, SafetySettings()).decide(REST, NONE, NONE, NONE, fast)


def test_of_several_people_each_is_taken_as_what_is_known_of_it():
    near, far = walker(0.4), walker(1.0)
    people = replace(
        near,
        cylinders=np.concatenate([near.cylinders, far.cylinders]),
        going=np.array([[np.nan, 0.0, 0.0], [0.0, 0.0, 0.0]]),
    )
    layer = SafetyLayer(ARM, WALKS)
    held = layer.decide(REST, NONE, NONE, NONE, people)
    assert (held.override, held.person) == (0.0, 0)
    assert layer.terms(held, NONE, people)[1].human_speed == 1.6
    known = replace(people, going=np.zeros((2, 3)))
    assert layer.decide(REST, NONE, NONE, NONE, known).override == 1.0
    assert layer.decide(REST, NONE, NONE, NONE, people).override == 0.0


def test_terms_are_for_who_set_it_and_else_for_the_nearest():
    layer = SafetyLayer(ARM, SafetySettings())
    for distance, stopped in ((0.2, True), (2.0, False)):
        people = ahead(distance)
        decision = layer.decide(REST, PAN, NONE, NONE, people, 0.1)
        person, terms = layer.terms(decision, PAN, people, 0.1)
        assert (decision.override == 0.0) is stopped and person == 0
        assert terms.separation == layer._space.clearance[0].min()
        assert terms.reaction_time == pytest.approx(0.05 + 0.1 + 0.1)
        assert terms.braking == pytest.approx(0.5 * terms.robot_speed * terms.stop_time)
        if stopped:
            assert (terms.link, terms.required) == (decision.link, decision.required)
            assert terms.separation == decision.separation
    alone = layer.decide(REST, PAN, NONE, NONE, no_people())
    assert layer.terms(alone, PAN, no_people()) is None


def test_terms_name_the_nearest_part_of_the_person_and_not_the_first_that_is_too_near():
    layer = SafetyLayer(ARM, SafetySettings())
    distances = np.linspace(0.4, 0.1, body.N_CAPSULES)
    tip, offset, _ = tool()
    centers = tip + distances[:, None] * offset
    ends = np.repeat(centers[:, None], 2, axis=1)
    people = capsule_shapes(ends, np.full(body.N_CAPSULES, 0.05))
    decision = layer.decide(REST, PAN, NONE, NONE, people)
    assert (decision.override, decision.person) == (0.0, 0)
    _, terms = layer.terms(decision, PAN, people)
    assert terms.separation == pytest.approx(layer._space.clearance[0].min())
    assert terms.separation < 0.1


def test_terms_are_those_of_the_fast_hand_and_not_of_the_nearer_body_at_rest():
    tip, offset, _ = tool()
    centers = tip + np.linspace(0.65, 0.8, body.N_CAPSULES)[:, None] * offset
    ends = np.repeat(centers[:, None], 2, axis=1)
    people = capsule_shapes(ends, np.full(body.N_CAPSULES, 0.05))
    speed = np.zeros(people.capsules.shape[1])
    speed[body.N_CAPSULES - 1] = 4.0
    layer = SafetyLayer(ARM, SafetySettings())
    for protective_distance, override in ((0.3, 0.0), (0.0, 1.0)):
        layer = SafetyLayer(ARM, SafetySettings(protective_distance=protective_distance))
        decision = layer.decide(REST, NONE, NONE, NONE, replace(people, speed=speed))
        _, terms = layer.terms(decision, NONE, people)
        assert decision.override == override
        assert (terms.human_speed, terms.required > terms.separation) == (4.0, override == 0.0)


@pytest.mark.parametrize(("toward", "person"), [(1.0, 1), (0.0, 0), (-1.0, 0)])
def test_terms_are_those_of_the_person_with_the_least_reserve_at_known_velocities(
    toward, person
):
    """A person at rest 2.0 m away, and one 2.05 m away that walks at a known velocity."""
    resting, walking = walker(2.0), walker(2.05, toward=toward)
    people = replace(
        resting,
        cylinders=np.concatenate([resting.cylinders, walking.cylinders]),
        going=np.concatenate([resting.going, walking.going]),
    )
    layer = SafetyLayer(ARM, WALKS)
    decision = layer.decide(REST, NONE, NONE, NONE, people)
    assert decision.override == 1.0
    found, terms = layer.terms(decision, NONE, people)
    assert found == person
    assert terms.separation == pytest.approx(apart(walking if person else resting), abs=1e-9)
