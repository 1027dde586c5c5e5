"""Environment steps per processor second: the batched kernels beside one environment on FCL.

    python -m app bench sim-steps [--json]

``pick/numba`` steps without observations, ``pick/numba-features`` as training does, with all of
them, and ``fcl/pick`` is the single environment of ``fcl_pick.py``. All act at random; episodes
that end start anew.
"""

import itertools

import numpy as np

from app.sim.cells import load_cell
from app.sim.pick import PickBatch, PickSettings
from tests.benchmarks.fcl_pick import FclPick
from tests.benchmarks.measure import Subject, arguments, report, rounds_over, row

BENCH = "sim-steps"
BATCH = 128
TICKS = 400
"""Steps of the person's motion that the FCL environment goes through."""


def batched(name: str, seed: int, *, features: bool) -> Subject:
    """Return the batched scenario, one call a step of all environments."""
    batch = PickBatch(load_cell(), BATCH, seed, PickSettings())
    batch.reset()
    rng = np.random.default_rng(seed)
    acts = rng.uniform(-1.0, 1.0, (64, BATCH, 5)).astype(np.float32)
    turn = itertools.cycle(acts)
    return Subject(
        name=name, batch=BATCH, run=lambda: batch.step(next(turn), features=features)
    )


def single(seed: int) -> Subject:
    """Return the FCL environment beside the person of the batch's first environment."""
    cell = load_cell()
    batch = PickBatch(cell, 1, seed, PickSettings(time_limit_s=1e9))
    batch.reset()
    still = np.zeros((1, 5), dtype=np.float32)
    people = np.empty((TICKS, 18))
    for tick in range(TICKS):
        people[tick] = batch.state.people.q[0, 0]
        batch.step(still, auto_reset=False, features=False)
    env = FclPick(cell, people, batch.state.goal[0].copy())
    rng = np.random.default_rng(seed)
    acts = rng.uniform(-1.0, 1.0, (4096, 5))
    turn = itertools.cycle(acts)
    return Subject(name="fcl/pick", batch=1, run=lambda: env.step(next(turn)))


def main() -> None:
    """Measure and print."""
    options = arguments(BENCH)
    subjects = [
        batched("pick/numba", options.seed, features=False),
        batched("pick/numba-features", options.seed, features=True),
        single(options.seed),
    ]
    times = rounds_over(subjects, options.rounds, options.seconds)
    rows = [
        row(subject, [subject.batch / spent for spent in found], "env-steps/cpu-s")
        for subject, found in zip(subjects, times, strict=True)
    ]
    report(BENCH, rows, options)


if __name__ == "__main__":
    main()
