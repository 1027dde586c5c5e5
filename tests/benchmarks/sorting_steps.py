"""The sorting environments alone, as benchmarks step them."""

import itertools

import numpy as np

from app.sim.cells.cell import load_cell
from app.sim.sorting.batch import batch_in
from tests.benchmarks.measure import Subject
from tests.benchmarks.peers.stock_dqn import plain

BATCH = 128
RECORDED = 512
"""Steps after which the batch starts again."""


def batched(name: str, cell_name: str, seed: int) -> Subject:
    """Return the compiled batch; it makes random valid moves.

    The moves are drawn beforehand: the batch goes the same way whenever it starts again.
    """
    batch = batch_in(load_cell(cell_name), BATCH, seed)
    rng = np.random.default_rng(seed)
    acts = np.empty((RECORDED, BATCH), dtype=np.int64)
    batch.reset()
    for tick in range(RECORDED):
        acts[tick] = (batch.masks() * rng.random((BATCH, batch.shape.n_actions))).argmax(axis=1)
        batch.step(acts[tick])
    turn = itertools.cycle(range(RECORDED))

    def run() -> None:
        tick = next(turn)
        if tick == 0:
            batch.reset()
        batch.step(acts[tick])

    return Subject(name=name, batch=BATCH, run=run)


def gymnasium_alone(name: str, cell_name: str, seed: int) -> Subject:
    """Return the plain Gymnasium environment; it makes random moves."""
    env = plain(cell_name)
    env.reset(seed=seed)
    acts = np.random.default_rng(seed).integers(int(env.action_space.n), size=4096)
    turn = itertools.cycle(acts)

    def run() -> None:
        *_, over, late, _ = env.step(next(turn))
        if over or late:
            env.reset()

    return Subject(name=name, batch=1, run=run)
