"""The page of the report: a section per table or figure, with the provenance of its numbers."""

import json
from pathlib import Path
from typing import Any

from app.cli.report.both import BOTH_ITEMS
from app.cli.report.motion import MOTION_ITEMS
from app.cli.report.parts import Config, Item, StoredValue
from app.cli.report.recipes import RECIPE_ITEMS
from app.cli.report.sorting import SORTING_ITEMS

MISSING = "not measured"
ITEMS = (*SORTING_ITEMS, *MOTION_ITEMS, *BOTH_ITEMS, *RECIPE_ITEMS)
"""Tables and figures, in the order of the thesis; then all trainings."""
HEAD = """# The thesis beside Tandem

Every table and figure of the results of the [thesis](../method.md), in its order: its numbers,
those of its recipe on Tandem's simulator, and those of Tandem's best policy. `python -m app
report` writes this page from the files in `docs/results` within seconds; it measures nothing.
To measure again, run the commands that are named below a table with the files that they write.
*Not measured* means that there is no such file. Intervals are 95 %; `±` is a standard
deviation.

"""
Json = dict[str, Any]


def page(results: Path) -> tuple[str, list[str]]:
    """Return the report as Markdown, and the measures without a result file."""
    parts, missing = [HEAD], []
    chapter = ""
    for item in ITEMS:
        if item.chapter != chapter:
            chapter = item.chapter
            parts.append(f"## {chapter}\n\n")
        text, absent = section(item, results)
        parts.append(text)
        missing += [f"{item.title}: {name}" for name in absent]
    return "".join(parts).rstrip() + "\n", missing


def section(item: Item, results: Path) -> tuple[str, list[str]]:
    """Return the section of a table or figure, and the measures without a result file."""
    lines, absent, used = [f"### {item.title}", ""], [], dict[str, Json]()
    if item.measures:
        lines += ["| | thesis | its recipe here | best here |", "| --- | --- | --- | --- |"]
    for measure in item.measures:
        cells = []
        for source in (measure.recipe, measure.best):
            text = _cell(source, results, used)
            absent += [measure.name] if text == MISSING else []
            cells.append(text)
        lines.append(f"| {measure.name} | {measure.thesis} | {cells[0]} | {cells[1]} |")
    lines += [""] if item.measures else []
    lines += [f"![{text}](../img/{path})\n" for path, text in item.images]
    lines += [f"*Agreement*: {item.agreement}", ""]
    sources = [_origin(name, found) for name, found in used.items()]
    if absent and item.command:
        sources.append(f"{MISSING}: `{item.command}`")
    lines += [f"<sub>{'; '.join(sources)}</sub>", ""] if sources else []
    return "\n".join(lines) + "\n", absent


def _cell(source: StoredValue | Config | str, results: Path, used: dict[str, Json]) -> str:
    """Return a value as text; remember the file that it is from."""
    if isinstance(source, str):
        return source
    if isinstance(source, Config):
        return f"{source.value():,.10g}"
    path = results / f"{source.file}.json"
    if not path.exists():
        return MISSING
    found = json.loads(path.read_text(encoding="utf-8"))
    value = source.value(found)
    if value is None:
        return MISSING
    used[source.file] = found
    return value


def _origin(name: str, found: Json) -> str:
    """Return the provenance of a result file."""
    verb = "evaluate" if "protocol" in found else "bench"
    usual = f"python -m app {verb} {found.get('protocol') or found.get('bench')} --json"
    if found.get("settings", {}).get("cell") == "sorting-e1":
        usual += " --checkpoint sorting-e1"
    if name.startswith("thesis-"):
        usual += " --checkpoint FILE"
    parts = [f"`docs/results/{name}.json`: `{found.get('command', usual)}`"]
    parts += [f"{key} {found[key]}" for key in ("episodes", "seed") if key in found]
    if "checkpoint" in found:
        parts.append(f"checkpoint `{found['checkpoint'][:12]}`")
    machine = found["machine"]
    parts += [f"{machine['cores']} cores of {machine['cpu']}", f"commit `{machine['commit']}`"]
    return ", ".join(parts)
