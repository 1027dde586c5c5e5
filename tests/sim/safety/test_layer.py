"""The safety layer on one robot: hand-computed cases, monotony, several people, age, words."""

from dataclasses import replace

import numpy as np
import pytest

from app.errors import InvalidInput, SimulationError
from app.sim.collision.checker import capsule_shapes, no_people, shapes_of
from app.sim.human.kernels import kinematics as body
from app.sim.safety.decision import powers_of_time
from app.sim.safety.layer import SafetyLayer, SafetySettings, safety_settings
from tests.sim.safety.people_before_robot import (
    ARM,
    CELL,
    NO_MARGINS,
    NONE,
    PAN,
    RADIUS,
    REST,
    ahead,
    ball,
    both,
    tool,
)


def least_full_distance(settings, qd, c, age=0.0):
    """The least separation of the ball at which the segment is executed as commanded [m]."""
    layer, low, high = SafetyLayer(ARM, settings), 0.0, 3.0
    for _ in range(30):
        middle = 0.5 * (low + high)
        full = layer.decide(REST, qd, c, NONE, ahead(middle), age).override == 1.0
        low, high = (low, middle) if full else (middle, high)
    layer.decide(REST, qd, c, NONE, ahead(high), age)
    return layer._space.clearance[0].min()


def test_a_robot_at_rest_needs_what_a_person_covers_in_the_reaction():
    """By hand: 1.6 m/s (0.1 s + 0.05 s) + 0.3 m = 0.54 m."""
    assert least_full_distance(SafetySettings(), NONE, NONE) == pytest.approx(0.54, abs=1e-6)


def test_a_turning_robot_needs_the_standard_s_distance_and_hardly_more():
    """S_p = v_h (T_r + T_s) + v_r dt + v_r T_s/2 + D, with T_s = (0.5 / 3) s by hand."""
    _, _, lever = tool()
    v_r, t_s = 0.5 * lever, 0.5 / 3.0
    required = 1.6 * (0.1 + 0.05 + t_s) + v_r * (0.05 + 0.5 * t_s) + 0.3
    found = least_full_distance(SafetySettings(), PAN, NONE)
    assert required - 0.01 < found < required + 0.03


@pytest.mark.parametrize(
    ("change", "more"),
    [
        ({"human_speed": 2.5}, 0.9 * 0.15),
        ({"reaction_time": 0.2}, 0.16),
        ({"tracker_delay": 0.1}, 0.16),
        ({"intrusion_distance": 0.1}, 0.1),
        ({"person_uncertainty": 0.05}, 0.05),
        ({"robot_uncertainty": 0.02}, 0.02),
        ({"protective_distance": 0.5}, 0.2),
    ],
)
def test_every_assumption_costs_its_own_distance(change, more):
    settings = replace(SafetySettings(), **change)
    assert least_full_distance(settings, NONE, NONE) == pytest.approx(0.54 + more, abs=1e-6)


def test_old_data_count_as_distance_lost():
    found = least_full_distance(SafetySettings(), NONE, NONE, age=0.25)
    assert found == pytest.approx(0.54 + 0.4, abs=1e-6)


def test_override_falls_as_a_person_comes_nearer():
    layer = SafetyLayer(ARM, SafetySettings())
    offset = np.linspace(1.6, 0.0, 161)
    falling = [layer.decide(REST, PAN, NONE, NONE, ahead(x)).override for x in offset]
    assert falling[0] == 1.0
    assert falling[-1] == 0.0
    assert (np.diff(falling) <= 0.0).all()
    assert len(set(falling)) > 3


@pytest.mark.parametrize("distance", [0.0, 0.1, 0.29])
def test_override_is_zero_when_a_person_is_inside_the_protective_distance(distance):
    layer = SafetyLayer(ARM, replace(SafetySettings(), human_speed=0.0, reaction_time=0.0))
    decision = layer.decide(REST, PAN, NONE, NONE, ahead(distance))
    assert decision.override == 0.0
    assert decision.qd[0] < PAN[0]


