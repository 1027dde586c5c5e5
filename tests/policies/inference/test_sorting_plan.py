"""Choice among near-optimal sorting moves by the pick policy."""

from dataclasses import replace

import numpy as np
import pytest

from app.errors import InvalidInput
from app.policies.inference.sorting_plan import PlanQuery, SortingPlanner, reason, score_of
from app.sim.cells.cell import Cell, load_cell
from app.sim.cells.parts import Station
from app.sim.human import model as human
from app.sim.human.person import Person
from app.sim.pick.batch import step_robot
from app.sim.pick.kernels.grasp import LIFT
from app.sim.pick.task_policy import NOT_BEGUN, Decision, Objective, PickProgress
from app.sim.robot.actions import ActionSettings
from app.sim.scene.scene import arm_of
from app.sim.sorting.names import names_of
from app.sim.sorting.state import Move, SortingState, empty_state
from tests.sim.sorting.test_names import with_levels
from tests.support.straight_policy import StraightPolicy

CELL = load_cell("sorting-e0")
SHAPE = names_of(CELL).shape
RED, BLUE = 10, 11
LARGE, BLUE_SMALL = SHAPE.code(0, 2), SHAPE.code(1, 0)
HOME = np.array(CELL.robot.home_q)


def task(*slots: int) -> SortingState:
    """Large red objects in some slots, of which one is wanted on its tower."""
    state = empty_state(SHAPE)
    state.clutter[list(slots)] = LARGE
    state.goal[0, 0] = LARGE
    return state


def query(state: SortingState, **more: object) -> PlanQuery:
    return replace(PlanQuery(q=HOME, qd=np.zeros(6), people=(), state=state), **more)


def planner(cell: Cell = CELL) -> SortingPlanner:
    return SortingPlanner(StraightPolicy(cell), cell)


def reaching_to(cell: int) -> Person:
    """A person whose right hand is near a cell."""
    best, least = human.rest_posture(0.0, 1.15, -np.pi / 2.0), np.inf
    target = np.array(CELL.stations_of("clutter")[cell].position)
    for x in np.linspace(-0.6, 0.6, 25):
        for flex in np.linspace(0.2, 1.6, 15):
            q = human.rest_posture(float(x), 1.15, -np.pi / 2.0)
            q[human.JOINT_NAMES.index("shoulder_r_flex")] = flex
            gap = np.linalg.norm(human.joint_points(q, CELL.body)["hand_r"] - target)
            if gap < least:
                best, least = q, gap
    return Person(q=best, qd=np.zeros(18))


def test_a_hand_at_one_of_two_equal_objects_makes_the_other_one_the_choice() -> None:
    state = task(5, 9)
    free = planner().plan(query(state))
    assert free.chosen is not None
    blocked = free.chosen.move.pick
    beside = planner().plan(query(state, people=(reaching_to(blocked),)))
    assert beside.chosen is not None
    assert beside.chosen.move.pick == ({5, 9} - {blocked}).pop()
    assert {one.move.pick for one in beside.options} == {5, 9}


def test_cell_of_towers_that_are_too_low_for_its_tasks_is_refused() -> None:
    with pytest.raises(InvalidInput, match="levels for each cluster"):
        planner(with_levels(CELL, 2))
    assert planner(with_levels(CELL, 12)).plan(query(task(5))).chosen is not None


def test_riskier_object_is_no_option_within_the_margin() -> None:
    state = task(5, 9)
    state.fail[9] = 0.4
    assert [one.move for one in planner().plan(query(state)).options] == [Move(5, RED)]
    wide = planner().plan(query(state, margin=0.7))
    assert {one.move for one in wide.options} == {Move(5, RED), Move(9, RED)}


def test_segment_is_the_first_control_cycle_of_the_policy_s_motion() -> None:
    found = planner().plan(query(task(5)))
    assert found.symbol == "pick" and found.decision is not None and found.segment is not None
    act = found.decision.actions[0]
    wanted = step_robot(arm_of(CELL), HOME, np.zeros(6), np.zeros(6), act)
    np.testing.assert_array_equal(found.segment.c, wanted.c)
    assert np.abs(found.segment.qd).max() > 0.0


