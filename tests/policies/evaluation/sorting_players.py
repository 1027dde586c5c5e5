"""Sorting policies of tests: optimal, bad in a known manner, or untrained."""

from collections.abc import Callable
from itertools import count

import numpy as np
import torch

from app.policies.checkpoints.checkpoint import FORMAT, Checkpoint, pack
from app.policies.configs import presets
from app.policies.configs.sorting import SortingPreset
from app.policies.networks.sorting_q import NETWORKS, layout_of
from app.sim.cells.cell import load_cell
from app.sim.sorting.batch import shape_of
from app.sim.sorting.kernels.task import FAILURE_SCALE
from app.sim.sorting.planner import solve
from app.sim.sorting.state import NULL, SortingShape, SortingState

Choice = Callable[[SortingState, SortingShape], int]


def state_in(obs, shape: SortingShape) -> SortingState:
    """Return the state that an observation shows."""
    k, c = shape.n_slots, shape.n_colours
    clutter, towers, goal, fail = np.split(obs, np.cumsum([k, c * k, c * k]))
    return SortingState(
        clutter=clutter.astype(np.int8),
        towers=towers.astype(np.int8).reshape(c, k),
        goal=goal.astype(np.int8).reshape(c, k),
        fail=fail / FAILURE_SCALE,
    )


def values_of(choice: Choice, shape: SortingShape):
    """Return values that are greatest for what a rule chooses."""

    def values(obs):
        q = np.zeros((len(obs), shape.n_actions), dtype=np.float32)
        for row, one in zip(q, obs, strict=True):
            row[choice(state_in(one, shape), shape)] = 1.0
        return q

    return values


def exactly(state: SortingState, shape: SortingShape) -> int:
    """Choose as the exact planner does."""
    best = solve(state, shape).best
    assert best is not None
    return best


def riskily(state: SortingState, shape: SortingShape) -> int:
    """Choose as the exact planner does, but always the riskiest duplicate."""
    move = shape.move_of(exactly(state, shape))
    if move.pick >= shape.n_slots:
        return shape.action_of(move)
    duplicates = np.flatnonzero(state.clutter == state.clutter[move.pick])
    cell = int(duplicates[state.fail[duplicates].argmax()])
    return cell * shape.n_colours + move.place - shape.n_slots


def in_circles(state: SortingState, shape: SortingShape) -> int:
    """Move one object to and fro between two towers."""
    c = int(state.heights.argmax())
    if state.heights[c] == 0:
        return int(np.flatnonzero(state.clutter != NULL)[0]) * shape.n_colours
    other = (c + 1) % shape.n_colours
    return 2 * shape.n_slots * shape.n_colours + c * shape.n_colours + other


def at_random(shape: SortingShape, seed: int):
    """Return values that are drawn again for every question."""
    calls = count()

    def values(obs):
        rng = np.random.default_rng((seed, next(calls)))
        return rng.random((len(obs), shape.n_actions)).astype(np.float32)

    return values


def untrained(cell: str = "sorting-e0") -> Checkpoint:
    """Return a sorting policy that has learned nothing."""
    preset = presets.resolve("sorting-e0-dqn", {"networks": {"width": 16}})
    assert isinstance(preset, SortingPreset)
    shape = shape_of(load_cell(cell))
    torch.manual_seed(1)
    network = NETWORKS[preset.networks.kind](shape, 16)
    manifest = {
        "format": FORMAT,
        "kind": "policy",
        "preset": preset.model_dump(),
        "seed": 1,
        "cell": cell,
        "layout": layout_of(shape),
        "act_size": shape.n_actions,
        "width": 16,
        "step": 0,
        "updates": 0,
        "trained_range": {},
    }
    arrays = {f"q.{name}": one.numpy() for name, one in network.state_dict().items()}
    return pack(manifest, arrays)