def test_without_people_the_robot_runs_at_full_speed():
    decision = SafetyLayer(ARM, SafetySettings()).decide(REST, PAN, NONE, NONE, no_people())
    assert decision.override == 1.0
    assert decision.q == pytest.approx(REST + 0.05 * PAN)
    assert decision.person is None


def test_the_nearest_of_several_people_sets_the_override():
    layer = SafetyLayer(ARM, SafetySettings())
    near, far = ahead(0.7), shapes_of(CELL, None, np.array([[-3.0, 3.0, 0.3, 1.3]]))
    alone = layer.decide(REST, PAN, NONE, NONE, near)
    together = layer.decide(REST, PAN, NONE, NONE, both(near, far))
    assert together.override == alone.override < 1.0
    assert together.person == 0


def test_more_people_never_raise_the_override():
    rng, layer = np.random.default_rng(7), SafetyLayer(ARM, NO_MARGINS)
    for _ in range(60):
        qd = rng.uniform(-0.5, 0.5, 6)
        one, two = (ball(rng.uniform([-1, 0, 0], [1, 1.5, 1])) for _ in range(2))
        decided = [layer.decide(REST, qd, NONE, NONE, p).override for p in (one, two)]
        assert layer.decide(REST, qd, NONE, NONE, both(one, two)).override <= min(decided)


def test_a_decision_names_person_part_link_and_distances():
    layer = SafetyLayer(ARM, SafetySettings())
    tip, _, lever = tool()
    worker = shapes_of(CELL, np.zeros((1, 18)) + np.array([9.0, 9.0, *16 * [0.0]]))
    walker = shapes_of(CELL, None, np.array([[tip[0] + 0.7, tip[1], 0.3, 1.3]]))
    decision = layer.decide(REST, PAN, NONE, NONE, both(worker, walker))
    assert decision.person == 1
    assert decision.part is None
    assert decision.link in ("wrist_2_link", "wrist_3_link", "forearm_link", "wrist_1_link")
    assert 0.0 < decision.separation < 0.4
    assert decision.required > 0.54
    assert decision.lacking > 0.0
    assert decision.stop_time == pytest.approx(0.5 / 3.0)
    assert decision.stop_distance == pytest.approx(0.5 * 0.5 / 3.0 * 0.5 * ARM.lever[0])
    assert decision.stop_distance >= 0.5 * lever * 0.5 / 6.0


def test_power_and_force_limiting_lets_the_robot_go_on_slowly():
    """A hand in contact may be met at 1.347 m/s, a head at 0.129 m/s."""
    settings = replace(NO_MARGINS, pfl=True)
    tip, offset, lever = tool()
    place = tip + (RADIUS + CELL.robot.tool_radius + 0.001) * offset
    far = np.full((body.N_CAPSULES, 2, 3), 50.0)
    overrides = {}
    for part in (body.C_HAND_R, body.C_HEAD):
        ends = far.copy()
        ends[part] = place
        people = capsule_shapes(ends, np.full(body.N_CAPSULES, RADIUS))
        for speed in (0.1, 0.5):
            qd = PAN * speed / 0.5
            decision = SafetyLayer(ARM, settings).decide(REST, qd, NONE, NONE, people)
            overrides[part, speed] = decision.override
    assert 0.5 * lever < 1.347
    assert 0.1 * lever < 0.129 < 0.5 * lever
    assert overrides[body.C_HAND_R, 0.5] == 1.0
    assert overrides[body.C_HEAD, 0.1] == 1.0
    assert overrides[body.C_HEAD, 0.5] == 0.0


def test_without_power_and_force_limiting_no_contact_is_permitted():
    decision = SafetyLayer(ARM, NO_MARGINS).decide(REST, 0.2 * PAN, NONE, NONE, ahead(0.001))
    assert decision.override == 0.0


