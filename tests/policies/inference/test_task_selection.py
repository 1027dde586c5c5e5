"""The critic's choice: what it answers, what it flags, what it refuses."""

from dataclasses import replace

import numpy as np
import pytest

from app.errors import CheckpointMismatch, InvalidInput
from app.policies.checkpoints import pretrained
from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.inference.task_selection import TaskChooser, select
from app.sim.cells.cell import load_cell
from app.sim.collision.contact import worker_distances
from app.sim.human import model as human
from app.sim.human.anthropometry import percentile_body
from app.sim.human.person import Person
from app.sim.pick.kernels.grasp import LIFT
from app.sim.pick.task_policy import Candidate, MovedPerson, PickProgress
from app.sim.robot.ur10 import Robot
from app.sim.scene.scene import arm_of, people_of

CELL = load_cell("pick-and-place")
HOME = np.array(CELL.robot.home_q)


@pytest.fixture(scope="module")
def chooser():
    return TaskChooser(pretrained.load("pick"), CELL)


def person(x=0.0, y=1.45):
    return Person(q=human.rest_posture(x, y, -np.pi / 2), qd=np.zeros(18))


def cubes(*names):
    return [
        Candidate(id=name, position=np.array(CELL.station(name).position)) for name in names
    ]


def test_the_best_value_is_chosen(chooser):
    decision = chooser.decide(HOME, np.zeros(6), [person()], cubes("cube0", "cube3", "dock1"))
    assert decision.index == int(np.argmax(decision.values))
    assert decision.chosen == ("cube0", "cube3", "dock1")[decision.index]
    assert decision.reachable == (True, True, True)


def test_the_same_state_gives_the_same_bits(chooser):
    twice = [
        chooser.decide(HOME, np.zeros(6), [person()], cubes("cube1", "cube4")) for _ in range(2)
    ]
    assert twice[0].values == twice[1].values
    assert np.array_equal(twice[0].actions, twice[1].actions)


def test_order_of_candidates_does_not_change_their_values(chooser):
    one = chooser.decide(HOME, np.zeros(6), [person()], cubes("cube1", "cube4"))
    other = chooser.decide(HOME, np.zeros(6), [person()], cubes("cube4", "cube1"))
    assert one.values == pytest.approx(other.values[::-1], abs=1e-5)


def test_as_many_people_change_the_values_as_the_policy_observes(chooser):
    nearer_and_nearer = [person(0.5, y) for y in (2.2, 1.8, 1.4)]
    values = [
        chooser.decide(HOME, np.zeros(6), nearer_and_nearer[n:], cubes("cube1")).values
        for n in range(3)
    ]
    assert chooser.observed_people == 2
    assert values[0] == values[1] != values[2]


@pytest.mark.parametrize("hand", ["r", "l"])
@pytest.mark.parametrize(
    ("start", "taken", "free"),
    [("cube2", "cube3", "cube1"), ("cube3", "cube2", "cube4"), ("cube4", "cube3", "cube5")],
)
def test_a_hand_on_one_of_two_equally_near_cubes_turns_the_choice(
    chooser, hand, start, taken, free
):
    q = Robot(CELL.robot.tool_length).ik_vertical(
        np.array(CELL.station(start).position),
        np.array(CELL.robot.q_min),
        np.array(CELL.robot.q_max),
    )
    palm = np.array(CELL.station(taken).position)
    stand = human.rest_posture(palm[0] + (0.1 if hand == "r" else -0.1), 1.15, -np.pi / 2)
    posture = human.reach(hand, palm, stand, CELL.body)
    reaching = Person(q=posture.q, qd=np.zeros(18))
    alone = chooser.decide(q, np.zeros(6), [person()], cubes(taken, free))
    beside = chooser.decide(q, np.zeros(6), [reaching], cubes(taken, free))
    assert posture.reached
    assert beside.chosen == free
    assert beside.values[0] < alone.values[0] - 0.25


