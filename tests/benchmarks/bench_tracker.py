"""How near estimates come to people who are seen through a tracker.

    python -m app bench tracker [--json]

Three people at the synthetic work cycle for 12 s each, seen as BODY_25 key-points at 30 Hz
(``app/sim/perception/keypoint_sensor_model.py``) and turned back into a safety cylinder and
joint angles
(``app/sim/perception/person_estimator.py``). ``center``: the cylinder's axis against that
around exact
key-points. ``points inside``: every joint centre, palm and crown; ``surface inside``: every
capsule. ``body``: the model's fourteen points. ``p5`` and ``p95`` are people of that percentile
of stature, arms and shoulders, whose size the estimator knows, or takes for the median's
(``-taken-for-median``).
"""

from collections.abc import Sequence

import numpy as np

from app.sim.perception.bounding_cylinder import FLESH_MARGIN, GROWTH
from app.sim.perception.kalman_filter import HOLD_S
from app.sim.perception.keypoint_sensor_model import KeypointSensorSettings
from app.sim.perception.person_estimator import STALE_S
from tests.benchmarks.measure import Row, arguments, report
from tests.sim.tracker_errors import SECONDS, SEEDS, errors

BENCH = "tracker"
NOISY = KeypointSensorSettings(noise=0.02, missing=0.2, latency_s=0.0)
ROWS: dict[str, tuple[KeypointSensorSettings, float, float | None]] = {
    "exact": (KeypointSensorSettings(noise=0.0, missing=0.0, latency_s=0.0), 50.0, None),
    "20mm-20%": (NOISY, 50.0, None),
    "20mm-20%-100ms": (
        KeypointSensorSettings(noise=0.02, missing=0.2, latency_s=0.1),
        50.0,
        None,
    ),
    "20mm-20%-100ms-gaps": (
        KeypointSensorSettings(noise=0.02, missing=0.2, missing_s=0.2, lost=0.1, latency_s=0.1),
        50.0,
        None,
    ),
    "20mm-20%-p5": (NOISY, 5.0, None),
    "20mm-20%-p5-taken-for-median": (NOISY, 5.0, 50.0),
    "20mm-20%-p95": (NOISY, 95.0, None),
    "20mm-20%-p95-taken-for-median": (NOISY, 95.0, 50.0),
}
"""KeypointSensorModel, percentile of the people, percentile they are taken for."""


def measured(name: str) -> Row:
    """Return one row."""
    found = errors(*ROWS[name])

    def mm(values: Sequence[float], share: float) -> float:
        return 1e3 * float(np.percentile(values, share))

    return {
        "name": name,
        "frames": len(found.center),
        "center_mm": mm(found.center, 50.0),
        "center_p95_mm": mm(found.center, 95.0),
        "points_inside_percent": 100.0 * float(np.mean(found.contains)),
        "surface_inside_percent": 100.0 * float(np.mean(found.surface)),
        "wrist_mm": mm(found.wrist, 50.0),
        "wrist_p95_mm": mm(found.wrist, 95.0),
        "body_mm": mm(found.points, 50.0),
        "joint_speed_rad_s": float(np.median(found.qd)),
    }


def shown(value: object) -> str:
    """Return a number with three digits, anything else as it is."""
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def main() -> None:
    """Measure and print."""
    options = arguments(BENCH)
    stated = {
        "flesh_margin_m": FLESH_MARGIN,
        "hold_s": HOLD_S,
        "growth_m_s": GROWTH,
        "stale_s": STALE_S,
    }
    rows = [measured(name) for name in ROWS]
    if options.json:
        report(BENCH, rows, options, people=len(SEEDS), seconds_each=SECONDS, **stated)
        return
    for row in rows:
        print("  ".join(f"{key} {shown(value)}" for key, value in row.items()))


if __name__ == "__main__":
    main()
