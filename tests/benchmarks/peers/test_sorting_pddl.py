"""PDDL planners are asked the sorting task, and their plans are replayed by its rules."""

import numpy as np
import pytest

from app.sim.sorting.planner import solve
from app.sim.sorting.state import SortingShape, SortingState
from tests.benchmarks.bench_sorting import task
from tests.benchmarks.peers.sorting_pddl import installed, plan, problem, replayed

SHAPE = SortingShape(n_slots=4, n_colours=2, n_sizes=2)


def scene() -> SortingState:
    """A small red block stands where the large one in the clutter belongs."""
    state = task(SHAPE, np.random.default_rng(1), disturbed=False)
    state.clutter[:], state.goal[:] = [2, 0, 3, 0], 0
    state.towers[0, 0], state.goal[0, :2] = 1, [2, 1]
    return state


def test_problem_counts_duplicates_and_names_what_towers_show() -> None:
    text = problem(scene(), SHAPE)
    for fact in ("(spare c2 n1)", "(spare c1 n0)", "(height t0 n1)", "(shows t0 n0 c1)"):
        assert fact in text.split("(:goal")[0]
    assert "(:goal (and (free-hand) (height t0 n2) (shows t0 n0 c2) (shows t0 n1 c1)" in text


def steps(text: str) -> list[list[str]]:
    return [line.split() for line in text.strip().splitlines()]


GOOD = """
    take-from-tower c1 t0 n0 n1
    put-on-tower c1 t1 n0 n1
    take-from-clutter c2 n0 n1
    put-on-tower c2 t0 n0 n1
    take-from-tower c1 t1 n0 n1
    put-on-tower c1 t0 n1 n2
"""


def test_a_plan_that_reaches_the_goal_counts_its_moves() -> None:
    assert replayed(steps(GOOD), scene()) == 3


@pytest.mark.parametrize(
    ("spoilt", "reason"),
    [
        (GOOD.replace("take-from-clutter c2", "take-from-clutter c1"), "no c1"),
        (GOOD.replace("take-from-tower c1 t1", "take-from-tower c2 t1"), "no c2"),
        (GOOD[: GOOD.rindex("take")], "does not reach"),
        (GOOD.replace("    put-on-tower c1 t1 n0 n1\n", ""), "in the hand"),
    ],
)
def test_a_plan_that_breaks_a_rule_is_refused(spoilt: str, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        replayed(steps(spoilt), scene())


@pytest.mark.parametrize("planner", ["pyperplan", "fast-downward", "fast-downward-opt"])
@pytest.mark.parametrize("disturbed", [False, True])
def test_planners_need_as_many_moves_as_the_exact_planner_or_more(
    planner: str, disturbed: bool
) -> None:
    if not installed(planner):
        pytest.skip(f"{planner} is not installed")
    state = task(SHAPE, np.random.default_rng(3), disturbed)
    found, fewest = plan(planner, state, SHAPE, cap_s=60.0), solve(state, SHAPE).moves
    assert found.moves is not None
    assert found.moves == fewest if planner.endswith("opt") else found.moves >= fewest
    assert found.cpu_s > 0.0


def test_a_planner_whose_time_is_over_says_so() -> None:
    if not installed("pyperplan"):
        pytest.skip("pyperplan is not installed")
    large = SortingShape(n_slots=40, n_colours=3)
    found = plan("pyperplan", task(large, np.random.default_rng(3), False), large, cap_s=1.0)
    assert found.moves is None and "no plan in 1 s" in found.note
