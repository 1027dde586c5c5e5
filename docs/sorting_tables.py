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


NO_POLICY = "no policy is trained for this size"
"""What the bench notes where no checkpoint fits."""


def is_sorting(result: Json) -> bool:
    """Tell whether a result is of a protocol or of the bench of the sorting task."""
    protocol = str(result.get("protocol", ""))
    return protocol.startswith("sorting-") or result.get("bench") == "sorting"


def lines_of(result: Json) -> list[list[str]]:
    """Return the table of a result, the head first."""
    rows: list[Json] = result["results"]
    if result.get("bench") == "sorting":
        return decisions(rows)
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


def decisions(rows: list[Json]) -> list[list[str]]:
    """Return what decisions cost: a line per size, a column for each who decides."""
    cells: dict[str, dict[str, str]] = {}
    for row in rows:
        who, size = row["name"].split("/")
        cells.setdefault(size, {})[who] = decision(row)
    deciders = list(dict.fromkeys(row["name"].split("/")[0] for row in rows))
    lines = [
        [named(size), *(found.get(who, "") for who in deciders)]
        for size, found in cells.items()
    ]
    return [["", *(f"`{who}`" for who in deciders)], *lines]


def named(size: str) -> str:
    """Return the size in a row's name, such as ``20-3-disturbed``, in words."""
    cells, colours, *disturbed = size.split("-")
    return f"K = {cells}, {colours} colours" + (", disturbed" if disturbed else "")


def decision(row: Json) -> str:
    """Return one time, and by how many moves the plan is too long; or why there is none."""
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
        mean, low, high = (
            f"{scale * value[one]:.{digits}f}" for one in ("mean", "low", "high")
        )
        where = f" at {value['n_objects']}, {value['n_goal']}" if "n_objects" in value else ""
        return f"{mean}{unit} ({low}-{high}){where}"
    return f"{value:.3f}" if isinstance(value, float) else f"{value:,}"
