"""Write the result tables of README, docs and model cards from ``docs/results/*.json``.

    python -m tools.docs.tables

A page contains the table of ``docs/results/NAME.json`` between ``<!-- begin NAME -->`` and
``<!-- end NAME -->``; ``NAME-directed`` is the table of its rows whose names end so. The JSON
file is the output of ``python -m app evaluate NAME --json``, of ``python -m app bench NAME
--json``, or of the script named in its ``command``. Sections of results without rows are
written by other scripts. A section without a result file is left unchanged and reported by a
test. A second test compares pages and results.
"""

import re
import sys
from collections.abc import Sequence
from pathlib import Path

from app.policies.evaluation.reach.ssm import DIRECTED
from app.policies.report.commands import command_of
from tools.arguments import parser_of
from tools.docs import headline, pick_seeds, pick_tables
from tools.docs.reach import tables as reach_tables
from tools.docs.results import ROOT, Json, read_if_measured
from tools.docs.sorting.tables import is_sorting, lines_of

BLOCK = re.compile(r"(<!-- begin ([a-z0-9_-]+) -->\n).*?(<!-- end \2 -->)", re.DOTALL)
MULTI_RESULT_TABLES = {"headline": headline.lines, "pick-seeds": pick_seeds.lines}
"""Tables of several results by their names."""
UNITS = {
    "rad_s": "rad/s",
    "m_s": "m/s",
    "mm": "mm",
    "ms": "ms",
    "us": "µs",
    "percent": "%",
    "min": "min",
    "s": "s",
    "m": "m",
}
"""Suffixes of keys and the units they denote; the first that matches counts."""
NAMES = {"brier": "Brier", "auc": "AUC", "ece": "ECE"}
"""Words of keys that are written otherwise."""


def render(text: str, results: Path) -> str:
    """Return the text of a page with its marked tables replaced.

    Args:
        text: Text of the page.
        results: Folder of the JSON files.
    """

    def block(match: re.Match[str]) -> str:
        if match[2] in MULTI_RESULT_TABLES:
            lines = MULTI_RESULT_TABLES[match[2]](results)
            return match[0] if lines is None else f"{match[1]}{_table(lines)}\n{match[3]}"
        path = results / f"{match[2].removesuffix(DIRECTED)}.json"
        found = read_if_measured(path)
        if found is None or "results" not in found:
            return match[0]
        found = reach_tables.part_of(found, directed=match[2].endswith(DIRECTED))
        others = reach_tables.siblings(path) if reach_tables.is_reach(found) else []
        return f"{match[1]}{table(found, others)}\n{match[3]}"

    return BLOCK.sub(block, text)


def table(result: Json, others: Sequence[Json] = ()) -> str:
    """Return a result as a Markdown table, followed by its line of provenance.

    Args:
        result: Output of an evaluation or a benchmark.
        others: Results of other checkpoints to add to the table.
    """
    if reach_tables.is_reach(result):
        return _markdown(reach_tables.lines_of([result, *others]), result, others)
    if is_sorting(result):
        return _markdown(lines_of(result), result)
    if pick_tables.has_own_table(result):
        lines = pick_tables.lines_of(result)
    else:
        rows: list[Json] = result["results"]
        columns = list(dict.fromkeys(key for row in rows for key in row if key != "name"))
        head = ["", *(header(key) for key in columns)]
        lines = [[f"`{row['name']}`", *(cell(row.get(key)) for key in columns)] for row in rows]
        lines.insert(0, head)
    more = (_table(one) for one in pick_tables.more_of(result))
    return "\n\n".join([_table(lines), *more, origin(result)])


def _markdown(lines: list[list[str]], result: Json, others: Sequence[Json] = ()) -> str:
    return f"{_table(lines)}\n\n{origin(result, others)}"


def _table(lines: list[list[str]]) -> str:
    head, *rest = lines
    ruled = [head, ["---", *("---:" for _ in head[1:])], *rest]
    return "\n".join("| " + " | ".join(line) + " |" for line in ruled)


def header(key: str) -> str:
    """Return a column header for a key: its words, and the unit of its suffix in brackets."""
    words = key
    for suffix, unit in UNITS.items():
        if key.endswith(f"_{suffix}"):
            words = f"{key.removesuffix(f'_{suffix}')}_[{unit}]"
            break
    return " ".join(NAMES.get(word, word) for word in words.split("_"))


def cell(value: object) -> str:
    """Return a value as text: rates in percent with interval, numbers to three digits."""
    if isinstance(value, dict):
        mean, low, high = (100.0 * value[key] for key in ("mean", "low", "high"))
        to = "-" if low >= 0.0 else " to "
        return f"{mean:.1f} % ({low:.1f}{to}{high:.1f})"
    if isinstance(value, list):
        return ", ".join(f"{100.0 * one:.1f}" for one in value)
    if isinstance(value, float):
        return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"
    return "" if value is None else str(value)


def origin(result: Json, others: Sequence[Json] = ()) -> str:
    """Return the provenance of a result: command, seed, checkpoints, machine, commit."""
    machine: Json = result["machine"]
    parts = [f"`{command_of(result)}`"]
    parts += [f"{key} {result[key]}" for key in ("episodes", "seed") if key in result]
    if "checkpoint" in result:
        parts.append(f"checkpoint `{result['checkpoint'][:12]}`")
    parts += [f"`{one['label']}`: `{one['checkpoint'][:12]}`" for one in others]
    parts += conditions(result)
    parts += [f"{machine['cores']} cores of {machine['cpu']}", f"commit `{machine['commit']}`"]
    return f"<sub>{', '.join(parts)}</sub>"


def conditions(result: Json) -> list[str]:
    """Return speeds of people, number of recordings and the outcome of the FCL recheck."""
    parts, settings = [], result.get("settings", {})
    if "hand_speed_median_m_s" in settings:
        median, p99 = settings["hand_speed_median_m_s"], settings["hand_speed_p99_m_s"]
        parts.append(f"hands {median:.2f} m/s (median), {p99:.2f} m/s (p99)")
    motions = settings.get("motions", ())
    if motions and isinstance(motions[0], dict):
        seconds = sum(one["seconds"] for one in motions)
        parts.append(f"{len(motions)} recorded runs of {seconds:.0f} s together")
    if recheck := result.get("fcl_recheck"):
        missed, poses = recheck["missed_contacts"], recheck["poses"]
        parts.append(f"FCL found {missed} missed contacts in {poses:,} poses")
    return parts


def pages() -> list[Path]:
    """Return the files with tables: README, pages of ``docs`` and model cards."""
    cards = sorted((ROOT / "app/policies").glob("**/pretrained/*.md"))
    found = [ROOT / "README.md", *sorted((ROOT / "docs").glob("**/*.md")), *cards]
    return [path for path in found if BLOCK.search(path.read_text(encoding="utf-8"))]


def main() -> None:
    """Rewrite the tables of all pages in place; print their names."""
    for path in pages():
        text = path.read_text(encoding="utf-8")
        path.write_text(render(text, ROOT / "docs" / "results"), encoding="utf-8")
        names = ", ".join(match[2] for match in BLOCK.finditer(text))
        print(f"{path.relative_to(ROOT)}: {names}", file=sys.stderr)


if __name__ == "__main__":
    parser_of(__doc__).parse_args()
    main()
