"""The page of the report: ``thesis.md`` with its numbers and their provenance.

A placeholder stands for a number; parts in square brackets may be left out, and ``-`` is an
empty part.

===================================================  =========================================
``{value FILE / ROW / KEY [/ UNIT]}``                number of a result file
``{curve FILE / PRESET / KEY [/ UNIT [/ TASK]]}``    last point of learning curves
``{preset PRESET / GROUP.FIELD [/ FACTOR]}``         field of a preset
``{setting PRESET / NAME}``                          number of the scenario of a preset
``{command TEXT}``                                   measures what a section lacks; own line
===================================================  =========================================
"""

import json
import re
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from app.errors import InvalidInput
from app.policies.evaluation.registry import PROTOCOLS, default_checkpoint
from app.policies.evaluation.rows import Json
from app.policies.report.commands import command_of, training_of, writing_command
from app.policies.report.numbers import curve_end, preset_value, setting, stored_value

MISSING = "not measured"
MEASURED = """Numbers from a *job*, as named below a table, were measured for this report; all
others are stored.

"""
Find = Callable[[str], Json | None]
"""Returns the result of a file, by its name without ``.json``."""
RESULTS = Path(__file__).resolve().parents[3] / "docs/results"
"""The stored results."""
TEXT = Path(__file__).with_name("thesis.md").read_text(encoding="utf-8")
"""The page with placeholders."""
TASKS = ("-e0", "-e1")
"""Ends of the names of files that state the task of a sorting policy."""
_PLACE = re.compile(r"\{(value|curve|preset|setting) ([^}]+)\}")
_COMMAND = re.compile(r"^\{command (.+)\}$", re.MULTILINE)
_OF_RESULT: dict[str, Callable[..., str | None]] = {"value": stored_value, "curve": curve_end}
_OF_CODE: dict[str, Callable[..., str]] = {"preset": preset_value, "setting": setting}


def files_of(text: str) -> set[str]:
    """Return the names of the result files of placeholders, without ``.json``."""
    found = _PLACE.findall(text)
    return {_parts(place)[0] for kind, place in found if kind in _OF_RESULT}


def evaluations() -> dict[str, tuple[str, str | None]]:
    """Return the result files that evaluations write, with protocol and checkpoint of each.

    The checkpoint is None where the protocol has no policy.
    """
    found = {}
    for file in sorted(files_of(TEXT)):
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

    Raises:
        InvalidInput: There is no such folder, or a file is not a result file.
    """
    if not results.is_dir():  # as beside an installed package, which has no documents
        raise InvalidInput("results", str(results), "must be a folder of result files")
    find = partial(_find, results, measured or {})
    head, *sections = re.split(r"^(?=##)", TEXT, flags=re.MULTILINE)
    parts, missing = [head, MEASURED if measured else ""], []
    for one in sections:
        text, absent = section(one, find)
        parts.append(text)
        missing += absent
    return "".join(parts).rstrip() + "\n", missing


def section(text: str, find: Find) -> tuple[str, list[str]]:
    """Return a section with its numbers and their sources, and the measures without a file."""
    title, absent, used = text.splitlines()[0].lstrip("# "), list[str](), dict[str, Json]()
    trained = dict[str, None]()

    def number(place: re.Match[str]) -> str:
        kind, parts = place[1], _parts(place[2])
        if kind in _OF_CODE:
            return _OF_CODE[kind](*parts)
        file, *where = parts
        found = find(file)
        value = None if found is None else _OF_RESULT[kind](found, *where)
        if found is None or value is None:
            line = text[text.rindex("\n", 0, place.start()) :]
            absent.append(f"{title}: {line.split('|')[1].strip()}")
            return MISSING
        used[file] = found
        if kind == "curve":
            trained[training_of(found, where[0], *where[3:])] = None
        return value

    written = _PLACE.sub(number, text)
    command = _COMMAND.search(written)
    sources = [*(_origin(file, found) for file, found in used.items()), *trained]
    if absent and command:
        sources.append(f"{MISSING}: `{command[1]}`")
    blocks = [_COMMAND.sub("", written).rstrip()]
    if sources:
        blocks.append(f"<sub>{'; '.join(sources)}</sub>")
    return "\n\n".join([*blocks, ""]), absent


def _parts(place: str) -> list[str]:
    """Return the parts of a placeholder."""
    return [part.strip("-") and part for part in place.split(" / ")]


def _find(results: Path, measured: Mapping[str, Json], file: str) -> Json | None:
    path = results / f"{file}.json"
    if file in measured or not path.exists():
        return measured.get(file)
    try:
        found = json.loads(path.read_bytes())
    except ValueError as error:
        raise InvalidInput("results", str(path), f"is not a result file: {error}") from error
    if not isinstance(found, dict):
        raise InvalidInput("results", str(path), "is not a result file: must be a JSON object")
    return found


def _origin(name: str, found: Json) -> str:
    """Return the provenance of a result file."""
    job = found.get("job")
    if job is None:
        parts = [f"`docs/results/{name}.json`: `{writing_command(name, found)}`"]
    else:
        parts = [f"{job}: `{command_of(found)}`"]
        parts += [f"{key} {found[key]}" for key in ("episodes", "seed") if key in found]
    if "checkpoint" in found:
        parts.append(f"checkpoint `{found['checkpoint'][:12]}`")
    machine = found["machine"]
    parts += [f"{machine['cores']} cores of {machine['cpu']}", f"commit `{machine['commit']}`"]
    return ", ".join(parts)
