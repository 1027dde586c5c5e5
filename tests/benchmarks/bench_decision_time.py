"""Time of one decision, from joint positions to the chosen candidate.

    python -m app bench decision-time [--json]

``candidates-3`` is the live cell's case, ``candidates-1000`` the most a request may hold. What
is timed is ``TaskPolicy.decide`` with the shipped checkpoint, as the service calls it: inverse
kinematics, features, both networks. Clock time, of one thread: the median over all calls, with
the least and the 99th percentile beside it.
"""

import itertools
import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch

from app.policies import pretrained
from app.policies.task_choice import TaskChooser
from app.sim.cells import load_cell
from app.sim.pick import PickBatch, PickSettings
from app.sim.ports import Candidate, Person, TaskPolicy, Vec
from tests.benchmarks.measure import Row, arguments, report

BENCH = "decision-time"
STATES = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """What a decision is asked for."""

    q: Vec
    """Robot joint positions [rad], shape (6,)."""
    qd: Vec
    """Robot joint speeds [rad/s], shape (6,)."""
    person: Person
    """The person."""


def states(seed: int) -> list[State]:
    """Return states met while the robot moves at random for two seconds."""
    batch = PickBatch(load_cell(), STATES, seed, PickSettings())
    batch.reset()
    rng = np.random.default_rng(seed)
    for _ in range(40):
        batch.step(rng.uniform(-1.0, 1.0, (STATES, 5)).astype(np.float32), features=False)
    found = batch.state
    return [
        State(
            q=found.q[k].copy(),
            qd=found.qd[k].copy(),
            person=Person(q=found.people.q[k, 0].copy(), qd=found.people.qd[k, 0].copy()),
        )
        for k in range(STATES)
    ]


def candidates(n: int, seed: int) -> list[Candidate]:
    """Return ``n`` candidates, drawn evenly from the box that spans the cell's stations."""
    corners = load_cell().positions()
    rng = np.random.default_rng(seed)
    places = rng.uniform(corners.min(axis=0), corners.max(axis=0), (n, 3))
    return [Candidate(id=f"c{k}", position=place) for k, place in enumerate(places)]


def calls_ms(policy: TaskPolicy, n: int, seed: int, seconds: float) -> Iterator[float]:
    """Yield the time of each decision among ``n`` candidates for ``seconds`` [ms]."""
    offered, turn = candidates(n, seed), itertools.cycle(states(seed))
    ends = time.perf_counter() + seconds
    while (begin := time.perf_counter()) < ends:
        state = next(turn)
        policy.decide(state.q, state.qd, [state.person], offered)
        yield 1e3 * (time.perf_counter() - begin)


def measured(policy: TaskPolicy, n: int, seed: int, seconds: float) -> Row:
    """Return the row of ``n`` candidates."""
    list(calls_ms(policy, n, seed, 0.2))
    times = np.fromiter(calls_ms(policy, n, seed, seconds), dtype=np.float64)
    return {
        "name": f"candidates-{n}",
        "threads": 1,
        "batch": n,
        "value": float(np.median(times)),
        "low": float(times.min()),
        "high": float(np.percentile(times, 99)),
        "unit": "ms",
    }


def main() -> None:
    """Measure and print."""
    options = arguments(BENCH)
    torch.set_num_threads(1)
    policy = TaskChooser(pretrained.load("pick"), load_cell())
    seconds = options.rounds * options.seconds
    rows = [measured(policy, n, options.seed, seconds) for n in (3, 1000)]
    report(BENCH, rows, options)


if __name__ == "__main__":
    main()
