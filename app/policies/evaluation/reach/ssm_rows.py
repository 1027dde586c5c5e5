"""Rows and comparisons of ``reach-ssm``, from episodes under the safety layer."""

import numpy as np

from app.policies.evaluation.rows import Json
from app.policies.evaluation.statistics import Flags, mean_of, rate_of, ratio_values
from app.sim.core.arrays import Vec
from app.sim.scenario.monitoring import MonitoredEpisodes


def crossing_row(name: str, runs: MonitoredEpisodes, time_limit_s: float) -> Json:
    """Return the result row of crossings; `ssm.py` defines the measures.

    Args:
        time_limit_s: Time of runs that do not arrive in ``time_capped_s`` [s].
    """
    arrived = runs.arrived
    return {
        "name": name,
        "n": len(arrived),
        "arrived": rate_of(arrived),
        "time_s": _spread(runs.seconds[arrived]),
        "time_capped_s": _spread(np.where(arrived, runs.seconds, time_limit_s)),
        "time_untouched_s": _spread(runs.seconds[arrived & ~runs.touched_at_rest]),
        "below_half_s": _spread(runs.below_half_s),
        "stopped_s": _spread(runs.stopped_s),
        "standstill_s": _spread(runs.standstill_s),
        "standstill_stopped_s": _spread(runs.standstill_stopped_s),
        "never_stopped": rate_of(runs.stopped_s == 0.0),
        "never_at_standstill": rate_of(runs.standstill_stopped_s == 0.0),
        "joint_path_rad": _spread(runs.joint_path[arrived]),
        "tool_path_m": _spread(runs.tool_path[arrived]),
        **_contacts(runs),
    }


def random_row(name: str, runs: MonitoredEpisodes) -> Json:
    """Return the result row of random episodes."""
    touched = runs.touched_moving | runs.touched_at_rest | runs.touched_cell
    return {
        "name": name,
        "n": len(touched),
        "success": rate_of(runs.arrived),
        "contact": rate_of(touched),
        "moving_rate": rate_of(runs.touched_moving),
        "timeout": rate_of(~runs.arrived & ~touched),
        "time_s": _spread(runs.seconds[runs.arrived]),
        **_contacts(runs),
    }


def _contacts(runs: MonitoredEpisodes) -> Json:
    """Return numbers of contacts with the moving and the stationary robot."""
    return {
        "contacts": int((runs.touched_moving | runs.touched_at_rest).sum()),
        "contacts_moving": int(runs.touched_moving.sum()),
        "contacts_at_rest": int(runs.touched_at_rest.sum()),
        "contacts_cell": int(runs.touched_cell.sum()),
        "fastest_link_m_s": float(runs.link_speed[runs.touched_moving].max(initial=0.0)),
        "fastest_person_m_s": float(runs.person_speed.max(initial=0.0)),
    }


def _spread(values: Vec) -> dict[str, float] | None:
    """Return mean, standard deviation and 95 % interval; None without values."""
    found = mean_of(values)
    if found is None:
        return None
    return {**found, "sd": float(values.std(ddof=1)) if len(values) > 1 else 0.0}


def against(one: MonitoredEpisodes, other: MonitoredEpisodes, time_limit_s: float) -> Json:
    """Return the time saved by ``one`` against ``other``, paired by crossing.

    ``all`` covers all runs, with the time limit for runs that do not arrive; ``untouched`` the
    runs in which both arrive and neither is touched. ``share`` is the ratio of the time saved
    to the other's time, over all of them.

    Args:
        time_limit_s: Time of runs that do not arrive [s].
    """
    untouched = one.arrived & other.arrived & ~one.touched_at_rest & ~other.touched_at_rest
    times = [np.where(runs.arrived, runs.seconds, time_limit_s) for runs in (one, other)]

    def saving(which: Flags) -> Json | None:
        if not which.any():
            return None
        saved, usual = (times[1] - times[0])[which], times[1][which]
        share = mean_of(ratio_values(saved, usual))
        return {"n": int(which.sum()), "saved_s": mean_of(saved), "share": share}

    every = np.ones(len(untouched), dtype=np.bool_)
    return {"all": saving(every), "untouched": saving(untouched)}


def arrival_times(runs: MonitoredEpisodes) -> list[float | None]:
    """Return the time of each run to the goal [s]; None where it was not reached."""
    return [
        round(float(seconds), 2) if arrived else None
        for seconds, arrived in zip(runs.seconds, runs.arrived, strict=True)
    ]