def test_the_motion_of_a_decision_starts_and_ends_as_it_says():
    decision = SafetyLayer(ARM, SafetySettings()).decide(REST, PAN, NONE, NONE, ahead(0.6))
    start, end = (decision.at(REST, PAN, t) for t in (0.0, ARM.dt))
    assert start[0] == pytest.approx(REST)
    assert start[1] == pytest.approx(PAN)
    assert end[0] == pytest.approx(decision.q, abs=1e-15)
    assert end[1] == pytest.approx(decision.qd, abs=1e-15)


def test_no_running_person_found_by_search_meets_a_robot_in_motion():
    """Random restarts of a person at v_h: straight at where the tool is or will be."""
    rng, layer, ticks = np.random.default_rng(11), SafetyLayer(ARM, NO_MARGINS), 5
    nearest = np.inf
    for _ in range(120):
        q, qd, sign = REST.copy(), np.zeros(6), rng.choice([-1.0, 1.0], 6)
        person = tool()[0] + rng.normal(size=3) * 0.5
        if np.linalg.norm(person - tool()[0]) < 0.2:
            continue
        for _ in range(24):
            c = np.clip((sign * 0.5 - qd) / (2.0 * ARM.dt), -1.5, 1.5)
            people = ball(person)
            decision = layer.decide(q, qd, c, NONE, people)
            ahead_of = decision.at(q, qd, ARM.dt)[0] + rng.uniform(0.0, 0.3) * decision.qd
            to = tool(ahead_of)[0] - person + 0.02 * rng.normal(size=3)
            step = 1.6 * ARM.dt * to / max(np.linalg.norm(to), 1e-9)
            for part in np.linspace(0.0, 1.0, ticks):
                pose, speed = decision.at(q, qd, part * ARM.dt)
                layer.decide(pose, NONE, NONE, NONE, ball(person + part * step))
                gap = layer._space.clearance[0].min()
                assert np.isfinite([*pose, *speed, gap]).all()
                if np.abs(speed).max() > 1e-6:
                    nearest = min(nearest, gap)
            q, qd, person = decision.q, decision.qd, person + step
            if gap < 0.0:
                break
    assert nearest >= 0.0
    assert nearest < 0.02  # the search does come close


def test_assumptions_of_a_cell_are_stated_with_units():
    stated = safety_settings(CELL).describe()
    assert stated["human_speed [m/s]"] == CELL.safety.human_speed
    assert stated["protective_distance [m]"] == CELL.safety.protective_distance
    assert set(CELL.safety.model_dump()) <= {name.split(" ")[0] for name in stated}


@pytest.mark.parametrize("value", [-0.1, float("nan"), float("inf")])
def test_an_assumption_that_is_no_size_is_refused(value):
    with pytest.raises(InvalidInput, match="tracker_delay"):
        SafetySettings(tracker_delay=value)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_people_whose_numbers_are_not_finite_are_refused(value):
    for row in range(9):
        people = ball(np.array([0.5, 0.5, 0.5]))
        people.capsules[row, 0] = value
        with pytest.raises(SimulationError, match="people"):
            SafetyLayer(ARM, NO_MARGINS).decide(REST, NONE, NONE, NONE, people)


def test_scaled_motion_written_out_in_time_is_the_motion():
    rng = np.random.default_rng(5)
    layer = SafetyLayer(ARM, SafetySettings())
    for deceleration in (0.0, 3.0, 20.0):
        q, qd, c, d = rng.uniform(-1, 1, (4, 6))
        decision = layer.decide(REST, NONE, NONE, NONE, no_people())
        decision = replace(decision, c=c, d=d, path_deceleration=deceleration)
        powers = powers_of_time(decision, q, qd)
        for t in (0.0, 0.01, 0.05):
            expected, speeds = decision.at(q, qd, t)
            series = t ** np.arange(7)
            np.testing.assert_allclose(powers @ series, expected, atol=1e-12)
            slope = powers[:, 1:] @ (np.arange(1, 7) * series[:6])
            np.testing.assert_allclose(slope, speeds, atol=1e-12)
