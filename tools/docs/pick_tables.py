"""Tables of the pick protocols with forms of their own: cases, calibration, SSM, pairs."""

from collections.abc import Callable, Mapping
from statistics import fmean

from tools.docs.headline import percent, share
from tools.docs.results import Json

CASES, VARIANTS = "pick-cases", "pick-case-variants"
LEAST_P = 1e-300
"""Least p-value that is printed."""
CALIBRATION, MONITORED = "risk-calibration", "pick-ssm"


def has_own_table(result: Json) -> bool:
    """Return whether a result has a table of its own form."""
    return result.get("protocol") in TABLES


def lines_of(result: Json) -> list[list[str]]:
    """Return the table of a result as lines of cells, the header first."""
    return TABLES[result["protocol"]](result["results"])


def _cases(rows: list[Json]) -> list[list[str]]:
    head = ["", "n", "as expected", "first choice", "switches", "end", "success", "nearest"]
    lines = [[*head, "each goal alone"]]
    for row in rows:
        beside: Json = row["beside"]
        alone = [
            f"`{name}` {share(rate)}" for name, rate in beside.items() if name != "nearest"
        ]
        rates = (row[key] for key in ("as_expected", "first", "switches", "end", "success"))
        lines.append(
            [
                f"`{row['name']}`",
                str(row["n"]),
                *(percent(rate) for rate in rates),
                share(beside["nearest"]),
                ", ".join(alone),
            ]
        )
    return lines


def _variants(rows: list[Json]) -> list[list[str]]:
    rates = {
        "as_expected": "as expected",
        "first": "first choice",
        "switches": "switches",
        "end": "end",
        "success": "success",
        "expected_goal_alone": "success, expected goal alone",
        "as_expected_where_possible": "as expected where that succeeds",
    }
    beside = {
        "other_goal_alone": "success, other goal alone",
        "nearest": "success, nearest",
        "nearest_as_expected": "as expected, nearest",
    }
    lines = [["", "variants", "runs", *rates.values(), *beside.values()]]
    for row in rows:
        known = (percent(row[key]) if row[key] else "" for key in rates)
        others = (share(row[key]) for key in beside)
        lines.append(
            [f"`{row['name']}`", str(row["variants"]), f"{row['runs']:,}", *known, *others]
        )
    return lines


def _calibration(rows: list[Json]) -> list[list[str]]:
    head = ["", "outcome", "predictions", "rate [%]", "mean [%]", "ECE [%]", "by chance [%]"]
    covered = "rate inside interval [bins], its width [points]"
    more = ["ECE after 200 [%]", covered, "ECE after half [%]", covered]
    head += [covered]
    lines = [[*head, "Brier", "constant", "AUC", *more, "Brier after half"]]
    for row in rows:
        for outcome in ("success", "contact"):
            one: Json = row[outcome]
            again = one["recalibrated"]
            auc = "" if one["auc"] is None else f"{one['auc']:.3f}"
            lines.append(
                [
                    f"`{row['name']}`",
                    outcome,
                    f"{row['predictions']:,}",
                    *(
                        f"{100.0 * one[key]:.1f}"
                        for key in ("rate", "mean", "ece", "ece_floor")
                    ),
                    _covered(one),
                    f"{one['brier']:.4f}",
                    f"{one['brier_constant']:.4f}",
                    auc,
                    f"{100.0 * again['few']['ece']:.1f}",
                    _covered(again["few"]),
                    f"{100.0 * again['half']['ece']:.1f}",
                    _covered(again["half"]),
                    f"{again['half']['brier']:.4f}",
                ]
            )
    return lines


def _covered(one: Json) -> str:
    """Return in how many bins the rate lies inside the mean 95 % interval, and its width."""
    bins: list[Json] = one["bins"]
    inside = [part["low"] <= part["rate"] <= part["high"] for part in bins]
    width = fmean(part["high"] - part["low"] for part in bins)
    return f"{sum(inside)} of {len(inside)}, {100.0 * width:.1f}"


def _monitored(rows: list[Json]) -> list[list[str]]:
    rates = {
        "success": "success",
        "contact_moving": "contact, robot moving",
        "contact_admissible": "contact at admissible speed",
        "contact_at_rest": "contact, robot at standstill",
        "timeout": "timeout",
    }
    head = ["", "n", *rates.values(), "time to success [s]", "time lost [s]"]
    lines = [[*head, "override 0 [% of cycles]", "mean override [%]"]]
    for row in rows:
        lines.append(
            [
                f"`{row['name']}`",
                f"{row['n']:,}",
                *(percent(row[key], 2) for key in rates),
                _mean(row["time_to_success_s"]),
                _mean(row["time_lost_s"]),
                f"{100.0 * row['stopped']:.1f}",
                f"{100.0 * row['override']:.1f}",
            ]
        )
    return lines


def _mean(value: Json | None) -> str:
    if value is None:
        return ""
    if "low" not in value:  # a single episode
        return f"{value['mean']:.2f}"
    return f"{value['mean']:.2f} ({value['low']:.2f}-{value['high']:.2f})"


TABLES: Mapping[str, Callable[[list[Json]], list[list[str]]]] = {
    CASES: _cases,
    VARIANTS: _variants,
    CALIBRATION: _calibration,
    MONITORED: _monitored,
}
"""Tables of the protocols with a form of their own."""


def more_of(result: Json) -> list[list[list[str]]]:
    """Return the further tables of a result."""
    pairs = [pairs_of(result)] if "paired" in result else []
    timed = [row for row in result["results"] if "expected_time_s" in row]
    return [*pairs, _times(timed)] if timed else pairs


def _times(rows: list[Json]) -> list[list[str]]:
    columns = {
        "time_to_success_s": "time to success [s]",
        "expected_time_s": "expected [s]",
        "time_ece_s": "difference over ten bins [s]",
        "time_error_s": "absolute error [s]",
        "time_error_constant_s": "of the mean time [s]",
    }
    cells = ([f"`{row['name']}`", *(f"{row[key]:.2f}" for key in columns)] for row in rows)
    return [["", *columns.values()], *cells]


def p_value(p: float) -> str:
    """Return a p-value with one digit; those that no number can hold are bounded."""
    return f"{p:.1g}" if p > LEAST_P else f"below {LEAST_P:g}"


def pairs_of(result: Json) -> list[list[str]]:
    """Return the paired comparisons of a result as lines of cells, the header first."""
    rows: list[Json] = result["paired"]
    lines = [["pair", "difference [points]", "only the first", "only the second", "p"]]
    for row in rows:
        lines.append(
            [
                row["name"],
                f"{100.0 * row['difference']:+.1f}",
                str(row["only_first"]),
                str(row["only_second"]),
                p_value(row["p"]),
            ]
        )
    if any("oracle_gain" in row for row in rows):
        lines[0].append("share of the oracle's gain")
        for row, line in zip(rows, lines[1:], strict=True):
            gain = row.get("oracle_gain")
            line.append(f"{100.0 * row['difference'] / gain:.0f} %" if gain else "")
    return lines
