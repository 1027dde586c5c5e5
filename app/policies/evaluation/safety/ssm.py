"""Protocol ``safety-ssm``: falsification of speed and separation monitoring.

Adversarial people run at a robot under arbitrary policies
(``app/sim/safety/adversarial_trials.py``), in the
cells of both scenarios and without margins: C, Z_d, Z_r and the protective distance are 0. No
checkpoint is involved.

========================  ==================================================================
``inside``                all assumptions hold; no delay, and a known delay of 0.1 s
``touch-limited``         the same with power and force limiting: contacts at admissible speeds
``fast-hands``            people at 2.5 m/s where 1.6 m/s are assumed
``late-tracker``          an unknown delay of 0.1 s
``fast-hands-cell``       fast hands with the default margins: 0.3 m and 0.1 s
``late-tracker-cell``     a late tracker with the same margins
``no-ssm``                no safety layer: rate of contacts in motion
========================  ==================================================================
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.evaluation.rows import EvaluationRequest, Json
from app.policies.evaluation.statistics import wilson
from app.sim.safety.adversarial_trials import TrialResult, TrialSettings, run_trial
from app.sim.safety.layer import SafetySettings

DEFAULT_EPISODES = 100_000
OUTSIDE_SHARE = 10
"""Ratio of the episodes of ``inside`` to those of every other row."""
FAST_HANDS = 2.5
"""Speed of trained hands, 2 to 2.7 m/s; above the usual assumption [m/s]."""
LATE = 0.1
"""Delay of the tracker [s]."""
NO_MARGINS = SafetySettings(reaction_time=0.0, protective_distance=0.0)
"""Assumptions without margins."""
PLACES: tuple[TrialSettings, ...] = (
    TrialSettings(safety=NO_MARGINS, cell="pick-and-place", people=("worker",)),
    TrialSettings(safety=NO_MARGINS, cell="shared-workspace", people=("walker",)),
)
"""The two scenarios."""


def trials() -> dict[str, list[TrialSettings]]:
    """Return the trials of every row; a row's episodes are shared evenly among them."""
    known = replace(NO_MARGINS, tracker_delay=LATE)
    rows: dict[str, list[TrialSettings]] = {
        "inside": [*PLACES, *(replace(p, safety=known, true_delay=LATE) for p in PLACES)],
        "touch-limited": [replace(p, safety=replace(NO_MARGINS, pfl=True)) for p in PLACES],
        "fast-hands": [replace(p, human_speed=FAST_HANDS) for p in PLACES],
        "late-tracker": [replace(p, true_delay=LATE) for p in PLACES],
    }
    for name in ("fast-hands", "late-tracker"):
        rows[f"{name}-cell"] = [replace(p, safety=SafetySettings()) for p in rows[name]]
    rows["no-ssm"] = [replace(p, monitored=False) for p in PLACES]
    return rows


def _row(name: str, results: list[TrialResult]) -> Json:
    """Return one row: all its episodes together."""
    n, moving = sum(r.n for r in results), sum(r.n_moving for r in results)
    periods = np.array([r.n_steps for r in results])
    stopped = np.array([r.stopped_share for r in results])
    slowed = np.array([r.slowed_share for r in results])
    return {
        "name": name,
        "n": n,
        "contacts": sum(r.n_contacts for r in results),
        "contacts_moving": moving,
        "moving_rate": wilson(moving, n),
        "fastest_link_m_s": max(r.fastest_link for r in results),
        "fastest_person_m_s": max(r.fastest_person for r in results),
        "stopped_share": float(stopped @ periods / periods.sum()),
        "slowed_share": float(slowed @ periods / periods.sum()),
    }


def stated(trial: TrialSettings) -> Mapping[str, Any]:
    """Return the assumptions and the true conditions of a trial."""
    return {
        "cell": trial.cell,
        "people": list(trial.people),
        "assumed": trial.safety.describe(),
        "true human_speed [m/s]": trial.human_speed,
        "true tracker_delay [s]": trial.true_delay,
        "seconds [s]": trial.seconds,
        "monitored": trial.monitored,
    }


def run_safety(_checkpoint: Checkpoint | None, request: EvaluationRequest) -> Json:
    """Evaluate the safety layer beside adversarial people, without a policy.

    The request has the number of episodes inside the assumptions, by default 100,000; every
    other row runs a tenth of that.
    """
    n_inside = request.episodes or DEFAULT_EPISODES
    planned, settings = trials(), {}
    rows = request.rows(len(planned))
    for name, row_trials in planned.items():
        n = n_inside if name == "inside" else max(1, n_inside // OUTSIDE_SHARE)
        shares = [len(part) for part in np.array_split(np.arange(n), len(row_trials))]
        results = [
            run_trial(trial, share, request.seed)
            for trial, share in zip(row_trials, shares, strict=True)
            if share
        ]
        rows.append(_row(name, results))
        settings[name] = [stated(trial) for trial in row_trials]
    return {"settings": settings, "results": rows}