def test_map_has_the_distances_of_the_contact_test_with_one_worker_and_with_two(chooser):
    grid = [(x, y) for x in np.linspace(-0.8, 0.8, 9) for y in np.linspace(-0.4, 1.4, 10)]
    moved = MovedPerson(
        index=0, q=np.array([human.rest_posture(x, y, -np.pi / 2) for x, y in grid])
    )
    of_robot, shared = arm_of(CELL), people_of(CELL)
    exact = [
        worker_distances(of_robot, shared, HOME, posture[None], CELL.body[None])[0]
        for posture in moved.q
    ]
    far = person(-3.0, 2.5)
    for people in ([person()], [person(), far]):
        found = chooser.risk_map(HOME, np.zeros(6), people, cubes("cube1", "cube4"), moved)
        np.testing.assert_allclose(found.clearance_m, np.minimum(exact, 1.5), atol=1e-9)
    assert min(exact) <= 0.0 < max(exact)


def test_large_map_is_made_in_parts_between_which_other_threads_run(chooser, monkeypatch):
    """The compiled functions keep the GIL; 50 x 50 positions of 1000 candidates are seconds."""
    places = np.linspace(-0.8, 0.8, 7)
    moved = MovedPerson(
        index=0, q=np.array([human.rest_posture(x, 1.0, -np.pi / 2) for x in places])
    )
    corners = np.random.default_rng(1).uniform([-0.8, 0.3, 0.1], [0.8, 0.9, 0.4], (400, 3))
    many = [Candidate(id=str(i), position=at) for i, at in enumerate(corners)]
    observe, rows = chooser._observer.observe, list[int]()

    def counted(*arguments):
        obs, reachable = observe(*arguments)
        rows.append(len(obs))
        return obs, reachable

    monkeypatch.setattr(chooser._observer, "observe", counted)
    found = chooser.risk_map(HOME, np.zeros(6), [person()], many, moved)
    assert rows == [800, 800, 800, 400]
    for k, posture in enumerate(moved.q):
        alone = MovedPerson(index=0, q=posture[None])
        single = chooser.risk_map(HOME, np.zeros(6), [person()], many, alone)
        assert found.chosen[k] == single.chosen[0]
        for name in ("value", "success", "contact", "clearance_m", "outside"):
            assert getattr(found, name)[k] == pytest.approx(getattr(single, name)[0], abs=1e-5)


def test_hysteresis_keeps_the_previous_choice_until_another_is_clearly_better():
    values = np.array([1.0, 1.15])
    assert select(values, None, 0.2) == 1
    assert select(values, 0, 0.2) == 0
    assert select(np.array([1.0, 1.3]), 0, 0.2) == 1


def test_speeds_stay_inside_the_limits(chooser):
    decision = chooser.decide(HOME, np.zeros(6), [person()], cubes("cube0", "cube5"))
    assert np.all(np.abs(decision.qd_target) <= np.array(CELL.robot.qd_max))
    assert np.all(decision.qd_target[:, 5] == 0.0)


def test_a_candidate_out_of_reach_is_answered_and_flagged(chooser):
    far = Candidate(id="far", position=np.array([3.0, 3.0, 0.1]))
    decision = chooser.decide(HOME, np.zeros(6), [person()], [*cubes("cube0"), far])
    assert decision.reachable == (True, False)
    assert {entry.field for entry in decision.outside_candidates[1]} >= {"position.x"}
    assert np.isfinite(decision.values[1])


BASE = Candidate(id="base", position=np.array([0.0, 0.0, 0.1]))
"""Inside the robot's base, out of reach; the critic values it above a cube."""


@pytest.mark.parametrize("objective", ["value", "success", "time"])
@pytest.mark.parametrize("previous", [None, "base"])
def test_a_candidate_out_of_reach_is_not_chosen_beside_one_in_reach(
    chooser, objective, previous
):
    offered = [BASE, *cubes("cube0")]
    decision = chooser.decide(
        HOME, np.zeros(6), [person()], offered, previous=previous, objective=objective
    )
    assert decision.reachable == (False, True)
    assert decision.values[0] > decision.values[1]
    assert decision.chosen == "cube0"


def test_of_candidates_out_of_reach_the_best_is_chosen(chooser):
    far = Candidate(id="far", position=np.array([3.0, 3.0, 0.1]))
    decision = chooser.decide(HOME, np.zeros(6), [person()], [far, BASE])
    assert decision.reachable == (False, False)
    assert decision.index == int(np.argmax(decision.values))


