"""Protocol ``reach-tracker``: what a policy loses when it sees people through a tracker.

Every row plays the same episodes round the grid's targets; contacts are with the true people,
and only what the policy sees differs: cylinders measured at 30 Hz, filtered and predicted to
now (``app/sim/perception/cylinder_sensor_model.py``).

========================  ==================================================================
``exact``                 the true state
``30hz``                  measured at 30 Hz, handed over at once
``100ms``                 handed over 100 ms late
``100ms-noise``           and 20 mm of noise on x, y and radius of every frame
``200ms-noise``           the same, 200 ms late
``100ms-not-predicted``   the newest frame taken for now
========================  ==================================================================

Source: METHOD 2.8 (30 Hz). Noise, latencies and filter are ours. Deviates: its cylinder comes
from a body's key-points; the people of this scenario are cylinders themselves, and are measured
as such.
"""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.evaluation.reach.bench import ReachBench, direct_ways, ending, walker_of
from app.policies.evaluation.rows import OnRow, ignore_row
from app.policies.inference.controllers import Controller, controller_of
from app.sim.core.arrays import Vec
from app.sim.people.kernels.pedestrian import AGE, GROWTH, N_PAST, PAST_S, VX, VY, R, X, Y
from app.sim.perception.cylinder_sensor_model import CylinderSensorModel, CylinderSensorSettings
from app.sim.reach.batch import ReachBatch

DEFAULT_EPISODES = 5400
"""As many as ``reach-targets`` plays."""
THINNEST = 0.05
"""Least radius that is ever seen [m]."""
RATE_HZ = 30.0


@dataclass(frozen=True, slots=True, kw_only=True)
class CylinderSensorRow:
    """How one row of the result sees people."""

    tracker: CylinderSensorSettings
    """How good the tracker is."""
    predicted: bool = True
    """Whether people are predicted to now, or taken as in the newest frame."""


def _late(latency_s: float, noise: float = 0.0) -> CylinderSensorSettings:
    return CylinderSensorSettings(rate_hz=RATE_HZ, latency_s=latency_s, noise=noise)


ROWS = {
    "30hz": CylinderSensorRow(tracker=_late(0.0)),
    "100ms": CylinderSensorRow(tracker=_late(0.1)),
    "100ms-noise": CylinderSensorRow(tracker=_late(0.1, 0.02)),
    "200ms-noise": CylinderSensorRow(tracker=_late(0.2, 0.02)),
    "100ms-not-predicted": CylinderSensorRow(tracker=_late(0.1), predicted=False),
}
"""The rows beside ``exact``."""
LOOKED_AHEAD = ("30hz", "100ms-noise")
"""Those that are also played looking ahead, where the policy can."""


