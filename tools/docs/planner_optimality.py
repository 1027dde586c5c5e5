"""Measure the exact sorting planner: optimality gap of its expected attempts, and its time.

    python -m tools.docs.planner_optimality [--tasks 400] [--seed 21]

Writes ``docs/results/planner-optimality.json``. Random tasks (up to five clutter slots, one to
three colours, one or two sizes, arbitrary goals, failure probabilities of 0 to 0.4) are solved
by exhaustive search: minimum number of moves, all first moves of such plans, and the minimum of
the expected attempts over these plans and, up to four slots, over all plans. The planner is
executed one move at a time with replanning after each move.
"""

import argparse
import time
from collections.abc import Sequence

import numpy as np

from app.sim.sorting.batch import apply
from app.sim.sorting.kernels.planner import new_work
from app.sim.sorting.kernels.planner_batch import TaskBatch, plan_tasks
from app.sim.sorting.planner import solve
from app.sim.sorting.state import Move, SortingShape, SortingState
from tests.sim.sorting.sorting_search import (
    attempts_of,
    fewest_attempts,
    first_moves,
    moves_to_go,
    random_task,
)
from tools.docs.results import RESULTS, Json, write_result

RESULT = RESULTS / "planner-optimality.json"
SAME = 1e-9
"""Tolerance for equal attempts (relative)."""
ALL_PLANS_CELLS = 4
"""Largest number of slots for the search over all plans."""
SIZES = ((10, 2), (20, 3), (40, 5))
"""Slots and colours of the timed tasks."""


def replanned(state: SortingState, shape: SortingShape) -> list[Move]:
    """Return the moves of the planner with replanning after each move, without failures."""
    moves = []
    while (best := solve(state, shape).best) is not None:
        moves.append(shape.move_of(best))
        state = apply(state, shape, moves[-1])
    return moves


def small_task(rng: np.random.Generator) -> tuple[SortingState, SortingShape]:
    """Return a random task small enough for exhaustive search."""
    shape = SortingShape(
        n_slots=int(rng.integers(2, 6)),
        n_colours=int(rng.integers(1, 4)),
        n_sizes=int(rng.integers(1, 3)),
    )
    n_objects = int(rng.integers(1, shape.n_slots + 1))
    return random_task(shape, rng, n_objects, float(rng.choice([0.0, 0.5, 0.9]))), shape


def excess_of(excess: Sequence[float]) -> Json:
    """Return statistics of the excess over the minimum of the attempts."""
    found = np.array(excess)
    return {
        "tasks": len(found),
        "optimal": int((found < SAME).sum()),
        "optimal_share": float((found < SAME).mean()),
        "mean_excess": float(found.mean()),
        "worst_excess": float(found.max()),
    }


def optimality_gap(n_tasks: int, seed: int) -> Json:
    """Return the optimality gap of the planner on random unsolved tasks."""
    rng = np.random.default_rng(seed)
    wrong = 0
    stated: list[float] = []
    done: list[float] = []
    free: list[float] = []
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
        if shape.n_slots <= ALL_PLANS_CELLS:
            of_all = fewest_attempts(state, shape, to_go, fewest_moves=False)
            free.append(followed / of_all - 1.0)
    return {
        "fewest_moves_or_first_moves_wrong": wrong,
        "against_plans_of_the_fewest_moves": excess_of(done),
        "stated_by_one_plan": excess_of(stated),
        "against_all_plans": excess_of(free),
    }


def times(n_slots: int, n_colours: int, on_towers: float, seed: int) -> Json:
    """Return the CPU time of plans of one size [ms]."""
    shape, rng = SortingShape(n_slots=n_slots, n_colours=n_colours), np.random.default_rng(seed)
    n = 200 if n_slots < 40 else 10
    states = [random_task(shape, rng, n_slots, on_towers) for _ in range(n)]
    goals = [(state.goal != 0).sum(axis=1) for state in states]
    clutter, towers, heights, asked, goal_heights, fail = (
        np.stack(part)
        for part in zip(
            *[
                (s.clutter, s.towers, s.heights, s.goal, goal, s.fail)
                for s, goal in zip(states, goals, strict=True)
            ],
            strict=True,
        )
    )
    work = new_work(n_slots, n_colours, shape.n_sizes)
    best, fewest = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
    batch = TaskBatch(clutter, towers, heights, asked, goal_heights, fail)
    plan_tasks(batch, work, best, fewest)
    began = time.process_time()
    plan_tasks(batch, work, best, fewest)
    batched = time.process_time() - began
    single = []
    for state in states:
        began = time.process_time()
        solve(state, shape)
        single.append(time.process_time() - began)
    arrays = (*work.paths, *work.now, *work.trial, work.at, work.first, work.actions)
    return {
        "n_slots": n_slots,
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
        "optimality_gap": optimality_gap(options.tasks, options.seed),
        "cpu_time": [
            times(*size, on_towers, options.seed) for size in SIZES for on_towers in (0.0, 0.5)
        ],
    }
    write_result(RESULT, results)


if __name__ == "__main__":
    main()
