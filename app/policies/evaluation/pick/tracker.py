"""Protocol ``pick-tracker``: a policy that observes people through a tracker.

All rows run the same episodes of ``pick-choice`` with contacts of the true person. They differ
in the observation: BODY_25 key-points at 30 Hz
(``app/sim/perception/keypoint_sensor_model.py``), from which
``app/sim/perception/person_estimator.py`` estimates joint angles and speeds. Each environment
has its own tracker and estimator; the tracker starts before the episode does.

========================  ==================================================================
``exact``                 the true state
``33ms``                  latency of one frame
``100ms``, ``200ms``      latencies of several frames; the estimator predicts the current state
``100ms-not-predicted``   state at the time of the newest frame, at least 0.1 s old
``100ms-noise-missing``   100 ms, 20 mm noise per axis, 20 % of the key-points missing
========================  ==================================================================

Source: docs/method.md 2.8 (30 Hz). Noise, share and latencies are ours.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.evaluation.pick import selection_rules
from app.policies.evaluation.pick.episodes import (
    ObservedPeople,
    PeopleObserver,
    PickBench,
    observe_exactly,
)
from app.policies.evaluation.pick.tasks import settings_of
from app.policies.evaluation.rows import EvaluationRequest, Json
from app.policies.evaluation.statistics import Index
from app.policies.inference.task_selection import HYSTERESIS
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.perception.keypoint_sensor_model import KeypointSensorModel, KeypointSensorSettings
from app.sim.perception.person_estimator import PersonEstimator
from app.sim.pick.batch import PickBatch

DEFAULT_EPISODES = 300
RATE_HZ = 30.0
WARM_UP_S = 0.4
"""Time for which the tracker runs before the episode [s]; the person moves at the initial speed
until then."""


@dataclass(frozen=True, slots=True, kw_only=True)
class KeypointSensorRow:
    """Observation model of one result row."""

    tracker: KeypointSensorSettings
    """Latency, noise and dropouts."""
    predicted: bool = True
    """Whether the estimate is for the current time instead of the newest frame's."""


def _late(seconds: float, **disturbed: float) -> KeypointSensorSettings:
    clean = {"noise": 0.0, "missing": 0.0, **disturbed}
    return KeypointSensorSettings(rate_hz=RATE_HZ, latency_s=seconds, **clean)


ROWS = {
    "33ms": KeypointSensorRow(tracker=_late(1.0 / RATE_HZ)),
    "100ms": KeypointSensorRow(tracker=_late(0.1)),
    "200ms": KeypointSensorRow(tracker=_late(0.2)),
    "100ms-not-predicted": KeypointSensorRow(tracker=_late(0.1), predicted=False),
    "100ms-noise-missing": KeypointSensorRow(tracker=_late(0.1, noise=0.02, missing=0.2)),
}
"""Rows other than ``exact``."""


def between(
    t0: float, q0: Vec, qd0: Vec, t1: float, q1: Vec, qd1: Vec
) -> Callable[[float], Vec]:
    """Return the cubic motion between two states, extrapolated linearly before the first.

    Args:
        t0: Time of the first state [s].
        q0: Joint positions then [m, rad], shape (18,).
        qd0: Joint speeds then [m/s, rad/s], shape (18,).
        t1: Time of the second state [s], not before the first.
        q1: As ``q0``.
        qd1: As ``qd0``.
    """
    span = t1 - t0

    def at(t: float) -> Vec:
        if t <= t0 or span <= 0.0:
            return np.clip(q0 + (t - t0) * qd0, human.Q_MIN, human.Q_MAX)
        x = (t - t0) / span
        rise = x * x * (3.0 - 2.0 * x)
        bend = x * (1.0 - x) * span * ((1.0 - x) * qd0 - x * qd1)
        return np.asarray(q0 + rise * (q1 - q0) + bend)

    return at


