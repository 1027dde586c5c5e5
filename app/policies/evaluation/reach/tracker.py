"""Protocol ``reach-tracker``: a policy that observes people through a tracker.

All rows run the same episodes on the targets of the grid with contacts of the true people. They
differ in the observation: cylinders measured at 30 Hz, filtered and predicted to the current
time (``app/sim/perception/cylinder_sensor_model.py``).

========================  ==================================================================
``exact``                 the true state
``30hz``                  measured at 30 Hz without latency
``100ms``                 latency of 100 ms
``100ms-noise``           the same with 20 mm of noise on x, y and radius of every frame
``200ms-noise``           the same with a latency of 200 ms
``100ms-not-predicted``   newest frame without prediction
========================  ==================================================================

Source: docs/method.md 2.8 (30 Hz). Noise, latencies and filter are ours. Deviates: the source
computes cylinders from key-points of a body; the people of this scenario are measured as
cylinders.
"""

from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.evaluation.reach.bench import ReachBench, Variant, pedestrian_of, suffix_of
from app.policies.evaluation.reach.episodes import ReachEpisodes
from app.policies.evaluation.rows import EvaluationRequest, Json
from app.policies.inference.controllers import Controller, controller_of
from app.sim.core.arrays import Vec
from app.sim.people.kernels.pedestrian import AGE, GROWTH, N_PAST, PAST_S, VX, VY, R, X, Y
from app.sim.perception.cylinder_sensor_model import CylinderSensorModel, CylinderSensorSettings
from app.sim.reach.batch import ReachBatch
from app.sim.scenario.kernels.episode import RUNNING

DEFAULT_EPISODES = 5400
"""As in ``reach-targets``."""
MIN_RADIUS = 0.05
"""Minimum observed radius [m]."""
RATE_HZ = 30.0


@dataclass(frozen=True, slots=True, kw_only=True)
class CylinderSensorRow:
    """Observation model of one result row."""

    tracker: CylinderSensorSettings
    """Latency and noise."""
    predicted: bool = True
    """Whether people are predicted from the newest frame to the current time."""


def _late(latency_s: float, noise: float = 0.0) -> CylinderSensorSettings:
    return CylinderSensorSettings(rate_hz=RATE_HZ, latency_s=latency_s, noise=noise)


ROWS = {
    "30hz": CylinderSensorRow(tracker=_late(0.0)),
    "100ms": CylinderSensorRow(tracker=_late(0.1)),
    "100ms-noise": CylinderSensorRow(tracker=_late(0.1, 0.02)),
    "200ms-noise": CylinderSensorRow(tracker=_late(0.2, 0.02)),
    "100ms-not-predicted": CylinderSensorRow(tracker=_late(0.1), predicted=False),
}
"""Rows other than ``exact``."""
ROLLOUT_ROWS = ("30hz", "100ms-noise")
"""Rows that are also measured with rollout, where the policy allows it."""


class CylinderObserver:
    """Controller whose policy observes people through a tracker, for one run."""

    def __init__(self, controller: Controller, row: CylinderSensorRow, seed: int) -> None:
        self._controller, self._row, self._seed = controller, row, seed
        self._tracker: CylinderSensorModel | None = None
        self._rng = np.random.default_rng([seed, 1])
        self._past: Vec | None = None
        self.errors: list[Vec] = []
        """Distance of observed and true axes at each step of each running environment [m]."""

    def acts(self, batch: ReachBatch) -> NDArray[np.float32]:
        """Return the actions of all environments, shape (n_envs, 6)."""
        state, t = batch.state, batch.state.elapsed
        rows = state.people.walkers.rows
        true = rows[:, :, [X, Y, R]]
        if self._tracker is None:
            n, n_people = true.shape[:2]
            self._tracker = CylinderSensorModel(self._row.tracker, n, n_people, self._seed)
        fresh = np.flatnonzero(t == 0.0)
        self._tracker.start(fresh, true[fresh], rows[fresh][:, :, [VX, VY, GROWTH]])
        later, every = np.flatnonzero(t > 0.0), np.arange(batch.n_envs)
        self._tracker.observe(later, t[later], true[later])
        seen, change = self._tracker.seen(every, predicted=self._row.predicted)
        seen[:, :, 2] = np.maximum(seen[:, :, 2], MIN_RADIUS)
        running = state.outcome == RUNNING
        away = seen[running, :, :2] - true[running, :, :2]
        self.errors.append(np.linalg.norm(away, axis=2).ravel())
        return self._query(batch, fresh, seen, change)

    def _query(
        self, batch: ReachBatch, fresh: NDArray[np.int64], seen: Vec, change: Vec
    ) -> NDArray[np.float32]:
        """Query the controller with observed people, then restore the true ones."""
        people, clear = batch.state.people, batch.state.clear
        kept = people.walkers.rows.copy(), people.cylinders.copy(), clear.copy()
        people.walkers.rows[:, :, [X, Y, R]] = seen
        people.walkers.rows[:, :, [VX, VY, GROWTH]] = change
        people.walkers.rows[:, :, AGE:] = self._history(
            fresh, people.walkers.rows, batch.arm.dt
        )
        people.cylinders[:] = seen
        batch.observe()
        act = self._controller.acts(batch)
        people.walkers.rows[:], people.cylinders[:], clear[:] = kept
        return act

    def _history(self, fresh: NDArray[np.int64], rows: Vec, dt: float) -> Vec:
        """Return the observed history of all people.

        The history before an episode contains the tracker's noise.

        Args:
            fresh: Environments whose episode starts, shape (k,).
            rows: Observed pedestrians, shape (n, n_people, N_STATE).
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


def run_tracker(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate on all targets with people observed through a tracker.

    Raises:
        InvalidInput: The checkpoint's cell has no pedestrian.
    """
    bench = ReachBench(checkpoint, request.seed, request.on_row)
    pedestrian_of(bench.cell)
    goals = bench.target_goals(request.episodes or DEFAULT_EPISODES)
    variants = [bench.variant("exact", goals)]
    variants += [
        replace(
            bench.variant(name + suffix_of(mode), goals, mode),
            controller=CylinderObserver(
                controller_of(bench.actor, mode), ROWS[name], request.seed
            ),
            stated={"tracker": asdict(ROWS[name])},
        )
        for mode in bench.direct_modes
        for name in (ROLLOUT_ROWS if mode.rollout else ROWS)
    ]
    bench.measure(variants, axis_errors)
    return bench.result()


def axis_errors(variant: Variant, _episodes: ReachEpisodes) -> Json:
    """Return median and 95th percentile of the distance of observed and true axes [mm]."""
    if not isinstance(variant.controller, CylinderObserver):
        return {}
    errors = 1e3 * np.concatenate(variant.controller.errors)
    median, p95 = np.percentile(errors, [50, 95]).tolist()
    return {"axis_error_median_mm": median, "axis_error_p95_mm": p95}
