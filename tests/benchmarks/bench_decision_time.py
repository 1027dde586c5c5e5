"""Time of one decision, from joint positions to the chosen candidate.

    python -m app bench decision-time [--json]

``candidates-3`` is the live cell's case, ``candidates-1000`` the most a request may hold. What
is timed is ``TaskPolicy.decide`` with the shipped checkpoint, as the service calls it: inverse
kinematics, features, all networks. ``networks-3`` and ``networks-1000`` are all networks
alone, ``networks-torch-3`` and ``networks-torch-1000`` the same with torch. ``risk-map-2500``
is a map of 50 x 50 places of a person with three candidates.

``sorting`` is one move of the largest sorting cell with a shipped checkpoint, by that,
``sorting-planner`` one of ``sorting-e1`` by the exact planner, both as
``sorting_decision.decide`` gives them to the service: with the plan behind the expected
attempts, all moves ranked and the planner fallback monitored. Half of the tasks are disturbed.

``motion-...`` is the next segment toward a goal; see ``motion_decisions.py``.

Clock time, of one thread: the median over all calls, with the least and the 99th percentile
beside it.
"""

import itertools
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
import torch

from app.policies.checkpoints import pretrained
from app.policies.checkpoints.model_state import tensors_under
from app.policies.inference.sorting_policy import SortingPolicy
from app.policies.inference.task_selection import TaskChooser
from app.policies.inference.value_networks import ValueNetworks, pick_preset_of
from app.policies.networks.outcome import OutcomeHead
from app.policies.networks.pick import actor_of, critics_for
from app.sim.cells.cell import Cell, load_cell
from app.sim.core.arrays import Vec
from app.sim.human.person import Person
from app.sim.pick.batch import PickBatch, PickSettings
from app.sim.pick.task_policy import Candidate, MovedPerson, TaskPolicy
from app.sim.sorting.batch import SortingSettings, batch_in, shape_of
from app.sim.sorting.decision import decide
from app.sim.sorting.sorting_values import SortingValues
from app.sim.sorting.state import SortingState
from tests.benchmarks.measure import Row, arguments, report, row_without
from tests.benchmarks.motion_decisions import motion_times

BENCH = "decision-time"
STATES = 64
SORTING_CELLS = ("sorting-e1", "sorting-e0")
"""The shipped sorting tasks, the largest first; their policies go by the same names."""


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
    corners = np.array([station.position for station in load_cell().stations])
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
    return summary(f"candidates-{n}", n, times)


def network_rows(seed: int, seconds: float) -> Iterator[Row]:
    """Yield the rows of all networks, without torch and with it."""
    checkpoint, rng = pretrained.load("pick"), np.random.default_rng(seed)
    preset, networks = pick_preset_of(checkpoint), ValueNetworks(checkpoint)
    actor, critics = actor_of(preset, networks.n_obs), critics_for(preset, networks.n_obs)
    head = OutcomeHead(networks.n_obs)
    for name, module in (("actor", actor), ("critic", critics), ("outcome", head)):
        module.load_state_dict(tensors_under(checkpoint.arrays(), name))

    def by_torch(rows: torch.Tensor) -> None:
        head.predict(rows, critics.least(rows, actor(rows)))

    for n in (3, 1000):
        obs = rng.normal(size=(n, networks.n_obs)).astype(np.float32)
        calls: dict[str, Callable[[], object]] = {
            "networks": partial(networks.evaluate, obs),
            "networks-torch": partial(by_torch, torch.as_tensor(obs)),
        }
        for name, call in calls.items():
            with torch.inference_mode():
                times = np.fromiter(timed_ms(call, seconds), dtype=np.float64)
            yield summary(f"{name}-{n}", n, times)


def map_row(policy: TaskPolicy, seed: int, seconds: float) -> Row:
    """Return the row of a risk map of 50 x 50 places with three candidates."""
    state, grid = states(seed)[0], np.linspace(-1.2, 1.2, 50)
    postures = np.repeat(state.person.q[None], 2500, axis=0)
    postures[:, 0], postures[:, 1] = np.tile(grid, 50), np.repeat(grid + 1.2, 50)
    moved, offered = MovedPerson(index=0, q=postures), candidates(3, seed)
    ask = partial(policy.risk_map, state.q, state.qd, [state.person], offered, moved)
    return summary("risk-map-2500", 2500, np.fromiter(timed_ms(ask, seconds), dtype=np.float64))


def timed_ms(call: Callable[[], object], seconds: float) -> Iterator[float]:
    """Yield the time of each call for ``seconds`` [ms]."""
    ends = time.perf_counter() + seconds
    while (begin := time.perf_counter()) < ends:
        call()
        yield 1e3 * (time.perf_counter() - begin)


def summary(name: str, n: int, times: Vec) -> Row:
    """Return the row of decisions that took these times [ms]."""
    return {
        "name": name,
        "threads": 1,
        "batch": n,
        "value": float(np.median(times)),
        "low": float(times.min()),
        "high": float(np.percentile(times, 99)),
        "unit": "ms",
    }


def sorting_states(cell: Cell, seed: int) -> list[SortingState]:
    """Return sorting tasks as episodes start them, half of them disturbed."""
    batch = batch_in(cell, STATES, seed, SortingSettings(disturbed_share=0.5))
    batch.reset()
    return [batch.state_of(e) for e in range(STATES)]


def sorting_ms(
    policy: SortingValues | None, cell: Cell, seed: int, seconds: float
) -> Iterator[float]:
    """Yield the time of each decision about a move for ``seconds`` [ms]."""
    shape, turn = shape_of(cell), itertools.cycle(sorting_states(cell, seed))
    ends = time.perf_counter() + seconds
    while (begin := time.perf_counter()) < ends:
        decide(policy, next(turn), shape)
        yield 1e3 * (time.perf_counter() - begin)


def measured_sorting(
    name: str, policy: SortingValues | None, cell_name: str, seed: int, seconds: float
) -> Row:
    """Return the row of sorting moves; a policy of None is the exact planner."""
    cell = load_cell(cell_name)
    list(sorting_ms(policy, cell, seed, 0.2))
    times = np.fromiter(sorting_ms(policy, cell, seed, seconds), dtype=np.float64)
    return {**summary(name, 1, times), "cell": cell_name}


def main() -> None:
    """Measure and print."""
    options = arguments(BENCH)
    torch.set_num_threads(1)
    policy = TaskChooser(pretrained.load("pick"), load_cell())
    seconds = options.rounds * options.seconds
    rows = [measured(policy, n, options.seed, seconds) for n in (3, 1000)]
    rows += network_rows(options.seed, 0.2 * seconds)
    rows.append(map_row(policy, options.seed, 0.5 * seconds))
    shipped = [name for name in SORTING_CELLS if name in pretrained.ALIASES]
    for name in shipped[:1]:
        sorting_policy = SortingPolicy(pretrained.load(name))
        rows.append(measured_sorting("sorting", sorting_policy, name, options.seed, seconds))
    if not shipped:
        rows.append(row_without("sorting", "no checkpoint that sorts is shipped"))
    largest = SORTING_CELLS[0]
    rows.append(measured_sorting("sorting-planner", None, largest, options.seed, seconds))
    times, which = motion_times(options.seed, 3.0 * seconds)
    rows += [{**summary(name, 1, found), "policy": which} for name, found in times.items()]
    report(BENCH, rows, options)


if __name__ == "__main__":
    main()
