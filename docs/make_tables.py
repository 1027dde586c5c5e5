"""Write the result tables of README, pages and model cards from ``docs/results/*.json``.

Between ``<!-- begin NAME -->`` and ``<!-- end NAME -->`` a page shows the table of
``docs/results/NAME.json``: what ``python -m app evaluate NAME --json`` or
``python -m app bench NAME --json`` printed, or what the script named in its ``command`` wrote.
A result without rows is not a table: its section is written by a script of its own.
``NAME-measured`` shows the rows that end so, which the table of NAME leaves out. What has no
result yet stays as it is, and a test names it. Run by ``make tables``; a test compares.
"""

import json
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from docs import reach_tables  # noqa: E402 - found by the line above
from docs.sorting_tables import is_sorting, lines_of  # noqa: E402

BLOCK = re.compile(r"(<!-- begin ([a-z0-9_-]+) -->\n).*?(<!-- end \2 -->)", re.DOTALL)
Json = dict[str, Any]


def render(readme: str, results: Path) -> str:
    """Return the README's text with every marked table written anew.

    Args:
        readme: Text of the README.
        results: Folder of the JSON files.
    """

    def block(match: re.Match[str]) -> str:
        path = results / f"{match[2].removesuffix(reach_tables.PART)}.json"
        if not path.exists():
            return match[0]
        found = json.loads(path.read_text(encoding="utf-8"))
        if "results" not in found:
            return match[0]
        found = reach_tables.part_of(found, measured=match[2].endswith(reach_tables.PART))
        others = reach_tables.siblings(path) if reach_tables.is_reach(found) else []
        return f"{match[1]}{table(found, others)}\n{match[3]}"

    return BLOCK.sub(block, readme)


def table(result: Json, others: Sequence[Json] = ()) -> str:
    """Return one result as a Markdown table with the line that says how it was measured.

    Args:
        result: What a protocol or a benchmark printed.
        others: Results of other checkpoints that belong in the same table.
    """
    if reach_tables.is_reach(result):
        return _markdown(reach_tables.lines_of([result, *others]), result, others)
    if is_sorting(result):
        return _markdown(lines_of(result), result)
    rows: list[Json] = result["results"]
    columns = list(dict.fromkeys(key for row in rows for key in row if key != "name"))
    head = ["", *(key.replace("_", " ") for key in columns)]
    lines = [[f"`{row['name']}`", *(cell(row.get(key)) for key in columns)] for row in rows]
    return _markdown([head, *lines], result)


def _markdown(lines: list[list[str]], result: Json, others: Sequence[Json] = ()) -> str:
    head, *rest = lines
    ruled = [head, ["---", *("---:" for _ in head[1:])], *rest]
    rows = ("| " + " | ".join(line) + " |" for line in ruled)
    return "\n".join([*rows, "", origin(result, others)])


def cell(value: object) -> str:
    """Return one value as text: rates in percent, with their interval; a number compactly."""
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
    """Return the line below a table: command, seed, checkpoints, machine, commit."""
    machine: Json = result["machine"]
    verb = "evaluate" if "protocol" in result else "bench"
    usual = f"python -m app {verb} {result.get('protocol') or result.get('bench')}"
    usual += " FILE ..." if result.get("settings", {}).get("motions") else ""
    if (trained := result.get("settings", {}).get("cell", "")) == "sorting-e1":
        usual += f" --checkpoint {trained}"
    parts = [f"`{result.get('command', usual)}`"]
    parts += [f"{key} {result[key]}" for key in ("episodes", "seed") if key in result]
    if "checkpoint" in result:
        parts.append(f"checkpoint `{result['checkpoint'][:12]}`")
    parts += [f"`{one['label']}`: `{one['checkpoint'][:12]}`" for one in others]
    parts += conditions(result)
    parts += [f"{machine['cores']} cores of {machine['cpu']}", f"commit `{machine['commit']}`"]
    return f"<sub>{', '.join(parts)}</sub>"


def conditions(result: Json) -> list[str]:
    """Return what a result says of its people and of the second look at contacts."""
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
    """Return the files with tables: the README, pages and model cards.

    The pages about sorting and reaching are among them once the first of their results is
    there.
    """
    cards = sorted((ROOT / "app/policies/pretrained").glob("*.md"))
    names = ["people", "people-tracker", "motions"]
    if list((ROOT / "docs/results").glob("sorting_grid_*.json")):
        names.append("sorting")
    if (ROOT / "docs/results/reach-targets.json").exists():
        names.append("reach")
    return [ROOT / "README.md", *(ROOT / f"docs/{name}.md" for name in names), *cards]


def main() -> None:
    """Rewrite the tables of all pages in place; say which there are."""
    for path in pages():
        text = path.read_text(encoding="utf-8")
        path.write_text(render(text, ROOT / "docs" / "results"), encoding="utf-8")
        names = ", ".join(match[2] for match in BLOCK.finditer(text))
        print(f"{path.relative_to(ROOT)}: {names}", file=sys.stderr)


if __name__ == "__main__":
    main()
