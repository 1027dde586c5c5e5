"""Measure the exact planner: how near its expected attempts are to the fewest, and its time.

    python docs/planner_nearness.py [--tasks 400] [--seed 21]

writes ``docs/results/planner_nearness.json``. Random tasks of at most five cells, one to three
colours, one or two sizes, objects on towers or not, goals of any colours, failure probabilities
drawn from 0 to 0.4, are searched by brute force: the fewest moves, every move that begins such
a plan, the fewest expected attempts of such plans, and those of all plans (of at most four
cells). The planner is followed one move at a time, planning anew after each: what counts is
what it does.
"""

import argparse
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from app.machine import describe  # noqa: E402 - the line above lets it be found
from app.sim.sorting.batch import apply  # noqa: E402
from app.sim.sorting.kernels.planner import new_work, plan_rows  # noqa: E402
from app.sim.sorting.planner import attempts_of, solve  # noqa: E402
from app.sim.sorting.state import Move, SortingShape, SortingState  # noqa: E402
from tests.sim.sorting_search import (  # noqa: E402
    fewest_attempts,
    first_moves,
    moves_to_go,
    random_task,
)

RESULTS = ROOT / "docs/results/planner_nearness.json"
SAME = 1e-9
"""Relative difference below which attempts are the same."""
ALL_PLANS_CELLS = 4
"""Most cells of tasks of which all plans are searched."""
SIZES = ((10, 2), (20, 3), (40, 5))
"""Cells and colours of the tasks that are timed."""
Json = dict[str, Any]


def replanned(state: SortingState, shape: SortingShape) -> list[Move]:
    """Return the moves of the planner when it plans anew after each, no pick failing."""
    moves = []
    while (best := solve(state, shape).best) is not None:
        moves.append(shape.move_of(best))
        state = apply(state, shape, moves[-1])
    return moves


def small_task(rng: np.random.Generator) -> tuple[SortingState, SortingShape]:
    """Return a random task that brute force can search."""
    shape = SortingShape(
        n_cells=int(rng.integers(2, 6)),
        n_colours=int(rng.integers(1, 4)),
        n_sizes=int(rng.integers(1, 3)),
    )
    n_objects = int(rng.integers(1, shape.n_cells + 1))
    return random_task(shape, rng, n_objects, float(rng.choice([0.0, 0.5, 0.9]))), shape


def excess_of(excess: Sequence[float]) -> Json:
    """Return how far attempts are above the fewest."""
    found = np.array(excess)
    return {
        "tasks": len(found),
        "optimal": int((found < SAME).sum()),
        "optimal_share": float((found < SAME).mean()),
        "mean_excess": float(found.mean()),
        "worst_excess": float(found.max()),
    }


def nearness(n_tasks: int, seed: int) -> Json:
    """Return how near the planner is on random tasks that are not solved yet."""
    rng = np.random.default_rng(seed)
    wrong, stated, done, free = 0, [], [], []
    while len(done) < n_tasks:
        state, shape = small_task(rng)
        plan = solve(state, shape)
        wrong += (plan.moves, plan.first) != first_moves(state, shape)
        if plan.moves == 0:
            continue
        to_go = moves_to_go(state, shape)[1]
        least = fewest_attempts(state, shape, to_go)
        followed = attempts_of(replanned(state, shape), state.fail)
        stated.append(plan.attempts / least - 1.0)
        done.append(followed / least - 1.0)
        if shape.n_cells <= ALL_PLANS_CELLS:
            of_all = fewest_attempts(state, shape, to_go, fewest_moves=False)
            free.append(followed / of_all - 1.0)
    return {
        "fewest_moves_or_first_moves_wrong": wrong,
        "against_plans_of_the_fewest_moves": excess_of(done),
        "stated_by_one_plan": excess_of(stated),
        "against_all_plans": excess_of(free),
    }


def times(n_cells: int, n_colours: int, on_towers: float, seed: int) -> Json:
    """Return the CPU time of plans of one size [ms]."""
    shape, rng = SortingShape(n_cells=n_cells, n_colours=n_colours), np.random.default_rng(seed)
    n = 200 if n_cells < 40 else 10
    states = [random_task(shape, rng, n_cells, on_towers) for _ in range(n)]
    goals = [(state.goal != 0).sum(axis=1) for state in states]
    rows = [
        np.stack(part)
        for part in zip(
            *[
                (s.clutter, s.towers, s.heights, s.goal, goal, s.fail)
                for s, goal in zip(states, goals, strict=True)
            ],
            strict=True,
        )
    ]
    work = new_work(n_cells, n_colours, shape.n_sizes)
    best, fewest = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
    plan_rows(*rows, work, best, fewest)
    began = time.process_time()
    plan_rows(*rows, work, best, fewest)
    batched = time.process_time() - began
    single = []
    for state in states:
        began = time.process_time()
        solve(state, shape)
        single.append(time.process_time() - began)
    arrays = (*work.progress, *work.now, *work.trial, work.at, work.first, work.actions)
    return {
        "n_cells": n_cells,
        "n_colours": n_colours,
        "share_on_towers": on_towers,
        "solve_ms_mean": 1e3 * float(np.mean(single)),
        "solve_ms_p95": 1e3 * float(np.percentile(single, 95)),
        "next_move_in_a_batch_ms": 1e3 * batched / n,
        "work_space_bytes": sum(array.nbytes for array in arrays),
    }


def main() -> None:
    """Measure and write the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tasks", type=int, default=400)
    parser.add_argument("--seed", type=int, default=21)
    options = parser.parse_args()
    results = {
        "seed": options.seed,
        "nearness": nearness(options.tasks, options.seed),
        "cpu_time": [
            times(*size, on_towers, options.seed) for size in SIZES for on_towers in (0.0, 0.5)
        ],
        "machine": describe(),
    }
    RESULTS.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
