"""Tables of the sorting task's protocols: rates to a hundredth of a percent, ratios as ratios.

``make_tables.py`` asks for them. A grid has few rows and many measures, so its table is turned
round: a line per measure, a column per row.
"""

from collections.abc import Mapping
from typing import Any

Json = dict[str, Any]

RATIOS = frozenset({"moves_over_minimum", "attempts_over_expected"})
"""Measures that are no rates."""
GRID: Mapping[str, str] = {
    "n": "episodes",
    "success": "success",
    "worst_pair": "worst pair",
    "pairs_below": "pairs below {least:g} %",
    "moves_over_minimum": "moves over the minimum",
    "exactly_minimal": "exactly minimal",
    "attempts_over_expected": "attempts over the expected",
    "riskier_pick": "riskier picks",
    "failed_pick": "failed picks",
    "handover": "calls for the planner",
    "repeated": "... for going in circles",
    "mean_return": "return",
}
"""Measures of the grid and what the table calls them."""
TESTS: Mapping[str, str] = {
    "n": "episodes",
    "success": "success",
    "fewest": "fewest moves",
    "moves_over_minimum": "moves over the minimum",
    "riskier_pick": "riskier picks",
    "safest_of_twins": "safest of twins",
    "handover": "calls for the planner",
}
"""Measures of the six tests and what the table calls them."""


def is_sorting(result: Json) -> bool:
    """Tell whether a result is of a protocol of the sorting task."""
    return str(result.get("protocol", "")).startswith("sorting-")


def lines_of(result: Json) -> list[list[str]]:
    """Return the table of a result, the head first."""
    rows: list[Json] = result["results"]
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


def shown(row: Json, key: str) -> str:
    """Return one value of a row as text."""
    value = row.get(key)
    if value is None:
        return ""
    if isinstance(value, dict):
        scale, unit, digits = (1.0, "", 4) if key in RATIOS else (100.0, " %", 2)
        mean, low, high = (
            f"{scale * value[one]:.{digits}f}" for one in ("mean", "low", "high")
        )
        where = f" at {value['n_objects']}, {value['n_goal']}" if "n_objects" in value else ""
        return f"{mean}{unit} ({low}-{high}){where}"
    return f"{value:.3f}" if isinstance(value, float) else f"{value:,}"
