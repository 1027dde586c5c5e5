"""Tables of the sorting evaluations: measures and column headers.

Rates are given to 0.01 %. The grid has few rows and many measures, so its table is transposed:
one line per measure, one column per row of the result.
"""

from collections.abc import Mapping

from tools.docs.results import Json

RATIOS = frozenset({"moves_over_minimum", "attempts_over_expected"})
"""Measures that are ratios, not rates."""
GRID: Mapping[str, str] = {
    "n": "n",
    "success": "success",
    "worst_pair": "worst pair",
    "pairs_below": "pairs below {least:g} %",
    "moves_over_minimum": "moves / minimum",
    "exactly_minimal": "plans of minimum length",
    "attempts_over_expected": "attempts / expected",
    "riskier_pick": "riskier picks",
    "failed_pick": "failed picks",
    "planner_fallback": "planner fallbacks",
    "repeated": "... for repeated states",
    "mean_return": "return",
}
"""Measures of the grid and their row headers."""
TESTS: Mapping[str, str] = {
    "n": "n",
    "success": "success",
    "fewest": "minimum number of moves",
    "moves_over_minimum": "moves / minimum",
    "riskier_pick": "riskier picks",
    "safest_identical": "safest of identical objects",
    "planner_fallback": "planner fallbacks",
}
"""Measures of the six benchmark tasks and their column headers."""

FULL_TASKS: Mapping[str, str] = {
    "n": "n",
    "finished": "finished",
    "without_moving_contact": "finished without contact of the moving robot",
    "moving_contacts": "contacts of the moving robot per task",
    "contacts_at_rest": "contacts at standstill per task",
    "stopped": "share of the time stopped by the safety layer",
    "late_motions": "motions at the time limit per task",
    "grasps": "grasps per task",
    "options_per_grasp": "objects to choose among",
    "cycle_time_s": "cycle time [s]",
    "parts_per_hour": "parts per hour",
}
"""Measures of full tasks beside a person and their row headers."""
COUNTS = frozenset(
    {"moving_contacts", "contacts_at_rest", "late_motions", "grasps"}
    | {"cycle_time_s", "parts_per_hour"}
)
"""Measures that are means of counts or times, not rates."""

NO_POLICY = "no policy is trained for this size"
"""Note of the benchmark for sizes without a checkpoint."""


def is_sorting(result: Json) -> bool:
    """Return whether a result belongs to an evaluation or the benchmark of sorting."""
    protocol = str(result.get("protocol", ""))
    return protocol.startswith("sorting-") or result.get("bench") == "sorting"


def lines_of(result: Json) -> list[list[str]]:
    """Return the table of a result as lines of cells, the header first."""
    rows: list[Json] = result["results"]
    if result.get("bench") == "sorting":
        return decisions(rows)
    if result["protocol"] in ("sorting-people", "sorting-cycle-time"):
        return full_tasks(result)
    if result["protocol"] != "sorting-grid":
        head = ["", *TESTS.values()]
        return [
            head,
            *([f"`{row['name']}`", *(shown(row, key) for key in TESTS)] for row in rows),
        ]
    head = ["", *(f"`{row['name']}`" for row in rows)]
    least = 100.0 * result["settings"]["least_success"]
    return [
        head,
        *(
            [text.format(least=least), *(shown(row, key) for row in rows)]
            for key, text in GRID.items()
        ),
    ]


def full_tasks(result: Json) -> list[list[str]]:
    """Return the table of full tasks: one column per row, then paired differences."""
    columns: list[Json] = [*result["results"], *result["paired"]]
    head = ["", *(f"`{row['name']}`" for row in columns)]
    return [
        head,
        *(
            [text, *(shown(row, key) for row in columns)]
            for key, text in FULL_TASKS.items()
            if any(key in row for row in columns)
        ),
    ]


def decisions(rows: list[Json]) -> list[list[str]]:
    """Return the table of decision times [ms]: one line per size, one column per method."""
    cells: dict[str, dict[str, str]] = {}
    for row in rows:
        method, size = row["name"].split("/")
        cells.setdefault(size, {})[method] = decision(row)
    methods = list(dict.fromkeys(row["name"].split("/")[0] for row in rows))
    lines = [
        [named(size), *(found.get(method, "") for method in methods)]
        for size, found in cells.items()
    ]
    return [["", *(f"`{method} [ms]`" for method in methods)], *lines]


def named(size: str) -> str:
    """Return the size in the name of a row, such as ``20-3-disturbed``, as text."""
    cells, colours, *disturbed = size.split("-")
    return f"K = {cells}, {colours} colours" + (", disturbed" if disturbed else "")


def decision(row: Json) -> str:
    """Return a time [ms] and the excess of moves, or the reason for a missing value."""
    if row.get("value") is None:
        note = str(row.get("note", ""))
        return "" if note == NO_POLICY or note.startswith("not tried") else note
    value = float(row["value"])
    digits = 3 if value < 1.0 else 0
    extra = row.get("over")
    return f"{value:,.{digits}f}" + (f" (+{extra:g})" if extra else "")


def shown(row: Json, key: str) -> str:
    """Return one value of a row as text."""
    value = row.get(key)
    if value is None:
        return ""
    if isinstance(value, dict):
        scale, unit, digits = (1.0, "", 4) if key in RATIOS else (100.0, " %", 2)
        if key in COUNTS:
            scale, unit, digits = 1.0, "", 2
        if "low" not in value:  # a single episode
            return f"{scale * value['mean']:.{digits}f}{unit}"
        mean, low, high = (
            f"{scale * value[one]:.{digits}f}" for one in ("mean", "low", "high")
        )
        where = f" at {value['n_objects']}, {value['n_goal']}" if "n_objects" in value else ""
        to = "-" if value["low"] >= 0.0 else " to "
        return f"{mean}{unit} ({low}{to}{high}){where}"
    return f"{value:.3f}" if isinstance(value, float) else f"{value:,}"
