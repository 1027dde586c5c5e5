"""The table of picks by training seeds, the shipped policy first."""

from pathlib import Path
from statistics import fmean

from tools.docs.headline import percent
from tools.docs.pick_tables import p_value
from tools.docs.results import Json, read_if_measured

SUFFIXES = {"1, shipped": "", "2": "-seed2", "3": "-seed3"}
"""Training seeds, and the suffixes of their result files."""
SINGLE, CHOICE, HARD, CASES = "pick-single", "pick-choice", "pick-choice-hard", "pick-cases"
MORE = "two-people-4-to-6-targets"
CHOICES = {
    "2 or 3 targets": (CHOICE, ""),
    "people 1.4 times as fast": (HARD, "faster "),
    "two people": (HARD, "two-people "),
    "two people, within 14 s": (HARD, "two-people-14-s "),
    "two people, within 20 s": (HARD, "two-people-20-s "),
    "two people 1.4 times as fast": (HARD, "two-people-faster "),
    "two people, 4 to 6 targets": (HARD, f"{MORE} "),
    "two people, 4 to 6 targets, within 14 s": (HARD, f"{MORE}-14-s "),
    "two people, 4 to 6 targets, within 20 s": (HARD, f"{MORE}-20-s "),
}
"""Conditions with a choice: the result with them, and the prefix of its rows."""


def lines(results: Path) -> list[list[str]] | None:
    """Return the table as lines of cells, the header first; None where a result is missing.

    Args:
        results: Folder of the JSON files.
    """
    seeds = [_results(results, suffix) for suffix in SUFFIXES.values()]
    whole = [found for found in seeds if found is not None]
    if len(whole) < len(seeds):
        return None
    table = [
        ["training seed", *SUFFIXES, "mean"],
        _rates("one target: success", [_row(found, SINGLE, "policy") for found in whole]),
        _rates(
            "one target: collision",
            [_row(found, SINGLE, "policy") for found in whole],
            "collision",
        ),
    ]
    for condition, (name, prefix) in CHOICES.items():
        for rule in ("critic", "nearest", "oracle"):
            rows = [_row(found, name, f"{prefix}{rule}") for found in whole]
            table.append(_rates(f"{condition}: `{rule}`", rows, short=rule != "critic"))
        pairs = [_pair(found[name], f"{prefix}critic - nearest") for found in whole]
        table.append(_gains(f"{condition}: share of the oracle's gain, p", pairs))
    for case in whole[0][CASES]["results"]:
        rows = [_row(found, CASES, case["name"]) for found in whole]
        table.append(_rates(f"`{case['name']}`: as expected", rows, "as_expected"))
    checkpoints = [f"`{found[SINGLE]['checkpoint'][:12]}`" for found in whole]
    return [*table, ["checkpoint", *checkpoints, ""], ["commits", *map(_commits, whole), ""]]


def _results(folder: Path, suffix: str) -> dict[str, Json] | None:
    """Return the results of one training seed by their protocol."""
    found: dict[str, Json] = {}
    for name in (SINGLE, CHOICE, HARD, CASES):
        if (result := read_if_measured(folder / f"{name}{suffix}.json")) is None:
            return None
        found[name] = result
    return found


def _row(found: dict[str, Json], protocol: str, name: str) -> Json:
    row: Json = next(row for row in found[protocol]["results"] if row["name"] == name)
    return row


def _pair(result: Json, name: str) -> Json:
    pair: Json = next(pair for pair in result["paired"] if pair["name"] == name)
    return pair


def _rates(
    name: str, rows: list[Json], field: str = "success", *, short: bool = False
) -> list[str]:
    """Return a line of rates, with their intervals unless short, and their mean."""
    rates = [row[field] for row in rows]
    means = [f"{100.0 * rate['mean']:.1f} %" for rate in rates]
    mean = f"{100.0 * fmean(rate['mean'] for rate in rates):.1f} %"
    return [name, *(means if short else map(percent, rates)), mean]


def _gains(name: str, pairs: list[Json]) -> list[str]:
    """Return a line with how much of the oracle's gain the critic has, and the mean."""
    shares = [100.0 * pair["difference"] / pair["oracle_gain"] for pair in pairs]
    cells = [
        f"{share:.0f} %, {p_value(pair['p'])}"
        for share, pair in zip(shares, pairs, strict=True)
    ]
    return [name, *cells, f"{fmean(shares):.0f} %"]


def _commits(found: dict[str, Json]) -> str:
    return ", ".join(dict.fromkeys(f"`{one['machine']['commit']}`" for one in found.values()))
