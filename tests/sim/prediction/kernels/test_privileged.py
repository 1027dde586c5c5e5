"""What is foreseen of walkers is what they then do."""

import numpy as np
import pytest

from app.sim.cells.cell import load_cell
from app.sim.people.kernels.pedestrian import PedestrianState, R, X, Y
from app.sim.prediction.kernels.privileged import AHEAD_S, N_AHEAD, write_privileged_future
from app.sim.reach.batch import ReachBatch, ReachSettings


@pytest.mark.parametrize("start", ["clearance", "authors"])
def test_walkers_go_where_they_were_foreseen(start):
    settings = ReachSettings(people=("walker",) * 2, start=start)
    batch = ReachBatch(load_cell("shared-workspace"), 40, 3, settings)
    batch.reset()
    walkers, dt = batch.state.people.walkers, batch.arm.dt
    copy = PedestrianState(walkers.rows.copy(), walkers.stream.copy())
    ahead, before = np.zeros((40, 2 * N_AHEAD)), walkers.rows.copy()
    write_privileged_future(batch.world.people.walkers, walkers, copy, dt, ahead)
    assert np.array_equal(walkers.rows, before)
    foreseen, done = ahead.reshape(40, 2, len(AHEAD_S), 3), 0
    still = np.zeros((40, 6), dtype=np.float32)
    for k, seconds in enumerate(AHEAD_S):
        while done < round(seconds / dt):
            batch.step(still, auto_reset=False, features=False)
            done += 1
        goes_on = batch.state.outcome == 0
        offset = walkers.rows[:, :, [X, Y]] - before[:, :, [X, Y]]
        np.testing.assert_array_equal(foreseen[goes_on, :, k, :2], offset[goes_on])
        np.testing.assert_array_equal(foreseen[goes_on, :, k, 2], walkers.rows[goes_on][..., R])
    assert goes_on.sum() > 20 and np.abs(foreseen[..., -1, 0]).max() > 0.5
