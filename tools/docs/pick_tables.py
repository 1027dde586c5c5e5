"""Tables of the pick protocols whose rows hold more than rates: cases, calibration, pairs."""

from typing import Any

from tools.docs.headline import percent, share

Json = dict[str, Any]
CASES, CALIBRATION = "pick-cases", "risk-calibration"


def has_own_table(result: Json) -> bool:
    """Return whether a result has a table of its own form."""
    return result.get("protocol") in (CASES, CALIBRATION)


def lines_of(result: Json) -> list[list[str]]:
    """Return the table of a result as lines of cells, the header first."""
    rows: list[Json] = result["results"]
    return _cases(rows) if result["protocol"] == CASES else _calibration(rows)


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


def _calibration(rows: list[Json]) -> list[list[str]]:
    head = ["", "outcome", "predictions", "rate [%]", "mean [%]", "ECE [%]", "by chance [%]"]
    more = ["recalibrated ECE [%]", "recalibrated Brier"]
    lines = [[*head, "Brier", "constant", "AUC", *more]]
    for row in rows:
        for outcome in ("success", "contact"):
            one: Json = row[outcome]
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
                    f"{one['brier']:.4f}",
                    f"{one['brier_constant']:.4f}",
                    auc,
                    f"{100.0 * one['recalibrated']['ece']:.1f}",
                    f"{one['recalibrated']['brier']:.4f}",
                ]
            )
    return lines


def pairs_of(result: Json) -> list[list[str]]:
    """Return the paired comparisons of a result as lines of cells, the header first."""
    head = ["pair", "difference [points]", "only the first", "only the second", "p"]
    lines = [[*head, "share of the oracle's gain"]]
    for row in result["paired"]:
        gain = row.get("oracle_gain")
        won = f"{100.0 * row['difference'] / gain:.0f} %" if gain else ""
        lines.append(
            [
                row["name"],
                f"{100.0 * row['difference']:+.1f}",
                str(row["only_first"]),
                str(row["only_second"]),
                f"{row['p']:.1g}",
                won,
            ]
        )
    return lines
