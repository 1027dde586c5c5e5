"""The table of picks by training seeds, the shipped policy first."""

from pathlib import Path

from tools.docs.headline import percent, share
from tools.docs.pick_tables import p_value
from tools.docs.results import Json, read_if_measured

SHIPPED = "-seed1"
"""Suffix of the result files of the shipped policy, but for those of the case studies."""
SUFFIXES = {"1, shipped": SHIPPED, "2": "-seed2", "3": "-seed3"}
"""Training seeds, and the suffixes of their result files."""
SINGLE, CHOICE, HARD, CASES = "pick-single", "pick-choice", "pick-choice-hard", "pick-cases"
CHOICES = {
    "2 or 3 targets": (CHOICE, ""),
    "two people": (HARD, "two-people "),
    "people 1.4 times as fast": (HARD, "faster "),
    "both": (HARD, "two-people-faster "),
}
"""Conditions with a choice: the result with them, and the prefix of its rows."""


def lines(results: Path) -> list[list[str]] | None:
    """Return the table as lines of cells, the header first; None where a result is missing.

    Args:
        results: Folder of the JSON files.
    """
    columns = [_column(results, suffix) for suffix in SUFFIXES.values()]
    whole = [column for column in columns if column is not None]
    if len(whole) < len(columns):
        return None
    rows = [[name, *(column[name] for column in whole)] for name in whole[0]]
    return [["training seed", *SUFFIXES], *rows]


def _column(results: Path, suffix: str) -> dict[str, str] | None:
    """Return the cells of one training seed by their row."""
    found: dict[str, Json] = {}
    for name in (SINGLE, CHOICE, HARD, CASES):
        end = "" if name == CASES and suffix == SHIPPED else suffix
        if (result := read_if_measured(results / f"{name}{end}.json")) is None:
            return None
        found[name] = result
    rows = {name: {row["name"]: row for row in one["results"]} for name, one in found.items()}
    policy = rows[SINGLE]["policy"]
    cells = {
        "one target: success": percent(policy["success"]),
        "one target: collision": percent(policy["collision"]),
    }
    for condition, (name, prefix) in CHOICES.items():
        for rule in ("critic", "nearest", "oracle"):
            rate = rows[name][f"{prefix}{rule}"]["success"]
            cells[f"{condition}: `{rule}`"] = percent(rate) if rule == "critic" else share(rate)
        cells[f"{condition}: share of the oracle's gain, p"] = _gain(found[name], prefix)
    for name, row in rows[CASES].items():
        cells[f"`{name}`: as expected"] = percent(row["as_expected"])
    cells["checkpoint"] = f"`{found[SINGLE]['checkpoint'][:12]}`"
    commits = dict.fromkeys(f"`{one['machine']['commit']}`" for one in found.values())
    return cells | {"commits": ", ".join(commits)}


def _gain(result: Json, prefix: str) -> str:
    """Return how much of the oracle's gain over the nearest target the critic has."""
    name = f"{prefix}critic - nearest"
    pair = next(one for one in result["paired"] if one["name"] == name)
    return f"{100.0 * pair['difference'] / pair['oracle_gain']:.0f} %, {p_value(pair['p'])}"
