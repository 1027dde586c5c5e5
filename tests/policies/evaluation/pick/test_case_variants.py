"""Protocol ``pick-case-variants``: rows are means over variants."""

from dataclasses import replace

import numpy as np
import pytest

from app.policies.checkpoints import pretrained
from app.policies.evaluation.pick.case_variants import row_of, shares_of
from app.policies.evaluation.pick.cases import _clauses, run_together
from app.policies.evaluation.pick.episodes import PickBench
from app.policies.evaluation.rows import EvaluationRequest
from app.sim.pick.case_variants import variants_of
from app.sim.pick.cases import find_case
from app.sim.scenario.kernels.episode import TIMEOUT, UNFEASIBLE


def bench_of(n: int) -> PickBench:
    return PickBench(pretrained.load("pick"), EvaluationRequest(episodes=n, seed=5))


def test_rows_are_means_over_variants_and_no_clause_is_below_the_verdict():
    bench, case = bench_of(4), find_case("case-3")
    some = variants_of(bench.cell, case)[::60]
    rngs = [np.random.default_rng(k) for k in range(len(some))]
    found, _ = run_together(bench, list(zip(some, rngs, strict=True)))
    shares = [shares_of(one) for one in found]
    row = row_of("some", 4, shares)
    assert (row["n"], row["variants"], row["runs"]) == (4, len(some), 4 * len(some))
    assert row["as_expected"]["mean"] == pytest.approx(
        np.mean([one["as_expected"] for one in shares])
    )
    for one in shares:
        clauses = ("first", "switches", "end", "success")
        assert one["as_expected"] <= min(one[name] for name in clauses)
        assert one["success"] + one["collision"] + one["timeout"] == pytest.approx(1.0)
        assert (one["as_expected_where_possible"] is None) == (one["expected_goal_alone"] == 0)


def test_cases_run_together_are_the_same_layouts_as_alone():
    """The robot that takes the goal under a resting hand fails, in each place of the batch."""
    order = ("case-2", "case-1", "case-2")
    cases = [(find_case(name), np.random.default_rng(7)) for name in order]
    found, _ = run_together(bench_of(5), cases)
    assert [one.case.id for one in found] == list(order)
    for one in (found[0], found[2]):
        assert not one.alone["cube2"].any() and one.alone["cube0"].all()
    assert found[1].alone["cube0"].all() and found[1].alone["cube4"].all()


def test_unfeasible_ends_count_as_time_outs():
    (found,), choices = run_together(
        bench_of(2), [(find_case("case-1"), np.random.default_rng(7))]
    )
    run = replace(found.run, outcome=np.array([UNFEASIBLE, TIMEOUT]))
    assert shares_of(replace(found, run=run))["timeout"] == 1.0
    late, same = (
        _clauses(found.case, replace(run, outcome=np.full(2, end)), choices, range(2))
        for end in (TIMEOUT, UNFEASIBLE)
    )
    for name, held in late.items():
        np.testing.assert_array_equal(same[name], held)
