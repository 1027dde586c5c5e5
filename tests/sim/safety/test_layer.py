"""The safety layer on one robot: hand-computed cases, monotony, several people, age, words."""

from dataclasses import replace

import numpy as np
import pytest

from app.errors import InvalidInput, SimulationError
from app.sim.cells.cell import load_cell
from app.sim.collision.checker import Checker, Shapes, capsule_shapes, no_people, shapes_of
from app.sim.geometry.capsules import distances
from app.sim.human.kernels import kinematics as body
from app.sim.robot.ur10 import Robot
from app.sim.safety.decision import powers_of_time
from app.sim.safety.layer import SafetyLayer, SafetySettings, safety_settings
from app.sim.scene.scene import arm_of

CELL = load_cell("pick-and-place")
ARM = arm_of(CELL)
REST, NONE = np.array([1.0, -0.8, 0.4, 0.0, 0.0, 0.0]), np.zeros(6)  # stretched out
PAN = np.array([0.5, 0.0, 0.0, 0.0, 0.0, 0.0])
RADIUS = 0.05
NO_MARGINS = SafetySettings(reaction_time=0.0, protective_distance=0.0)


def tool(q=REST):
    """Where the tool's tip is [m], and which offset it goes when the base turns."""
    tip = Robot(ARM.lengths.tool).tcp_pose(q)[:3, 3]
    offset = np.array([-tip[1], tip[0], 0.0])
    return tip, offset / np.linalg.norm(offset), np.hypot(tip[0], tip[1])


def ball(center):
    return capsule_shapes(np.array([[center, center]]), np.array([RADIUS]))


def both(*shapes):
    return Shapes(
        columns=np.concatenate([s.columns for s in shapes], axis=1),
        cylinders=np.concatenate([s.cylinders for s in shapes]),
    )


def ahead(distance):
    """A ball before the turning tool, ``distance`` from its surface."""
    tip, offset, _ = tool()
    return ball(tip + (distance + RADIUS + CELL.robot.tool_radius) * offset)


def least_full_distance(settings, qd, c, age=0.0):
    """The least separation of the ball at which the segment is executed as commanded [m]."""
    layer, low, high = SafetyLayer(ARM, settings), 0.0, 3.0
    for _ in range(30):
        middle = 0.5 * (low + high)
        full = layer.decide(REST, qd, c, NONE, ahead(middle), age).override == 1.0
        low, high = (low, middle) if full else (middle, high)
    layer.decide(REST, qd, c, NONE, ahead(high), age)
    return layer._space.gap[0].min()


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


WALKS = replace(SafetySettings(), use_measured_velocity=True)


def walker(distance, toward=0.0, across=0.0, growth=0.0):
    """A cylinder before the robot at rest, and how it goes on."""
    tip = tool()[0]
    offset = tip[:2] / np.linalg.norm(tip[:2])
    radius = 0.3
    x, y = tip[:2] + (distance + radius + CELL.robot.tool_radius) * offset
    going = np.append(-toward * offset + across * np.array([-offset[1], offset[0]]), growth)
    cylinders = np.array([[x, y, radius, 3.0]])
    return replace(no_people(), cylinders=cylinders, going=going[None])


def apart(people):
    """How far people are from the robot at rest now [m]."""
    return Checker(ARM, people).clearance(REST).people_m


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
    robot = np.empty(ARM.columns.shape[1])
    distances(ball(tip).columns, 0, layer._space.columns[0], robot)
    assert 0.0 < decision.separation < 0.4
    assert decision.required > 0.54
    assert decision.lacking > 0.0
    assert decision.stop_time == pytest.approx(0.5 / 3.0)
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
                gap = layer._space.gap[0].min()
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


def test_people_at_nan_are_refused():
    with pytest.raises(SimulationError, match="people"):
        SafetyLayer(ARM, NO_MARGINS).decide(REST, NONE, NONE, NONE, ball(np.full(3, np.nan)))


def test_terms_are_for_who_set_it_and_else_for_the_nearest():
    layer = SafetyLayer(ARM, SafetySettings())
    for distance, stopped in ((0.2, True), (2.0, False)):
        people = ahead(distance)
        decision = layer.decide(REST, PAN, NONE, NONE, people, 0.1)
        person, terms = layer.terms(decision, PAN, people, 0.1)
        assert (decision.override == 0.0) is stopped and person == 0
        assert terms.separation == layer._space.gap[0].min()
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
    assert terms.separation == pytest.approx(layer._space.gap[0].min())
    assert terms.separation < 0.1


def test_terms_are_those_of_the_fast_hand_and_not_of_the_nearer_body_at_rest():
    tip, offset, _ = tool()
    centers = tip + np.linspace(0.65, 0.8, body.N_CAPSULES)[:, None] * offset
    ends = np.repeat(centers[:, None], 2, axis=1)
    people = capsule_shapes(ends, np.full(body.N_CAPSULES, 0.05))
    speed = np.zeros(people.columns.shape[1])
    speed[body.N_CAPSULES - 1] = 4.0
    layer = SafetyLayer(ARM, SafetySettings())
    for protective_distance, override in ((0.3, 0.0), (0.0, 1.0)):
        layer = SafetyLayer(ARM, SafetySettings(protective_distance=protective_distance))
        decision = layer.decide(REST, NONE, NONE, NONE, replace(people, speed=speed))
        _, terms = layer.terms(decision, NONE, people)
        assert decision.override == override
        assert (terms.human_speed, terms.required > terms.separation) == (4.0, override == 0.0)


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
