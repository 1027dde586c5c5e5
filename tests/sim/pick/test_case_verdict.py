"""A case study is judged by its whole run: first choice, target switches, end."""

from collections.abc import Sequence

import pytest

from app.live import commands
from app.live.pick.world import LivePickWorld
from app.sim.cells.cell import load_cell
from app.sim.pick.case_verdict import CaseRun, End, is_as_expected, judge
from app.sim.pick.cases import find_case
from tests.support.straight_policy import StraightPolicy


def run_of(goals: Sequence[str], end: End | None = "reached") -> CaseRun:
    """Return a run that chose these goals in turn, a second each."""
    run = CaseRun()
    for t, goal in enumerate(goals):
        run = run.choose(float(t), goal)
    return run if end is None else run.finish(end, float(len(goals)))


@pytest.mark.parametrize(
    ("case", "goals", "end", "agrees"),
    [
        ("case-1", ["cube4"], "reached", True),
        ("case-1", ["cube0"], "reached", False),
        ("case-1", ["cube0", "cube4"], "reached", False),
        ("case-1", ["cube4", "cube0", "cube4"], "reached", False),
        ("case-1", ["cube4"], "contact", False),
        ("case-1", ["cube4"], "timeout", False),
        ("case-1", ["cube4"], None, None),
        ("case-2", ["cube0"], "reached", True),
        ("case-2", ["cube2", "cube0"], "reached", True),
        ("case-2", ["cube2"], "reached", False),
        ("case-3", ["cube1", "cube3"], "reached", True),
        ("case-3", ["cube3", "cube1", "cube3"], "reached", True),
        ("case-3", ["cube3"], "reached", False),
        ("case-4", ["cube4", "cube1"], "reached", True),
        ("case-4", ["cube1"], "reached", False),
        ("case-4", ["cube4", "cube1", "cube4", "cube1"], "reached", False),
        ("case-4", ["cube4", "cube1", "cube4"], "reached", False),
        ("case-4", ["cube4", "cube1"], "contact", False),
        ("case-4", [], "timeout", False),
    ],
)
def test_whole_run_is_judged_and_not_its_end_alone(
    case: str, goals: list[str], end: End | None, agrees: bool | None
) -> None:
    assert is_as_expected(find_case(case), run_of(goals, end)) is agrees


def test_same_choice_again_is_no_switch_and_nothing_counts_after_the_end() -> None:
    run = run_of(["cube4", "cube4", "cube1"])
    assert [one.goal for one in run.choices] == ["cube4", "cube1"]
    assert run.choose(9.0, "cube4") is run
    assert run.finish("contact", 9.0) is run


def test_verdict_tells_order_and_times_of_what_was_chosen() -> None:
    verdict = judge(find_case("case-4"), run_of(["cube4", "cube1"]), str)
    assert verdict.expected == (
        "The robot selects cube4 first, switches once and ends at cube1."
    )
    assert verdict.observed == (
        "The robot selected cube4 first, switched to cube1 at 1.0 s and picked cube1 at 2.0 s."
    )
    assert verdict.as_expected is True


def test_live_case_is_judged_when_it_is_done_and_again_under_another_policy() -> None:
    cell = load_cell()
    world = LivePickWorld(cell, StraightPolicy(cell), seed=2)
    assert world.snapshot().verdict is None
    world.apply(commands.StartCase(id="case-4"))
    now = world.snapshot()
    assert now.verdict is not None
    assert now.verdict.as_expected is None
    for _ in range(900):
        world.step()
        now = world.snapshot()
        if now.status == "case done":
            break
    assert now.status == "case done"
    assert now.verdict is not None
    chosen = [one.goal for one in now.verdict.choices]
    assert chosen[0] in find_case("case-4").goals
    assert len(chosen) == 1 + now.counters.switches
    reached = now.counters.reached == 1 and now.contact is None
    assert now.verdict.as_expected is (reached and chosen == ["cube4", "cube1"])
    assert ("not as expected" in now.message) is (reached and not now.verdict.as_expected)
    world.apply(commands.SetPolicy(checkpoint="straight").with_loaded(StraightPolicy(cell)))
    again = world.snapshot()
    assert again.t_s == 0.0
    assert again.verdict is not None
    assert again.verdict.as_expected is None


def test_values_carry_the_time_at_which_they_were_decided() -> None:
    cell = load_cell()
    world = LivePickWorld(cell, StraightPolicy(cell), seed=2)
    for _ in range(400):
        world.step()
        now = world.snapshot()
        assert now.decided_s is not None
        if now.status in ("moving", "picking"):
            assert now.decided_s == now.t_s
        if now.status == "picking":
            break
    assert now.status == "picking"
