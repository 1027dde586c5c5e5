import dataclasses

import numpy as np
import pytest

from app.sim.sorting.batch import SortingBatch, SortingSettings, apply
from app.sim.sorting.decision import decide, outside_goal
from app.sim.sorting.decision_types import SortingDecision
from app.sim.sorting.planner import solve
from app.sim.sorting.state import Move, SortingShape, SortingState, empty_state
from tests.support.sorting_values import FixedValues

SHAPE = SortingShape(n_slots=5, n_colours=2)
RED, BLUE = 5, 6
SMALL, LARGE = SHAPE.code(0, 0), SHAPE.code(0, 2)


def start() -> SortingState:
    """Two red objects that shall stand on red, the large one lies in the risky cell 0."""
    state = empty_state(SHAPE)
    state.clutter[:2] = LARGE, SMALL
    state.goal[0, :2] = LARGE, SMALL
    state.fail[0] = 0.5
    return state


def drawn(n: int, seed: int) -> list[SortingState]:
    settings = SortingSettings(disturbed_share=0.5, random_map_share=1.0)
    batch = SortingBatch(SHAPE, np.zeros(SHAPE.n_slots), n, seed, settings)
    batch.reset()
    return [batch.state_of(e) for e in range(n)]


def test_planner_decides_where_there_is_no_policy() -> None:
    decision = decide(None, start(), SHAPE)
    assert (decision.by, decision.why, decision.monitor) == ("planner", "no-policy", None)
    assert decision.move == Move(0, RED)
    assert (decision.fewest_moves, decision.expected_attempts) == (2, pytest.approx(3.0))


def test_policy_decides_by_its_greatest_value_among_the_valid_moves() -> None:
    policy = FixedValues(SHAPE, [Move(3, RED), Move(1, BLUE), Move(0, RED)])
    decision = decide(policy, start(), SHAPE)
    assert (decision.by, decision.why) == ("policy", "policy")
    assert decision.move == Move(1, BLUE)
    assert [one.value for one in decision.ranked] == [9.0, 8.0, 0.0, 0.0]
    assert decision.checkpoint == policy.checkpoint


def test_every_valid_move_is_ranked_once_with_those_of_fewest_moves_marked() -> None:
    decision = decide(None, start(), SHAPE)
    moves = [one.move for one in decision.ranked]
    assert sorted(moves) == [Move(k, tower) for k in (0, 1) for tower in (RED, BLUE)]
    assert [one.fewest for one in decision.ranked] == [True, False, False, False]


def test_planner_values_are_minus_the_attempts_if_that_move_comes_first() -> None:
    decision = decide(None, start(), SHAPE)
    values = {one.move: one.value for one in decision.ranked}
    assert values[Move(0, RED)] == pytest.approx(-3.0)
    assert values[Move(1, RED)] == pytest.approx(-1.0 - 1.0 - 2.0 - 1.0)


def test_planner_plays_its_plans_to_the_end_in_the_fewest_moves() -> None:
    for state in drawn(40, seed=3):
        fewest, now = decide(None, state, SHAPE).fewest_moves, state
        for _ in range(fewest):
            move = decide(None, now, SHAPE).move
            assert move is not None
            now = apply(now, SHAPE, move)
        assert now.solved


def test_solved_task_asks_for_nothing() -> None:
    state = start()
    state.clutter[:2], state.towers[0, :2] = 0, (LARGE, SMALL)
    decision = decide(FixedValues(SHAPE, []), state, SHAPE)
    assert decision.solved
    assert (decision.move, decision.ranked, decision.monitor) == (None, (), None)
    assert (decision.why, decision.fewest_moves, decision.expected_attempts) == ("solved", 0, 0)


def test_planner_decides_when_it_is_asked_for() -> None:
    decision = decide(FixedValues(SHAPE, []), start(), SHAPE, ask_planner=True)
    assert (decision.by, decision.why, decision.move) == ("planner", "asked", Move(0, RED))


def test_planner_decides_for_a_policy_of_another_shape() -> None:
    policy = FixedValues(SortingShape(n_slots=6, n_colours=2), [])
    decision = decide(policy, start(), SHAPE)
    assert (decision.by, decision.why, decision.monitor) == ("planner", "other-shape", None)


@pytest.mark.parametrize(
    ("goal", "level"), [((SMALL, LARGE), 1), ((SHAPE.code(1, 0), SMALL), 0)]
)
def test_planner_decides_for_goals_that_policies_were_not_trained_for(
    goal: tuple[int, int], level: int
) -> None:
    state = start()
    state.clutter[2] = SHAPE.code(1, 0)
    state.goal[0, :2] = goal
    decision = decide(FixedValues(SHAPE, []), state, SHAPE)
    assert (decision.by, decision.why) == ("planner", "untrained-goal")
    assert [(one.tower, one.level) for one in decision.outside] == [(0, level)]


def test_goals_drawn_for_training_are_never_outside() -> None:
    assert all(outside_goal(state.goal, SHAPE) == () for state in drawn(200, seed=5))


def played(policy: FixedValues, state: SortingState, n: int) -> list[SortingDecision]:
    """Decisions while every pick succeeds."""
    found: list[SortingDecision] = []
    for _ in range(n):
        found.append(decide(policy, state, SHAPE, found[-1].monitor if found else None))
        move = found[-1].move
        if move is None:
            break
        state = apply(state, SHAPE, move)
    return found


def test_planner_takes_over_from_a_policy_in_circles_and_reaches_the_goal() -> None:
    policy = FixedValues(SHAPE, [Move(1, BLUE), Move(BLUE, 1)])
    decisions = played(policy, start(), 8)
    whys = [one.why for one in decisions]
    assert whys == ["policy", "policy", "repeated", "repeated", "solved"]
    assert [one.by for one in decisions[:4]] == ["policy", "policy", "planner", "planner"]


def test_failed_picks_alone_do_not_hand_over_before_the_patience_ends() -> None:
    policy = FixedValues(SHAPE, [Move(0, RED)])
    monitor, whys = None, []
    for _ in range(6):
        decision = decide(policy, start(), SHAPE, monitor)
        monitor, whys = decision.monitor, [*whys, decision.why]
    assert whys == ["policy"] * 5 + ["attempts-exceeded"]


def test_policy_is_trusted_again_after_a_person_interferes() -> None:
    policy = FixedValues(SHAPE, [Move(1, BLUE), Move(BLUE, 1)])
    handed = played(policy, start(), 3)[-1]
    changed = dataclasses.replace(start(), goal=np.roll(start().goal, 0, axis=0).copy())
    changed.goal[0, 1] = 0
    assert decide(policy, changed, SHAPE, handed.monitor).why == "policy"


def test_large_tasks_are_ranked_without_values_that_would_take_too_long() -> None:
    shape = SortingShape(n_slots=40, n_colours=5)
    state = empty_state(shape)
    codes = [shape.code(c, 2 - level // 3) for c in range(5) for level in range(8)]
    state.clutter[:] = np.random.default_rng(2).permutation(codes)
    state.goal[:, :8] = np.array(codes).reshape(5, 8)
    decision = decide(None, state, shape)
    assert decision.action == solve(state, shape).best
    assert {one.value for one in decision.ranked} == {None}
    marks = [one.fewest for one in decision.ranked]
    assert marks == sorted(marks, reverse=True)
