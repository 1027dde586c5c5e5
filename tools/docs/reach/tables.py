"""Tables of the reach evaluations: measures and column headers.

A table holds the rows of ``NAME.json`` and of each ``NAME.LABEL.json``, which are results of
other checkpoints under the same evaluation. Differences of rates are given in percentage
points.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from app.policies.evaluation.reach.ssm import DIRECTED
from tools.docs.results import Json, read_result

RATES = {
    "n": "n",
    "success": "success",
    "collision": "collision",
    "timeout": "timeout",
}
TIMES = {"time_to_goal_s": "time to goal [s]"}
COLUMNS: Mapping[str, Mapping[str, str]] = {
    "reach-targets": {
        **RATES,
        **TIMES,
        "initial_contact": "initial contact",
        "worst": "worst target (x, y, height [m])",
    },
    "reach-seeds": {
        **RATES,
        **TIMES,
        "cpu_min": "training [CPU min]",
        "updates": "updates",
        "to_source_min": "above 91.76 % after [CPU min]",
    },
    "reach-ablation": {
        "seeds": "seeds",
        **RATES,
        "worst_seed": "worst seed",
        "best_seed": "best seed",
        "against_base": "difference to base [points]",
        "cpu_min": "training [CPU min]",
    },
    "reach-random": {**RATES, **TIMES, "against_targets": "difference to targets [points]"},
    "reach-constant": {**RATES, **TIMES},
    "reach-speeds": {**RATES, **TIMES},
    "reach-people": {**RATES, **TIMES, "starts_redrawn": "initial states redrawn"},
    "reach-tracker": {
        **RATES,
        "axis_error_median_mm": "axis error, median [mm]",
        "axis_error_p95_mm": "axis error, p95 [mm]",
    },
    "reach-smoothness": {
        "n": "n",
        "position_margin_rad": "smallest distance to a position limit [rad]",
        "speed_rad_s": "maximum speed [rad/s]",
        "speed_limit_rad_s": "speed limit [rad/s]",
        "acceleration_rad_s2": "maximum acceleration [rad/s²]",
        "acceleration_limit_rad_s2": "acceleration limit [rad/s²]",
        "jerk_rad_s3": "maximum jerk [rad/s³]",
        "jerk_limit_rad_s3": "jerk limit [rad/s³]",
        "position_jump_rad": "maximum position step [rad]",
        "speed_jump_rad_s": "maximum speed step [rad/s]",
        "acceleration_jump_rad_s2": "maximum acceleration step [rad/s²]",
        "mean_jerk_rad_s3": "mean jerk [rad/s³]",
        "rms_acceleration_rad_s2": "RMS acceleration [rad/s²]",
        "success": "success",
    },
    "reach-oracle": {
        "n": "n",
        "solvable": "solvable",
        "never": "presumed unsolvable",
        "undecided": "undecided",
        "doomed": "every candidate collided",
        "resimulations": "simulated candidates",
    },
    "reach-ssm": {
        "n": "n",
        "arrived": "success",
        "time_s": "time to goal [s]",
        "time_capped_s": "time, failures as 20 s [s]",
        "below_half_s": "override below 50 % [s]",
        "stopped_s": "override 0 [s]",
        "standstill_stopped_s": "at standstill [s]",
        "never_stopped": "override never 0",
        "never_at_standstill": "never at standstill",
        "joint_path_rad": "joint path [rad]",
        "tool_path_m": "tool path [m]",
        "contacts_moving": "contacts, robot moving",
        "contacts_at_rest": "contacts, robot at standstill",
        "contacts_cell": "contacts with the cell",
    },
}
"""Measures of each evaluation and their column headers."""
INSTEAD = {"arrived": "success"}
"""Measure to show where a row lacks the first one."""
TURNED = frozenset({"reach-smoothness"})
"""Evaluations with transposed tables: one line per measure."""
DIFFERENCES = frozenset({"against_targets", "against_base"})
SHARES = frozenset({"starts_redrawn", "worst_seed", "best_seed"})
"""Rates without an interval."""


def part_of(result: Json, *, directed: bool) -> Json:
    """Return a result with only the rows ending in ``-directed``, or only the others."""
    rows = [row for row in result["results"] if row["name"].endswith(DIRECTED) == directed]
    if directed:
        rows = [{**row, "name": row["name"].removesuffix(DIRECTED)} for row in rows]
    return {**result, "results": rows}


def is_reach(result: Json) -> bool:
    """Return whether a result belongs to an evaluation of the reach scenario."""
    return result.get("protocol") in COLUMNS


def siblings(path: Path) -> list[Json]:
    """Return the results of other checkpoints, ``NAME.LABEL.json``, with their labels."""
    found = []
    for other in sorted(path.parent.glob(f"{path.stem}.*.json")):
        label = other.name.removeprefix(f"{path.stem}.").removesuffix(".json")
        found.append({"label": label, **read_result(other)})
    return found


def policy_of(result: Json) -> str:
    """Return the name of the policy of a result for tables and pictures."""
    name: str = result.get("label") or str(result.get("policy", "")).split(",")[0]
    return name or result["checkpoint"][:12]


def lines_of(results: Sequence[Json]) -> list[list[str]]:
    """Return the table of an evaluation as lines of cells, the header first.

    Args:
        results: One or more; the first belongs to the file that names the table.
    """
    columns = COLUMNS[results[0]["protocol"]]
    several = len(results) > 1
    rows = [(policy_of(result), row) for result in results for row in result["results"]]
    there = [key for key in columns if any(value_of(row, key) is not None for _, row in rows)]
    head = ["", *(["policy"] if several else []), *(columns[key] for key in there)]
    lines = [
        [
            f"`{row['name']}`",
            *([policy] if several else []),
            *(shown(row, key) for key in there),
        ]
        for policy, row in rows
    ]
    if results[0]["protocol"] in TURNED:
        return [list(column) for column in zip(head, *lines, strict=True)]
    return [head, *lines]


def value_of(row: Json, key: str) -> Any:
    """Return a measure of a row, its substitute, or None."""
    value = row.get(key)
    return row.get(INSTEAD[key]) if value is None and key in INSTEAD else value


def shown(row: Json, key: str) -> str:
    """Return one value of a row as text."""
    value = value_of(row, key)
    if value is None:
        return ""
    if key == "worst":
        worst = value[0]
        x, y, _ = worst["goal"]
        return f"{100.0 * worst['mean']:.0f} % at ({x:.1f}, {y:.1f}, {worst['height_m']:.1f})"
    if key in SHARES:
        return f"{100.0 * value:.1f} %"
    if isinstance(value, dict) and "sd" in value:
        return f"{value['mean']:.2f} ± {value['sd']:.2f}"
    if isinstance(value, dict):
        mean, low, high = (100.0 * value[name] for name in ("mean", "low", "high"))
        if key in DIFFERENCES:
            return f"{mean:+.2f} ({low:+.2f} to {high:+.2f})"
        return f"{mean:.2f} % ({low:.2f}-{high:.2f})"
    if isinstance(value, float):
        return f"{value:.1e}" if 0.0 < abs(value) < 1e-3 else f"{value:.3g}"
    return f"{value:,}"