class CylinderObserver:
    """Asks another controller about people as a tracker knows them; made again for every run.

    Args:
        controller: Controller of the robots.
        row: How people are seen.
        seed: Seed of the disturbances.
    """

    def __init__(self, controller: Controller, row: CylinderSensorRow, seed: int) -> None:
        self._controller, self._row, self._seed = controller, row, seed
        self._tracker: CylinderSensorModel | None = None
        self._rng = np.random.default_rng([seed, 1])
        self._past: Vec | None = None
        self.errors: list[Vec] = []
        """Distance of seen and true axes at every step of every row [m]."""

    def acts(self, batch: ReachBatch) -> NDArray[np.float32]:
        """Return the actions of all rows, shape (n_envs, 6)."""
        state, t = batch.state, batch.state.elapsed
        rows = state.people.walkers.rows
        true = rows[:, :, [X, Y, R]]
        if self._tracker is None:
            n, n_people = true.shape[:2]
            self._tracker = CylinderSensorModel(self._row.tracker, n, n_people, self._seed)
        fresh = np.flatnonzero(t == 0.0)
        self._tracker.start(fresh, true[fresh], rows[fresh][:, :, [VX, VY, GROWTH]])
        later, every = np.flatnonzero(t > 0.0), np.arange(batch.n_envs)
        self._tracker.look(later, t[later], true[later])
        seen, change = self._tracker.seen(every, predicted=self._row.predicted)
        seen[:, :, 2] = np.maximum(seen[:, :, 2], THINNEST)
        self.errors.append(np.linalg.norm(seen[:, :, :2] - true[:, :, :2], axis=2).ravel())
        return self._ask(batch, fresh, seen, change)

    def _ask(
        self, batch: ReachBatch, fresh: NDArray[np.int64], seen: Vec, change: Vec
    ) -> NDArray[np.float32]:
        """Ask about people elsewhere, and put them back where they are."""
        people, clear = batch.state.people, batch.state.clear
        kept = people.walkers.rows.copy(), people.cylinders.copy(), clear.copy()
        people.walkers.rows[:, :, [X, Y, R]] = seen
        people.walkers.rows[:, :, [VX, VY, GROWTH]] = change
        people.walkers.rows[:, :, AGE:] = self._remembered(
            fresh, people.walkers.rows, batch.arm.dt
        )
        people.cylinders[:] = seen
        batch.observe()
        act = self._controller.acts(batch)
        people.walkers.rows[:], people.cylinders[:], clear[:] = kept
        return act

    def _remembered(self, fresh: NDArray[np.int64], rows: Vec, dt: float) -> Vec:
        """Return what is remembered of everybody, all as the tracker knew them.

        What lies before an episode was measured with the tracker's noise.

        Args:
            fresh: Cells whose episode starts, shape (k,).
            rows: Walkers as the tracker knows them now, (n, n_people, N_STATE).
            dt: Control period [s].
        """
        past = self._past
        if past is None:
            past = self._past = rows[:, :, AGE:].copy()
        before = rows[fresh][:, :, AGE:]
        noise = self._row.tracker.noise * self._rng.standard_normal(before.shape)
        noise[:, :, 0] = 0.0
        past[fresh] = before + noise
        later = np.setdiff1d(np.arange(len(rows)), fresh)
        past[later, :, 0] += dt
        due = past[:, :, 0] > PAST_S - 1e-9
        now = np.stack([rows[:, :, R], np.hypot(rows[:, :, VX], rows[:, :, VY])], axis=2)
        kept = past[due][:, 1:].reshape(-1, 2, N_PAST)
        kept = np.concatenate([now[due][:, :, None], kept[:, :, :-1]], axis=2)
        past[due] = np.concatenate([np.zeros((len(kept), 1)), kept.reshape(-1, 2 * N_PAST)], 1)
        return past


def run_tracker(
    checkpoint: Checkpoint, *, episodes: int | None, seed: int, on_row: OnRow = ignore_row
) -> dict[str, Any]:
    """Evaluate round all targets beside people seen by a tracker.

    Args:
        checkpoint: What acts.
        episodes: Number of episodes of each row, by default 5400.
        seed: Seed of the episodes and of the disturbances.
        on_row: Told of each row once it is known.

    Raises:
        InvalidInput: Nobody walks about in the checkpoint's cell.
    """
    bench = ReachBench(checkpoint, seed, on_row)
    ways = direct_ways(bench.actor)
    rows = [(how, name) for how in ways for name in (LOOKED_AHEAD if ending(how) else ROWS)]
    bench.n_rows = 1 + len(rows)
    walker_of(bench.cell)
    goals = bench.target_goals(episodes or DEFAULT_EPISODES)
    bench.add(bench.play(bench.usual, goals).row("exact"), bench.usual, "grid")
    for how, name in rows:
        tracked = ROWS[name]
        controller = CylinderObserver(controller_of(bench.actor, how), tracked, seed)
        row = bench.play(bench.usual, goals, controller=controller).row(name + ending(how))
        median, p95 = np.percentile(1e3 * np.concatenate(controller.errors), [50, 95]).tolist()
        row |= {"axis_error_median_mm": median, "axis_error_p95_mm": p95}
        bench.add(row, bench.usual, "grid", how, tracker=asdict(tracked))
    return bench.result()
