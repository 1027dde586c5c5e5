"""What a step of the pick scenario costs: people, capsules, threads.

    python -m app bench sim-scaling [--json]

pick/workers-N, pick/walkers-N  N people of one kind, plain observations
pick/capsules-N                 one worker; the robot as N capsules: one per link (8), as it is
                                (12), every moving one cut in two (22) or three (32)
pick/threads-N/BATCH            N Python threads, each steps its own N-th of the batch; here
                                by the clock, not by processor time, and ``cores`` says how many
                                cores they got: on a machine that does other work, fewer than N
                                (of four times the rounds, those with most cores are kept)

``pairs`` counts the capsule pairs whose exact distance a pose asks for: of robot and people and
of the robot with itself; a walker is a cylinder and counts as one shape. Random actions; an
episode that ends starts again.
"""

import itertools
import statistics
import threading
import time
from collections.abc import Callable, Iterator

import numpy as np

from app.sim.cells.cell import load_cell
from app.sim.core.arrays import as_kernel_array, as_kernel_index
from app.sim.geometry.capsules import new_capsules
from app.sim.human.kernels.kinematics import N_CAPSULES
from app.sim.pick.batch import PickBatch, PickSettings, observation_workspace_of
from app.sim.pick.kernels import episode as pick
from app.sim.robot.capsules import load_robot_capsules
from app.sim.robot.kernels.arm import FIRST_OVER_TABLE, Arm
from app.sim.scenario.kernels.episode import PLAIN, new_step_workspace
from app.sim.scene.scene import HumanKind
from tests.benchmarks.measure import Row, Subject, arguments, report, rounds_over, row

BENCH = "sim-scaling"
BATCH = 128
ONE_PER_LINK = (
    "base",
    "shoulder",
    "upper_arm_mid",
    "forearm_mid",
    "wrist_1",
    "wrist_2",
    "wrist_3",
    "tool",
)
Acts = Iterator[np.ndarray]


def acts(n_envs: int, seed: int) -> Acts:
    """Return random actions, over and over, shape (n_envs, 5)."""
    rng = np.random.default_rng(seed)
    return itertools.cycle(rng.uniform(-1.0, 1.0, (64, n_envs, 5)).astype(np.float32))


def beside(
    people: tuple[HumanKind, ...], n_envs: int, seed: int, first_env: int = 0
) -> PickBatch:
    """Return a batch beside some people, its episodes begun."""
    settings = PickSettings(observation="state", people=people)
    batch = PickBatch(load_cell(), n_envs, seed, settings, first_env)
    batch.reset()
    return batch


def stepping(batch: PickBatch, seed: int) -> Callable[[], object]:
    """Return a call that steps a batch by random actions."""
    turn = acts(batch.n_envs, seed)
    return lambda: batch.step(next(turn))


def beside_people(seed: int) -> Iterator[tuple[Subject, Row]]:
    """Yield batches beside 0 to 4 people with their columns."""
    kinds: tuple[HumanKind, ...] = ("worker", "walker")
    for kind, n in itertools.product(kinds, range(5)):
        if n == 0 and kind == "walker":
            continue
        batch = beside((kind,) * n, BATCH, seed)
        shapes = n * (N_CAPSULES if kind == "worker" else 1)
        columns = capsules_soa(batch.arm, n, shapes)
        name = f"pick/{kind}s-{n}"
        yield Subject(name=name, batch=BATCH, run=stepping(batch, seed)), columns


def capsules_soa(arm: Arm, people: int, shapes: int) -> Row:
    """Return the columns that say what is measured against what."""
    n = len(arm.link)
    return {"people": people, "capsules": n, "pairs": n * shapes + len(arm.first)}


def with_capsules(arm: Arm, pieces: int) -> Arm:
    """Return the robot with other capsules: one per link (0 pieces), or each moving one cut.

    Halves and thirds of a capsule together are that capsule, so contacts stay the same.
    """
    names, n = load_robot_capsules().name, len(arm.link)
    kept = [names.index(name) for name in ONE_PER_LINK] if pieces == 0 else range(n)
    source, start, stop = [], [], []
    for k in kept:
        cuts = max(pieces, 1) if k >= FIRST_OVER_TABLE else 1
        source += [k] * cuts
        start += [cut / cuts for cut in range(cuts)]
        stop += [(cut + 1) / cuts for cut in range(cuts)]
    span = arm.span[source] * (np.array(stop) - np.array(start))[:, None]
    place = {k: [i for i, one in enumerate(source) if one == k] for k in set(source)}
    pairs = [
        pair
        for a, b in zip(arm.first, arm.second, strict=True)
        for pair in itertools.product(place.get(a, ()), place.get(b, ()))
    ]
    return arm._replace(
        link=as_kernel_index(arm.link[source]),
        p0=as_kernel_array(arm.p0[source] + np.array(start)[:, None] * arm.span[source]),
        span=as_kernel_array(span),
        capsules=new_capsules(
            len(source), load_robot_capsules().radius[source], (span**2).sum(1)
        ),
        first=as_kernel_index(np.array([a for a, _ in pairs])),
        second=as_kernel_index(np.array([b for _, b in pairs])),
    )


