"""Tables of the reach scenario's protocols: which measures each shows, and their names.

``make_tables.py`` asks for them. A table has the rows of ``NAME.json`` and of every
``NAME.LABEL.json`` beside it, other checkpoints under the same protocol; with more than one,
each row says whose it is. A difference of rates is given in points.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

Json = dict[str, Any]

RATES = {
    "n": "episodes",
    "success": "success",
    "collision": "collision",
    "timeout": "time-over",
}
TIMES = {"time_to_goal_s": "time to goal [s]"}
COLUMNS: Mapping[str, Mapping[str, str]] = {
    "reach-targets": {
        **RATES,
        **TIMES,
        "begun_in_contact": "begin in contact",
        "worst": "worst target",
    },
    "reach-seeds": {
        **RATES,
        **TIMES,
        "cpu_min": "training [CPU min]",
        "updates": "updates",
        "to_source_min": "above 91.76 % after [CPU min]",
    },
    "reach-changes": {
        "seeds": "seeds",
        **RATES,
        "worst_seed": "worst seed",
        "best_seed": "best",
        "against_base": "against the recipe",
        "cpu_min": "training [CPU min]",
    },
    "reach-random": {**RATES, **TIMES, "against_targets": "against the targets"},
    "reach-constant": {**RATES, **TIMES},
    "reach-speeds": {**RATES, **TIMES},
    "reach-people": {**RATES, **TIMES, "starts_redrawn": "starts redrawn"},
    "reach-tracker": {
        **RATES,
        "axis_error_median_mm": "axis off by, median [mm]",
        "axis_error_p95_mm": "95 % [mm]",
    },
    "reach-smoothness": {
        "n": "episodes",
        "position_margin_rad": "nearest to a position limit [rad]",
        "speed_rad_s": "greatest speed [rad/s]",
        "speed_limit_rad_s": "... its limit",
        "acceleration_rad_s2": "greatest acceleration [rad/s²]",
        "acceleration_limit_rad_s2": "... its limit",
        "jerk_rad_s3": "greatest jerk [rad/s³]",
        "jerk_limit_rad_s3": "... its limit",
        "position_jump_rad": "position jumps by at most [rad]",
        "speed_jump_rad_s": "speed jumps by at most [rad/s]",
        "acceleration_jump_rad_s2": "acceleration jumps by at most [rad/s²]",
        "mean_jerk_rad_s3": "mean change of acceleration [rad/s³]",
        "rms_acceleration_rad_s2": "RMS acceleration [rad/s²]",
        "success": "success",
    },
    "reach-ceiling": {
        "n": "episodes",
        "solvable": "solvable",
        "never": "shown to be impossible",
        "undecided": "undecided",
        "doomed": "every replay collided",
        "replays": "replays",
    },
    "reach-ssm": {
        "n": "runs",
        "arrived": "at the goal",
        "time_s": "time [s]",
        "time_capped_s": "... of all runs [s]",
        "below_half_s": "override below 50 % [s]",
        "stopped_s": "at 0 [s]",
        "held_s": "held at rest [s]",
        "never_stopped": "never at 0",
        "never_held": "never held at rest",
        "joint_way_rad": "joints' way [rad]",
        "tool_way_m": "tool's way [m]",
        "contacts_moving": "contacts, robot moving",
        "contacts_at_rest": "... at rest",
        "contacts_cell": "at table or cell",
    },
}
"""Measures of each protocol and what its table calls them."""
PART, MEASURED = "-measured", " measured"
"""Ends of the names of a table and of its rows that show the layer going by measured speeds."""
INSTEAD = {"arrived": "success"}
"""What stands for a measure in rows that call it otherwise."""
TURNED = frozenset({"reach-smoothness"})
"""Protocols of few rows and many measures: a line per measure."""
DIFFERENCES = frozenset({"against_targets", "against_base"})
SHARES = frozenset({"starts_redrawn", "worst_seed", "best_seed"})
"""Measures that are shares without an interval."""


def part_of(result: Json, *, measured: bool) -> Json:
    """Return a result with the rows that end in ``measured``, less that end, or all others."""
    rows = [row for row in result["results"] if row["name"].endswith(MEASURED) == measured]
    if measured:
        rows = [{**row, "name": row["name"].removesuffix(MEASURED)} for row in rows]
    return {**result, "results": rows}


def is_reach(result: Json) -> bool:
    """Tell whether a result is one of the protocols with a table here."""
    return result.get("protocol") in COLUMNS


def siblings(path: Path) -> list[Json]:
    """Return the results of other checkpoints beside one, ``NAME.LABEL.json``, with labels."""
    found = []
    for other in sorted(path.parent.glob(f"{path.stem}.*.json")):
        label = other.name.removeprefix(f"{path.stem}.").removesuffix(".json")
        found.append({"label": label, **json.loads(other.read_text(encoding="utf-8"))})
    return found


def policy_of(result: Json) -> str:
    """Return what a result's policy is called in tables and pictures."""
    name: str = result.get("label") or str(result.get("policy", "")).split(",")[0]
    return name or result["checkpoint"][:12]


def lines_of(results: Sequence[Json]) -> list[list[str]]:
    """Return the table of one protocol, the head first.

    Args:
        results: At least one; the first is that of the table's own file.
    """
    columns = COLUMNS[results[0]["protocol"]]
    several = len(results) > 1
    rows = [(policy_of(result), row) for result in results for row in result["results"]]
    there = [key for key in columns if any(value_of(row, key) is not None for _, row in rows)]
    head = ["", *(["policy"] if several else []), *(columns[key] for key in there)]
    lines = [
        [f"`{row['name']}`", *([who] if several else []), *(shown(row, key) for key in there)]
        for who, row in rows
    ]
    if results[0]["protocol"] in TURNED:
        return [list(column) for column in zip(head, *lines, strict=True)]
    return [head, *lines]


def value_of(row: Json, key: str) -> Any:
    """Return a measure of a row, or what stands for it; None where it has none."""
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
