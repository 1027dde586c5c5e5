"""Environment steps per processor second: the batched kernels beside what is usual.

    python -m app bench sim-steps [--json]

pick/numba           18-DoF person, exact distances of all capsule pairs, plain observations
pick/numba-features  the same with every feature, as it is trained
reach/numba          a walking cylinder, the goal box of docs/method.md 2.3, plain observations
reach/numba-features the same with every feature
fcl/pick             one environment on Pinocchio and python-fcl, see ``fcl_pick.py``
mujoco/pick          MuJoCo: kinematics and ``mj_geomDistance`` of the same pairs
mujoco/pick-sensors  MuJoCo: the same distances by sensors, all in one call
mujoco/pick-contacts MuJoCo: kinematics and ``mj_collision``, who touches but not how far
sorting-e0/numba     sorting 10 objects of two colours, random valid moves
sorting-e1/numba     20 objects of three colours
gymnasium/sorting-e0 one plain environment of the same task, see ``plain_sorting.py``

The environments act at random, and episodes that end start again. MuJoCo is posed along an
episode recorded from the kernels and does less than they do, see ``mujoco_pick.py``. The column
*slower* says how many times as many steps ``pick/numba`` makes, the median over the rounds.
"""

import itertools
import statistics
from collections.abc import Iterator

import numpy as np

from app.sim.cells.cell import load_cell
from app.sim.core.arrays import Vec
from app.sim.pick.batch import PickBatch, PickSettings
from app.sim.reach.batch import ReachBatch, ReachSettings
from tests.benchmarks import sorting_steps
from tests.benchmarks.measure import (
    Row,
    Subject,
    arguments,
    report,
    rounds_over,
    row,
    row_without,
)
from tests.benchmarks.peers.fcl_pick import FclPick
from tests.benchmarks.peers.mujoco_pick import INSTALLED, MODES, MujocoPick

BENCH = "sim-steps"
BATCH = 128
TICKS = 400
"""Steps of the person's motion that the FCL environment goes through."""
MOMENTS = 1024
"""Moments of the recorded episodes that MuJoCo goes through."""
MUJOCO = {mode: f"mujoco/pick-{mode}" for mode in MODES} | {"distances": "mujoco/pick"}
UNIT = "env-steps/cpu-s"


def batched(name: str, batch: PickBatch | ReachBatch, n_joints: int, seed: int) -> Subject:
    """Return a batched scenario, one call a step of all environments."""
    batch.reset()
    rng = np.random.default_rng(seed)
    turn = itertools.cycle(rng.uniform(-1.0, 1.0, (64, BATCH, n_joints)).astype(np.float32))
    return Subject(name=name, batch=BATCH, run=lambda: batch.step(next(turn)))


def scenarios(seed: int) -> Iterator[Subject]:
    """Yield both scenarios, with plain observations and with every feature."""
    cell, other = load_cell(), load_cell("shared-workspace")
    for name, seen in (("numba", "state"), ("numba-features", "features")):
        pick = PickBatch(cell, BATCH, seed, PickSettings(observation=seen))
        yield batched(f"pick/{name}", pick, 5, seed)
        reach = ReachBatch(other, BATCH, seed, ReachSettings(observation=seen))
        yield batched(f"reach/{name}", reach, 6, seed)


def sorting(seed: int) -> Iterator[Subject]:
    """Yield the sorting tasks, and a plain environment of one of them."""
    for name in ("sorting-e0", "sorting-e1"):
        yield sorting_steps.batched(f"{name}/numba", name, seed)
    yield sorting_steps.gymnasium_alone("gymnasium/sorting-e0", "sorting-e0", seed)


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


def recorded(seed: int) -> tuple[Vec, Vec]:
    """Return the joints of robot, (MOMENTS, 6), and person, (MOMENTS, 18), acting at random."""
    batch = PickBatch(load_cell(), 1, seed, PickSettings(observation="state"))
    batch.reset()
    rng = np.random.default_rng(seed)
    q, human_q = np.empty((MOMENTS, 6)), np.empty((MOMENTS, 18))
    for tick in range(MOMENTS):
        q[tick], human_q[tick] = batch.state.q[0], batch.state.people.q[0, 0]
        batch.step(rng.uniform(-1.0, 1.0, (1, 5)).astype(np.float32))
    return q, human_q


def mujoco_peers(seed: int) -> Iterator[Subject]:
    """Yield MuJoCo's ways to measure, where it is installed."""
    if INSTALLED:
        q, human_q = recorded(seed)
        for mode, name in MUJOCO.items():
            peer = MujocoPick(load_cell(), q, human_q, mode)
            yield Subject(name=name, batch=1, run=peer.step)


def measured(subjects: list[Subject], rounds: int, seconds: float) -> list[Row]:
    """Return a row for every subject, peers with how many times slower they are."""
    times = rounds_over(subjects, rounds, seconds)
    rows = [
        row(subject, [subject.batch / spent for spent in found], UNIT)
        for subject, found in zip(subjects, times, strict=True)
    ]
    for one, subject, found in zip(rows, subjects, times, strict=True):
        if "/pick" in subject.name:
            # Round by round: what slows the machine for a while slows both.
            pairs = zip(found, times[0], strict=True)
            one["slower"] = statistics.median(
                (peer / subject.batch) / (own / subjects[0].batch) for peer, own in pairs
            )
    return rows


def main() -> None:
    """Measure and print."""
    options = arguments(BENCH)
    subjects = [
        *scenarios(options.seed),
        single(options.seed),
        *mujoco_peers(options.seed),
        *sorting(options.seed),
    ]
    rows = measured(subjects, options.rounds, options.seconds)
    if not INSTALLED:
        rows += [row_without(name, "MuJoCo is not installed") for name in MUJOCO.values()]
    report(BENCH, rows, options)


if __name__ == "__main__":
    main()