def with_robot(pieces: int, seed: int) -> tuple[Subject, Row]:
    """Return a batch whose robot has other capsules, stepped by the kernels themselves."""
    batch = beside(("worker",), BATCH, seed)
    arm = with_capsules(batch.arm, pieces)
    world = batch.world._replace(arm=arm)
    state = batch.state._replace(robot=np.repeat(arm.capsules[None], BATCH, axis=0))
    work = new_step_workspace(arm, world.people, state.people)
    observation = observation_workspace_of(batch.cell)
    task = batch._task
    obs = np.zeros((BATCH, pick.N_PLAIN), dtype=np.float32)
    rew = np.zeros(BATCH, dtype=np.float32)
    ended, turn = np.zeros(BATCH, dtype=np.int64), acts(BATCH, seed)
    every = np.arange(BATCH)
    pick.reset_envs(world, task, seed, 0, state, every, work)

    def step() -> None:
        pick.step_batch(world, task, state, work, next(turn), rew, ended)
        pick.observe_envs(world, task.grasp, state, every, work, observation, PLAIN, obs)
        done = np.flatnonzero(ended)
        if len(done):
            state.episode[done] += 1
            pick.reset_envs(world, task, seed, 0, state, done, work)

    name = f"pick/capsules-{len(arm.link)}"
    return Subject(name=name, batch=BATCH, run=step), capsules_soa(arm, 1, N_CAPSULES)


def side_by_side(runs: list[Callable[[], object]], seconds: float) -> tuple[float, float]:
    """Run calls in a thread each for ``seconds``; return calls per second and cores used."""
    counts, ready = [0] * len(runs), threading.Barrier(len(runs) + 1)

    def work(place: int) -> None:
        ready.wait()
        ends = time.perf_counter() + seconds
        while time.perf_counter() < ends:
            runs[place]()
            counts[place] += 1

    threads = [threading.Thread(target=work, args=(k,)) for k in range(len(runs))]
    for thread in threads:
        thread.start()
    ready.wait()
    begin, cpu = time.perf_counter(), time.process_time()
    for thread in threads:
        thread.join()
    spent = time.perf_counter() - begin
    return sum(counts) / spent, (time.process_time() - cpu) / spent


def by_threads(seed: int, rounds: int, seconds: float) -> Iterator[Row]:
    """Yield rows of one and two threads, each with its own part of a batch."""
    cases = [(batch, n) for batch in (BATCH, 8 * BATCH) for n in (1, 2)]
    runs = {case: parts_of(*case, seed) for case in cases}
    found: dict[tuple[int, int], list[tuple[float, float]]] = {case: [] for case in cases}
    for _, (batch, n) in itertools.product(range(4 * rounds), cases):
        rate, cores = side_by_side(runs[batch, n], 0.5 * seconds)
        found[batch, n].append((cores, rate * batch / n))
    for batch, n in cases:
        kept = sorted(found[batch, n])[-rounds:]
        run = runs[batch, n][0]
        subject = Subject(name=f"pick/threads-{n}/{batch}", batch=batch, run=run)
        cores = statistics.mean(one[0] for one in kept)
        values = [one[1] for one in kept]
        yield row(subject, values, "env-steps/s", threads=n, people=1, cores=cores)


def parts_of(batch: int, n: int, seed: int) -> list[Callable[[], object]]:
    """Return calls that step one n-th of a batch each, made once."""
    share = batch // n
    runs = [stepping(beside(("worker",), share, seed, k * share), seed + k) for k in range(n)]
    for run in runs:
        run()
    return runs


def main() -> None:
    """Measure and print."""
    options = arguments(BENCH)
    by_clock = list(by_threads(options.seed, options.rounds, options.seconds))
    found = list(beside_people(options.seed))
    found += [with_robot(pieces, options.seed) for pieces in (0, 1, 2, 3)]
    subjects = [subject for subject, _ in found]
    times = rounds_over(subjects, options.rounds, options.seconds)
    rows = [
        row(
            subject,
            [BATCH / spent for spent in spents],
            "env-steps/cpu-s",
            **columns,
            us_per_step=1e6 * min(spents) / BATCH,
        )
        for (subject, columns), spents in zip(found, times, strict=True)
    ]
    report(BENCH, rows + by_clock, options)


if __name__ == "__main__":
    main()