def test_segment_of_limited_jerk_starts_at_the_measured_accelerations() -> None:
    policy = StraightPolicy(CELL)
    policy.action = ActionSettings(degree=3)
    smooth = SortingPlanner(policy, CELL)
    with pytest.raises(InvalidInput, match=r"robot\.qdd = None must be given"):
        smooth.plan(query(task(5)))
    qdd = np.array([0.3, -0.2, 0.1, 0.0, 0.2, 0.0])
    found = smooth.plan(query(task(5), qdd=qdd))
    assert found.segment is not None and found.decision is not None
    act, rest = found.decision.actions[0], np.zeros(6)
    wanted, from_rest = (
        step_robot(arm_of(CELL), HOME, rest, start, act, policy.action) for start in (qdd, rest)
    )
    np.testing.assert_array_equal(found.segment.qd, wanted.qd)
    assert np.abs(wanted.qd - from_rest.qd).max() > 1e-3


def test_targets_lie_over_the_top_of_a_tower_and_over_its_next_level() -> None:
    state = empty_state(SHAPE)
    state.towers[0, :2] = LARGE, LARGE
    state.goal[1, 0] = LARGE
    state.goal[0, 0] = LARGE
    found = planner().plan(query(state))
    assert found.chosen is not None and found.chosen.move == Move(RED, BLUE)
    red, blue = (one.points() for one in CELL.stations_of("cluster"))
    depth = StraightPolicy.grasp.depth
    assert found.chosen.pick is not None
    np.testing.assert_allclose(found.chosen.pick.position, red[1] + (0.0, 0.0, depth))
    np.testing.assert_allclose(found.chosen.place.position, blue[0] + (0.0, 0.0, depth))


def test_held_object_is_placed_by_a_near_optimal_move() -> None:
    found = planner().plan(query(task(5, 9), held=9))
    assert found.symbol == "place" and found.chosen is not None
    assert (found.chosen.move, found.chosen.pick) == (Move(9, RED), None)


def test_held_object_that_must_wait_returns_to_where_it_was_picked() -> None:
    state = task(5)
    state.clutter[7] = BLUE_SMALL
    found = planner().plan(query(state, held=7))
    assert found.symbol == "return" and found.chosen is not None
    assert found.chosen.move == Move(7, 7)
    back = np.array(CELL.stations_of("clutter")[7].position)
    assert found.chosen.place.position[:2] == pytest.approx(back[:2])
    assert "places the held object" in reason(found, "value")


def test_held_object_is_placed_although_it_was_the_riskier_one_to_pick() -> None:
    state = task(5, 9)
    state.fail[9] = 0.9
    found = planner().plan(query(state, held=9))
    assert found.symbol == "place" and found.chosen is not None
    assert (found.chosen.move, found.chosen.attempts) == (Move(9, RED), 1.0)
    assert state.fail[9] == 0.9


def test_object_that_returns_will_be_picked_at_its_own_risk() -> None:
    small = SHAPE.code(0, 0)
    state = task(5)
    state.clutter[7], state.fail[7], state.goal[0, 1] = small, 0.5, small
    found = planner().plan(query(state, held=7))
    assert found.symbol == "return" and found.near.plan.attempts == pytest.approx(3.0)


def test_held_object_of_a_solved_task_returns() -> None:
    state = empty_state(SHAPE)
    state.clutter[7] = BLUE_SMALL
    found = planner().plan(query(state, held=7))
    assert found.symbol == "return"
    assert reason(found, "value") == "Every tower matches the goal without the held object."


@pytest.mark.parametrize(("lead", "stays"), [(0.4, True), (0.6, False)])
def test_previous_object_is_kept_within_the_hysteresis(lead: float, stays: bool) -> None:
    state = task(5, 9)
    options = planner().plan(query(state)).options
    scores = {one.move.pick: score_of(one, "value") for one in options}
    best, other = sorted(scores, key=lambda pick: -scores[pick])
    policy = StraightPolicy(CELL)
    decide = policy.decide

    def raised(*args: object, **more: object) -> Decision:
        found = decide(*args, **more)  # type: ignore[arg-type]
        ids = [one.id for one in args[3]]  # type: ignore[index]
        gain = lead - (scores[best] - scores[other])
        return replace(
            found,
            values=tuple(
                value + gain * (name == f"slot{best}")
                for name, value in zip(ids, found.values, strict=True)
            ),
        )

    policy.decide = raised  # type: ignore[method-assign]
    found = SortingPlanner(policy, CELL).plan(query(state, previous=f"slot{other}"))
    assert found.chosen is not None and found.decision is not None
    assert found.chosen.move.pick == (other if stays else best)
    assert found.decision.chosen == f"slot{found.chosen.move.pick}"


