"""Protocol ``pick-case-variants``: variants of the case studies that no policy selected.

The variants are all layouts of the cell that agree with the description of a case
(``sim/pick/case_variants.py``). Each runs from jittered starts and is judged as in
``pick-cases``. Rates are means over variants with 95 % intervals of Student's t, because runs
of one variant depend on each other. The same starts are run with the nearest candidate and with
each goal alone: where the expected goal alone cannot be picked, no choice is as expected.
"""

from collections.abc import Sequence

import numpy as np

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.evaluation.pick.cases import ENDS, SETTINGS, CaseEpisodes, run_together
from app.policies.evaluation.pick.episodes import PickBench
from app.policies.evaluation.rows import EvaluationRequest, Json
from app.policies.evaluation.statistics import clustered
from app.sim.pick.batch import OUTCOMES
from app.sim.pick.case_variants import DEFINITION, other_goal_free_at_end, variants_of
from app.sim.pick.cases import cases_of

DEFAULT_STARTS = 20
"""Starts of each variant."""
TOGETHER = 40
"""Variants whose runs are stepped together."""
WITH_PART = "case-3"
"""Case of which a part of the variants is counted by itself, too."""
Shares = dict[str, float | None]
"""Shares of runs by name; None without runs."""


def run_case_variants(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate all variants of the four case studies from jittered starts."""
    bench = PickBench(checkpoint, request, default=DEFAULT_STARTS)
    cases, each = cases_of(bench.cell), []
    rows = request.rows(len(cases) + 1)
    for number, case in enumerate(cases):
        variants = variants_of(bench.cell, case)
        rngs = [np.random.default_rng([request.seed, number, k]) for k in range(len(variants))]
        jobs, shares = list(zip(variants, rngs, strict=True)), []
        for first in range(0, len(jobs), TOGETHER):
            found, _ = run_together(bench, jobs[first : first + TOGETHER])
            shares += [shares_of(one) for one in found]
        rows.append(row_of(case.id, bench.n, shares))
        pairs = list(zip(variants, shares, strict=True))
        each += [{"name": one.id, "expected": one.expected, **share} for one, share in pairs]
        if case.id == WITH_PART:
            name = f"{case.id}, other goal not free at the end"
            part = [one for case, one in pairs if not other_goal_free_at_end(bench.cell, case)]
            rows.append(row_of(name, bench.n, part))
    settings = {**SETTINGS, "definition": dict(DEFINITION)}
    return {"settings": settings, "results": rows, "variants": each}


def row_of(name: str, n: int, shares: Sequence[Shares]) -> Json:
    """Return a row: means over variants of ``n`` starts each, with intervals."""
    means = {
        key: clustered([share for one in shares if (share := one[key]) is not None])
        for key in shares[0]
    }
    return {"name": name, "n": n, "variants": len(shares), "runs": n * len(shares), **means}


def shares_of(found: CaseEpisodes) -> Shares:
    """Return the shares of the runs of one variant; unfeasible ends count as time-outs."""
    case, run = found.case, found.run
    (other,) = {*case.goals} - {case.expected}
    alone = found.alone[case.expected]
    ends = np.array([ENDS[OUTCOMES[outcome]] for outcome in run.outcome])
    flags = {
        **{name: ends == ENDS[name] for name in ("success", "collision", "timeout")},
        **found.clauses,
        "nearest": found.nearest.succeeded,
        "nearest_as_expected": found.nearest_clauses["as_expected"],
        "expected_goal_alone": alone,
        "other_goal_alone": found.alone[other],
        "as_expected_where_possible": found.clauses["as_expected"][alone],
    }
    return {key: float(held.mean()) if held.size else None for key, held in flags.items()}
