"""Statistics of the speed of the workers' hands, reported with results of evaluations."""

import numpy as np

from app.sim.core.kernels.rng import start_stream
from app.sim.people.kernels.motion import record_palms
from app.sim.people.kernels.people import new_people_geometry
from app.sim.pick.batch import PickBatch
from app.sim.scene.scene import new_people_state


def hand_speeds(batch: PickBatch, n_scripts: int = 200) -> dict[str, float]:
    """Return statistics of the speed of the workers' hands while above 0.05 m/s [m/s].

    They are those of ``n_scripts`` scripts, 10 s of each.
    """
    people, tick = batch.world.people._replace(yielding=0.0), 0.01
    state = new_people_state(batch.cell, people, 1)
    n_workers = state.q.shape[1]
    geometry = new_people_geometry(people, n_workers, state.cylinders.shape[1])
    palms, rng = np.zeros((int(10.0 / tick), n_workers, 2, 3)), np.zeros(1, dtype=np.uint64)
    rates = []
    for number in range(n_scripts):
        start_stream(batch.seed, 1 << 20, number, rng)
        record_palms(people, state, rng, batch.arm.capsules, tick, geometry, palms)
        rates.append(np.linalg.norm(np.diff(palms, axis=0), axis=-1).ravel() / tick)
    speeds = np.concatenate(rates)
    moving = speeds[speeds > 0.05]
    if not moving.size:  # no worker, or none moves
        return {}
    return {
        "hand_speed_median_m_s": float(np.median(moving)),
        "hand_speed_p99_m_s": float(np.percentile(moving, 99)),
        "hand_moving_share": len(moving) / len(speeds),
    }
