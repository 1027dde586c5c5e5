"""The page of the report: a section per table or figure, with the provenance of its numbers."""

import json
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from app.policies.evaluation.registry import PROTOCOLS, default_checkpoint
from app.policies.report.both import BOTH_ITEMS
from app.policies.report.motion import MOTION_ITEMS
from app.policies.report.parts import Config, Item, StoredValue
from app.policies.report.recipes import RECIPE_ITEMS
from app.policies.report.sorting import SORTING_ITEMS

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
MEASURED = """Numbers from a *job*, as named below a table, were measured for this report; all
others are stored.

"""
Json = dict[str, Any]
Find = Callable[[str], Json | None]
"""Returns the result of a file, by its name without ``.json``."""
RESULTS = Path(__file__).resolve().parents[3] / "docs/results"
"""The stored results."""
TASKS = ("-e0", "-e1")
"""Ends of the names of files that state the task of a sorting policy."""


def evaluations() -> dict[str, tuple[str, str]]:
    """Return the result files that evaluations write, with protocol and checkpoint of each."""
    sources = [
        one for item in ITEMS for line in item.measures for one in (line.recipe, line.best)
    ]
    files = {one.file for one in sources if isinstance(one, StoredValue)}
    found = {}
    for file in sorted(files):
        protocol = next((file[:-3] for end in TASKS if file.endswith(end)), file)
        if protocol in PROTOCOLS:
            own = default_checkpoint(protocol)
            found[file] = protocol, own if protocol == file else f"sorting{file[-3:]}"
    return found


def page(results: Path, measured: Mapping[str, Json] | None = None) -> tuple[str, list[str]]:
    """Return the report as Markdown, and the measures without a result file.

    Args:
        results: Folder of the result files.
        measured: Results in place of files, by the name of the file without ``.json``.
    """
    find = partial(_find, results, measured or {})
    parts, missing = [HEAD, MEASURED if measured else ""], []
    chapter = ""
    for item in ITEMS:
        if item.chapter != chapter:
            chapter = item.chapter
            parts.append(f"## {chapter}\n\n")
        text, absent = section(item, find)
        parts.append(text)
        missing += [f"{item.title}: {name}" for name in absent]
    return "".join(parts).rstrip() + "\n", missing


def section(item: Item, find: Find) -> tuple[str, list[str]]:
    """Return the section of a table or figure, and the measures without a result file."""
    lines, absent, used = [f"### {item.title}", ""], [], dict[str, Json]()
    if item.measures:
        lines += ["| | thesis | its recipe here | best here |", "| --- | --- | --- | --- |"]
    for measure in item.measures:
        cells = []
        for source in (measure.recipe, measure.best):
            text = _cell(source, find, used)
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


def _find(results: Path, measured: Mapping[str, Json], file: str) -> Json | None:
    path = results / f"{file}.json"
    if file in measured or not path.exists():
        return measured.get(file)
    found: Json = json.loads(path.read_text(encoding="utf-8"))
    return found


def _cell(source: StoredValue | Config | str, find: Find, used: dict[str, Json]) -> str:
    """Return a value as text; remember the file that it is from."""
    if isinstance(source, str):
        return source
    if isinstance(source, Config):
        return f"{source.value():,.10g}"
    found = find(source.file)
    value = None if found is None else source.value(found)
    if found is None or value is None:
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
    place = found.get("job") or f"`docs/results/{name}.json`"
    parts = [f"{place}: `{found.get('command', usual)}`"]
    parts += [f"{key} {found[key]}" for key in ("episodes", "seed") if key in found]
    if "checkpoint" in found:
        parts.append(f"checkpoint `{found['checkpoint'][:12]}`")
    machine = found["machine"]
    parts += [f"{machine['cores']} cores of {machine['cpu']}", f"commit `{machine['commit']}`"]
    return ", ".join(parts)
