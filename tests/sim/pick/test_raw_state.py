"""The raw state of (5.8) from features."""

import numpy as np

from app.sim.cells.cell import load_cell
from app.sim.pick.batch import PickBatch, PickSettings
from app.sim.pick.raw_state import raw_state


def test_features_contain_the_raw_state() -> None:
    cell, rng = load_cell("pick-and-place"), np.random.default_rng(2)
    raw, seen = (
        PickBatch(cell, 16, 4, PickSettings(observation=kind)) for kind in ("state", "features")
    )
    first, second = raw.reset(), seen.reset()
    for _ in range(30):
        np.testing.assert_allclose(raw_state(second, seen.arm.limits.qd_max), first, atol=2e-6)
        act = rng.uniform(-1.0, 1.0, (16, 5)).astype(np.float32)
        first, second = raw.step(act).obs, seen.step(act).obs