def test_object_being_lifted_stays_chosen() -> None:
    free = planner().plan(query(task(5, 9))).chosen
    assert free is not None
    far = {5, 9} - {free.move.pick}
    lifted = f"slot{far.pop()}"
    progress = PickProgress(phase=LIFT, closing_s=1.3)
    found = planner().plan(query(task(5, 9), previous=lifted, progress=progress))
    assert found.decision is not None and found.decision.chosen == lifted


@pytest.mark.parametrize(("held", "offered"), [(None, ("slot5", "slot9")), (5, ("red",))])
def test_lift_at_a_station_that_is_not_offered_is_refused(
    held: int | None, offered: tuple[str, ...]
) -> None:
    progress = PickProgress(phase=LIFT, closing_s=1.3)
    asked = query(task(5, 9), held=held, previous="slot7", progress=progress)
    with pytest.raises(InvalidInput, match="an offered motion in the phase lift") as refused:
        planner().plan(asked)
    assert (refused.value.field, refused.value.value) == ("previous", "slot7")
    assert set(refused.value.choices) == set(offered)


def test_previous_station_that_is_not_offered_counts_as_none() -> None:
    fresh, stale = (planner().plan(query(task(5, 9), previous=one)) for one in (None, "slot7"))
    assert stale.chosen is not None and fresh.chosen is not None
    assert stale.chosen.move == fresh.chosen.move


def test_solved_task_has_neither_options_nor_segment() -> None:
    found = planner().plan(query(empty_state(SHAPE)))
    assert (found.chosen, found.segment, found.symbol) == (None, None, None)
    assert reason(found, "value") == "Every tower matches the goal."


def test_object_out_of_reach_is_no_option() -> None:
    far = {"id": "slot9", "kind": "clutter", "label": "Far", "position": (0.9, 1.4, 0.05)}
    stations = tuple(
        Station.model_validate(far) if one.id == "slot9" else one for one in CELL.stations
    )
    cell = CELL.model_copy(update={"stations": stations})
    found = planner(cell).plan(query(task(5, 9)))
    assert [one.move.pick for one in found.options] == [5]
    with pytest.raises(InvalidInput, match="robot reaches") as caught:
        planner(cell).plan(query(task(9)))
    assert (caught.value.field, caught.value.value) == ("objects", ["slot9"])


def test_reason_states_the_value_of_the_choice_and_of_the_next_one() -> None:
    found = planner().plan(query(task(5, 9)))
    values = sorted(score_of(one, "value") for one in found.options)
    text = reason(found, "value")
    assert f"{values[1]:.2f}; the next has {values[0]:.2f}" in text
    assert "Of 2 moves" in text


@pytest.mark.parametrize("lifts", [False, True])
@pytest.mark.parametrize("objective", ["value", "success", "time"])
def test_reason_of_a_move_that_is_kept_states_its_score_and_the_best(
    objective: Objective, lifts: bool
) -> None:
    one, kept = planner(), 0
    progress = PickProgress(phase=LIFT, closing_s=0.0) if lifts else NOT_BEGUN
    for number in (5, 9):
        previous = CELL.stations[number].id
        asked = replace(
            query(task(5, 9)), previous=previous, progress=progress, objective=objective
        )
        found = one.plan(asked)
        scores = [score_of(option, objective) for option in found.options]
        own, other = scores[found.index], scores[1 - found.index]
        text = reason(found, objective, lifts=lifts)
        assert all(f"{abs(score):.2f}" in text for score in scores)
        assert ("it has" in text) == (own >= other)
        assert ("is kept" in text) == (own < other)
        kept += own < other
    assert kept or (objective, lifts) != ("value", True)  # the other scores are all equal here