def test_a_person_beyond_training_is_flagged_with_the_range(chooser):
    decision = chooser.decide(HOME, np.zeros(6), [person(y=2.5)], cubes("cube0"))
    flagged = {entry.field: entry for entry in decision.outside}
    assert flagged["people[0].q.pelvis_y"].high < 2.5


def test_of_several_people_the_nearest_is_seen_in_any_order(chooser):
    near, far, others = person(0.2, 1.15), person(-1.5, 1.6), [person(3.5, 2.5), person(3, 3)]
    offered = cubes("cube0", "cube3", "cube5")
    alone = chooser.decide(HOME, np.zeros(6), [near], offered)
    beside = chooser.decide(HOME, np.zeros(6), [near, far], offered)
    assert beside.values != alone.values
    for people, values in (
        ([*others, near], alone.values),
        ([far, near], beside.values),
        ([*others, far, near], beside.values),
    ):
        decision = chooser.decide(HOME, np.zeros(6), people, offered)
        assert decision.values == values
        assert people[decision.nearest_person] is near


@pytest.mark.parametrize(("left", "flagged"), [(-1.0, 0), (0.0, 0), (20.0, 0), (21.0, 1)])
def test_a_time_left_that_no_episode_of_the_training_had_is_flagged(chooser, left, flagged):
    state = HOME, np.zeros(6), [person()], cubes("cube0")
    found = chooser.decide(*state, time_left_s=left).outside
    assert [one.field for one in found] == ["time_left_s"] * flagged
    assert all((one.value, one.low, one.high) == (left, 0.0, 20.0) for one in found)


def test_fields_outside_training_name_the_person_who_is_seen(chooser):
    people = [person(4.5, 4.5), person(0.0, 2.5)]
    decision = chooser.decide(HOME, np.zeros(6), people, cubes("cube0"))
    assert decision.nearest_person == 1
    named = {entry.field for entry in decision.outside}
    assert "people[1].q.pelvis_y" in named
    assert not any(field.startswith("people[0]") for field in named)


def test_fields_of_the_second_observed_person_are_flagged(chooser):
    fast = replace(person(-1.5, 1.6), qd=np.full(18, 9.0))
    beyond = replace(person(3.5, 2.5), qd=np.full(18, 9.0))  # more than 4 m from the base
    decision = chooser.decide(HOME, np.zeros(6), [beyond, fast, person()], cubes("cube0"))
    assert decision.nearest_person == 2
    assert {one.field.partition(".")[0] for one in decision.outside} == {"people[1]"}
    assert "people[1].qd.pelvis_y" in {one.field for one in decision.outside}


def test_the_size_of_the_person_counts(chooser):
    near = person(0.0, 1.1)
    tall = replace(near, size=percentile_body(99.0, 99.0, 99.0).vector(CELL.floor_z))
    same = replace(near, size=CELL.body)
    offered = cubes("cube2", "cube3")
    values = [
        chooser.decide(HOME, np.zeros(6), [one], offered).values for one in (near, same, tall)
    ]
    assert values[0] == values[1] != values[2]


def test_an_empty_cell_is_answered(chooser):
    decision = chooser.decide(HOME, np.zeros(6), [], cubes("cube0"))
    assert (decision.nearest_person, decision.outside) == (
        None,
        (),
    )  # It was trained beside nobody too.


def test_an_empty_cell_is_flagged_if_training_had_none():
    checkpoint = pretrained.load("pick")
    preset = checkpoint.manifest["preset"]
    preset = {**preset, "people": {**preset["people"], "human_absent": 0.0}}
    always_beside = replace(checkpoint, manifest={**checkpoint.manifest, "preset": preset})
    decision = TaskChooser(always_beside).decide(HOME, np.zeros(6), [], cubes("cube0"))
    assert {one.field for one in decision.outside} >= {"people[0].q.pelvis_y"}


