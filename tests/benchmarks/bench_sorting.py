"""Time to decide in the sorting task: policy, exact planner, planners that read PDDL.

    python -m app bench sorting [--json] [--cap 60] [--total 1800] [--instances 3]

Rows are named ``WHO/K-COLOURS[-disturbed]``, one per size of the task. A decision of the policy
or of the exact planner is one next move (and, of the planner, the whole plan); a PDDL planner
plans from scratch. All see the same instances: K - 1 objects of random types, all of them asked
for. *Disturbed*: half of the goal stands when a person puts one more object on a tower, which
is planned again. ``value`` is the median in milliseconds of processor time, of PDDL planners
that of all their processes, start included; ``found`` says how many of the instances were
planned within ``--cap`` processor seconds, ``over`` the mean moves above the fewest. A size
whose instances all timed out is the last one tried; ``--total`` bounds the whole of it.

The policy is the shipped checkpoint of ``sorting-e0`` (K = 10, two colours) or ``sorting-e1``
(K = 20, three), on its own size alone.
"""

import argparse
import itertools
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch

from app.errors import NotFound
from app.policies.checkpoints import pretrained
from app.policies.inference.sorting_policy import SortingPolicy
from app.sim.sorting.batch import observe, valid_moves
from app.sim.sorting.planner import solve
from app.sim.sorting.state import SortingShape, SortingState, empty_state
from tests.benchmarks.measure import Row, report, row_without
from tests.benchmarks.peers.sorting_pddl import PACKAGES, Found, installed, plan

BENCH = "sorting"
SHAPES = tuple(
    SortingShape(n_slots=k, n_colours=2 if k <= 10 else 3) for k in (5, 10, 15, 20, 30, 40)
)
POLICIES = {(10, 2): "sorting-e0", (20, 3): "sorting-e1"}
"""Shipped checkpoints by cells and colours."""
WORST_RISK = 0.4


@dataclass(frozen=True, slots=True, kw_only=True)
class Size:
    """The instances of one row."""

    name: str
    """End of the names of its rows."""
    shape: SortingShape
    """Size of the task."""
    tasks: list[SortingState]
    """Instances."""
    fewest: list[int]
    """Fewest moves of each."""


def task(shape: SortingShape, rng: np.random.Generator, disturbed: bool) -> SortingState:
    """Return an instance: all to be sorted, or half done when a person adds an object."""
    state, k = empty_state(shape), shape.n_slots
    codes = np.sort(rng.integers(1, shape.n_types + 1, k - 1))[::-1]
    rest = []
    for colour in range(shape.n_colours):
        mine = codes[(codes - 1) // shape.n_sizes == colour]
        state.goal[colour, : len(mine)] = mine
        done = len(mine) // 2 if disturbed else 0
        state.towers[colour, :done] = mine[:done]
        rest += mine[done:].tolist()
    if disturbed:
        tower = int(rng.integers(shape.n_colours))
        state.towers[tower, state.heights[tower]] = rng.integers(1, shape.n_types + 1)
    state.clutter[rng.permutation(k)[: len(rest)]] = rest
    state.fail[:] = np.linspace(WORST_RISK, 0.0, k)
    return state


def sizes(seed: int, instances: int) -> Iterator[Size]:
    """Yield the instances of every size, with and without disturbance."""
    for disturbed, shape in itertools.product((False, True), SHAPES):
        rng = np.random.default_rng((seed, shape.n_slots, disturbed))
        tasks = [task(shape, rng, disturbed) for _ in range(instances)]
        name = f"{shape.n_slots}-{shape.n_colours}" + "-disturbed" * disturbed
        fewest = [solve(one, shape).moves for one in tasks]
        yield Size(name=name, shape=shape, tasks=tasks, fewest=fewest)


def row_of(who: str, size: Size, times_ms: Sequence[float], **more: object) -> Row:
    """Make the row of a decider on a size."""
    return {
        "name": f"{who}/{size.name}",
        "threads": 1,
        "batch": 1,
        "value": statistics.median(times_ms),
        "low": min(times_ms),
        "high": max(times_ms),
        "unit": "ms",
        **more,
    }


def quick(
    who: str, size: Size, decide: Callable[[SortingState], object], seconds: float
) -> Row:
    """Time something that takes well under a second, again and again."""
    decide(size.tasks[0])
    times = []
    begin, turn = time.process_time(), itertools.cycle(size.tasks)
    while (started := time.process_time()) - begin < seconds or len(times) < len(size.tasks):
        decide(next(turn))
        times.append(1e3 * (time.process_time() - started))
    return row_of(who, size, times)


def policies(size: Size, seconds: float) -> Row:
    """Time the shipped policy where there is one for this size."""
    alias = POLICIES.get((size.shape.n_slots, size.shape.n_colours))
    name = f"policy/{size.name}"
    if alias is None:
        return row_without(name, "no policy is trained for this size")
    try:
        policy = SortingPolicy(pretrained.load(alias))
    except NotFound:
        return row_without(name, f"no checkpoint {alias} is shipped")

    def decide(state: SortingState) -> int:
        values = policy.values(observe(state)[None])[0]
        return int(np.where(valid_moves(state, size.shape), values, -np.inf).argmax())

    return quick("policy", size, decide, seconds)


def planned(who: str, size: Size, cap_s: float, ends: float) -> Row:
    """Let a PDDL planner plan the instances of a size, until the time is up."""
    found: list[Found] = []
    for state in size.tasks:
        if time.monotonic() > ends:
            break
        found.append(plan(who, state, size.shape, cap_s))
    name = f"{who}/{size.name}"
    good = [
        (one, least)
        for one, least in zip(found, size.fewest, strict=False)
        if one.moves is not None
    ]
    tried = {"found": len(good), "tried": len(found)}
    if not good:
        notes = {one.note for one in found} or {"not tried: the time was up"}
        return row_without(name, "; ".join(sorted(notes))) | tried
    over = statistics.mean(one.moves - least for one, least in good if one.moves is not None)
    times = [1e3 * one.cpu_s for one, _ in good]
    return row_of(who, size, times, **tried, over=round(over, 2))


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog=f"bench {BENCH}")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--seconds", type=float, default=1.0, help="per row of quick deciders")
    parser.add_argument("--instances", type=int, default=3, help="per size")
    parser.add_argument("--cap", type=float, default=60.0, help="processor seconds per plan")
    parser.add_argument("--total", type=float, default=1800.0, help="seconds by the clock")
    parser.add_argument("--seed", type=int, default=11)
    options = parser.parse_args()
    options.rounds = 1
    return options


def main() -> None:
    """Measure and print."""
    options = arguments()
    torch.set_num_threads(1)
    ends, rows = time.monotonic() + options.total, []
    given_up: set[tuple[str, bool]] = set()
    for size in sizes(options.seed, options.instances):
        rows.append(policies(size, options.seconds))

        def exact(state: SortingState, shape: SortingShape = size.shape) -> int:
            return solve(state, shape).moves

        rows.append(quick("exact", size, exact, options.seconds))
        for who in PACKAGES:
            kind = (who, size.name.endswith("disturbed"))
            if not installed(who):
                rows.append(row_without(f"{who}/{size.name}", "not installed"))
            elif kind in given_up:
                rows.append(row_without(f"{who}/{size.name}", "not tried: see the size before"))
            else:
                rows.append(planned(who, size, options.cap, ends))
                if rows[-1]["value"] is None:
                    given_up.add(kind)
    report(BENCH, rows, options, cap_s=options.cap, instances=options.instances)


if __name__ == "__main__":
    main()