class KeypointObserver:
    """Observe the first worker of each environment by tracker and estimator, for one run."""

    def __init__(self, row: KeypointSensorRow, seed: int) -> None:
        self._row, self._seed = row, seed
        self._trackers: dict[int, KeypointSensorModel] = {}
        self._estimators: dict[int, PersonEstimator] = {}
        self._frame_at: dict[int, float] = {}
        self._before: tuple[Vec, Vec, Vec] | None = None
        self.wrist_errors: list[float] = []
        """Distance of observed and true wrists at each step of each environment [m]."""

    def __call__(self, batch: PickBatch, rows: Index) -> ObservedPeople:
        """Update the estimators with the frames available now and return their estimates."""
        people, t = batch.state.people, batch.state.elapsed
        now = t.copy(), people.q[:, 0].copy(), people.qd[:, 0].copy()
        if self._before is None:
            self._start(batch, rows)
        t0, q0, qd0 = self._before or now
        observed = ObservedPeople(
            q=np.empty((len(rows), 1, 18)),
            qd=np.empty((len(rows), 1, 18)),
            size=people.size[rows, :1].copy(),
        )
        for k, e in enumerate(rows.tolist()):
            motion = between(t0[e], q0[e], qd0[e], float(t[e]), people.q[e, 0], people.qd[e, 0])
            observed.q[k, 0], observed.qd[k, 0] = self._estimate(batch, e, float(t[e]), motion)
            self._measure(observed.q[k, 0], people.q[e, 0], observed.size[k, 0])
        self._before = now
        return observed

    def _start(self, batch: PickBatch, rows: Index) -> None:
        settings = self._row.tracker
        phases = np.random.default_rng(self._seed).random(batch.n_envs) / settings.rate_hz
        for e in rows.tolist():
            size = batch.state.people.size[e, 0].copy()
            self._trackers[e] = KeypointSensorModel(
                settings,
                (self._seed, e),
                size,
                batch.world.people.floor_z,
                start=-settings.latency_s - WARM_UP_S + float(phases[e]),
            )
            self._estimators[e] = PersonEstimator(size)

    def _estimate(
        self, batch: PickBatch, e: int, t: float, motion: Callable[[float], Vec]
    ) -> tuple[Vec, Vec]:
        """Return estimated joint positions and speeds of one environment's person at ``t``."""
        estimator = self._estimators[e]
        for frame in self._trackers[e].frames(t, motion):
            estimator.take(frame.t, frame.keypoints, frame.confidences)
            self._frame_at[e] = frame.t
        person = None
        if e in self._frame_at:
            person = estimator.person_at(t if self._row.predicted else self._frame_at[e])
        if person is None:
            return batch.world.people.no_person, np.zeros(18)
        return person.q, person.qd

    def _measure(self, observed: Vec, true: Vec, size: Vec) -> None:
        one, other = human.joint_points(observed, size), human.joint_points(true, size)
        for wrist in ("wrist_r", "wrist_l"):
            self.wrist_errors.append(float(np.linalg.norm(one[wrist] - other[wrist])))


def run_tracker(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate task selection among 2 or 3 random targets with people observed by a tracker."""
    bench = PickBench(checkpoint, request, default=DEFAULT_EPISODES)
    evaluator = bench.evaluator(bench.usual)
    rule = selection_rules.critic(HYSTERESIS)
    observers: dict[str, PeopleObserver] = {"exact": observe_exactly}
    observers |= {name: KeypointObserver(row, request.seed) for name, row in ROWS.items()}
    results = request.rows(len(observers))
    for name, observe in observers.items():
        row = evaluator.run(rule, observe=observe).row(name)
        errors = observe.wrist_errors if isinstance(observe, KeypointObserver) else [0.0]
        row["wrist_error_median_mm"] = 1e3 * float(np.median(errors))
        row["wrist_error_p95_mm"] = 1e3 * float(np.percentile(errors, 95))
        results.append(row)
    return {
        "settings": {
            **settings_of(evaluator.batch),
            "hysteresis": HYSTERESIS,
            "trackers": {name: asdict(row) for name, row in ROWS.items()},
        },
        "results": results,
    }