def test_the_arm_inside_the_person_is_answered(chooser):
    decision = chooser.decide(HOME, np.zeros(6), [person(0.0, 0.3)], cubes("cube0", "cube1"))
    assert np.isfinite(decision.values).all()


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"q": np.zeros(5)}, "robot.q"),
        ({"q": np.full(6, np.nan)}, "robot.q[0]"),
        ({"q": np.array([0.0, 2.0, 0, 0, 0, 0])}, "robot.q[1]"),
        ({"qd": np.array([0, 0, np.inf, 0, 0, 0])}, "robot.qd[2]"),
        ({"qd": np.array([0, 0, 0, 0.9, 0, 0])}, "robot.qd[3]"),
        ({"people": [person()] * 5}, "people"),
        ({"people": [Person(q=np.zeros(17), qd=np.zeros(18))]}, "people[0].q"),
        (
            {"people": [person(), Person(q=np.full(18, 900.0), qd=np.zeros(18))]},
            "people[1].q[0]",
        ),
        ({"people": [Person(q=np.full(18, 900.0), qd=np.zeros(18))]}, "people[0].q[0]"),
        ({"candidates": []}, "candidates"),
        ({"candidates": cubes("cube0") * 1001}, "candidates"),
        ({"candidates": cubes("cube0", "cube0")}, "candidates[1].id"),
        (
            {"candidates": [Candidate(id="a", position=np.array([0, np.nan, 0]))]},
            "candidates[0].position[1]",
        ),
        ({"time_left_s": float("-inf")}, "time_left_s"),
    ],
)
def test_bad_input_names_its_field(chooser, change, field):
    call = {
        "q": HOME,
        "qd": np.zeros(6),
        "people": [person()],
        "candidates": cubes("cube0"),
        **change,
    }
    time_left = {"time_left_s": call.pop("time_left_s")} if "time_left_s" in call else {}
    with pytest.raises(InvalidInput) as refused:
        chooser.decide(*call.values(), **time_left)
    assert refused.value.field == field


def test_a_checkpoint_of_another_layout_is_refused():
    shipped = pretrained.load("pick")
    changed = Checkpoint({**shipped.manifest, "layout": [["q", 6]]}, shipped.tensors)
    with pytest.raises(CheckpointMismatch, match="layout"):
        TaskChooser(changed, CELL)


def test_an_object_in_hand_stays_chosen_while_it_is_lifted(chooser):
    state = HOME, np.zeros(6), [person()], cubes("cube0", "cube3", "dock1")
    best = chooser.decide(*state).chosen
    for name in ("cube0", "cube3", "dock1"):
        lifting = PickProgress(phase=LIFT, closing_s=1.25)
        assert chooser.decide(*state, previous=name, progress=lifting).chosen == name
    other = next(name for name in ("cube0", "cube3", "dock1") if name != best)
    assert chooser.decide(*state, previous=other).chosen in (best, other)


def test_probabilities_are_answered_and_may_be_the_objective(chooser):
    state = HOME, np.zeros(6), [person()], cubes("cube0", "cube3", "dock1")
    decision = chooser.decide(*state)
    found = [one for i in range(3) if (one := decision.outcome(i)) is not None]
    assert len(found) == 3
    for one in found:
        assert 0.0 <= one.success_low <= one.success <= one.success_high <= 1.0
        assert one.success + one.contact <= 1.0 + 1e-6
        assert 0.0 < one.time_s < 20.0
    success = [one.success for one in found]
    times = [one.time_s / max(one.success, 0.01) for one in found]
    assert chooser.decide(*state, objective="success").index == int(np.argmax(success))
    assert chooser.decide(*state, objective="time").index == int(np.argmin(times))


def test_a_second_person_counts_for_the_candidate_it_stands_at(chooser):
    palm = np.array(CELL.station("cube5").position)
    stand = human.rest_posture(palm[0] + 0.1, 1.15, -np.pi / 2)
    posture = human.reach("r", palm, stand, CELL.body)
    near = person(-0.2, 1.25)
    alone = chooser.decide(HOME, np.zeros(6), [near], cubes("cube0", "cube5"))
    beside = chooser.decide(
        HOME, np.zeros(6), [near, Person(q=posture.q, qd=np.zeros(18))], cubes("cube0", "cube5")
    )
    assert beside.values[1] < alone.values[1] - 0.25
