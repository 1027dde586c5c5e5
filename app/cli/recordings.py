"""The command group ``recordings``: import, list, show and remove recorded human motion."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli.cells import file_content
from app.cli.options import Json, Map, RootUnit, Unit, Up, prepared_settings, read_options
from app.cli.output import every_fault_printed, print_result
from app.errors import BadRecording, Fault, InvalidInput

if TYPE_CHECKING:
    from app.sim.mocap.importer import Motion
    from app.sim.mocap.read_options import ReadOptions
    from app.store.records import StoredRecording

app = typer.Typer(help="Import, list, show or remove recorded human motion.")
Name = Annotated[str, typer.Argument(show_default=False)]
NOUN = "stored recording"
MAX_LINES = 12
"""Longest list of artefacts, and of runs, that is printed as text; JSON has all."""


@app.command("import")
def import_recording(
    file: Annotated[Path, typer.Argument(help=".bvh, .mot, .sto or .csv", show_default=False)],
    keep: Annotated[bool, typer.Option("--keep", help="Store the recording.")] = False,
    name: Annotated[
        str | None, typer.Option(help="Name to store it under; the file's by default.")
    ] = None,
    unit: Unit = None,
    root_unit: RootUnit = None,
    up: Up = None,
    names: Map = None,
    as_json: Json = False,
) -> None:
    """Read a file and print its content, errors and clean runs."""
    if name is not None and not keep:
        raise InvalidInput("--name", name, "is the name of a recording to store: add --keep")
    settings = prepared_settings()
    from app.cli.database import opened
    from app.sim.mocap.importer import MAX_BYTES, read_motion
    from jobs.recording_catalog import RecordingCatalog
    from jobs.recording_format import detail_of, summary_of

    with every_fault_printed(f"{file}: ", as_json=as_json):
        options = read_options(unit, root_unit, up, names)
        content = file_content(file, MAX_BYTES)
        if keep:
            with opened(settings, NOUN, create=True) as store:
                record, new = RecordingCatalog(store).add(content, file.name, name, options)
            data = {**_data(record), "new": new}
            stored = "stored" if new else "already stored"
            text = f"{_description(data)}\n{stored} as {record.name}"
        else:
            found = read_motion(content, file.name, options)
            data = {
                "ok": True,
                "name": found.name,
                "frames": found.n_frames,
                "duration_s": found.duration,
                **summary_of(found),
                **detail_of(found),
            }
            text = _description(data)
    print_result(text, data, as_json=as_json)


@app.command("list")
def list_recordings(as_json: Json = False) -> None:
    """List the stored recordings."""
    settings = prepared_settings()
    from app.cli.database import has_database, opened
    from jobs.recording_catalog import RecordingCatalog

    found: tuple[StoredRecording, ...] = ()
    if has_database(settings):
        with opened(settings, NOUN) as store:
            found = RecordingCatalog(store).all()
    lines = [
        f"{one.name:24} {one.duration:8.2f} s, clean runs: {one.n_runs}, wrists p99 "
        f"{one.summary['error_mm']['wrists']['p99']:.2f} mm"
        for one in found
    ]
    data = {"recordings": [_data(one) for one in found]}
    print_result("\n".join(lines) or "no recording is stored", data, as_json=as_json)


@app.command()
def show(name: Name, as_json: Json = False) -> None:
    """Print the content, errors and clean runs of a stored recording."""
    settings = prepared_settings()
    from app.cli.database import opened
    from jobs.recording_catalog import RecordingCatalog

    with opened(settings, NOUN) as store:
        record, _ = RecordingCatalog(store).with_runs(name)
    data = _data(record)
    print_result(_description(data), data, as_json=as_json)


@app.command()
def remove(name: Name, as_json: Json = False) -> None:
    """Remove a stored recording."""
    settings = prepared_settings()
    from app.cli.database import opened
    from jobs.recording_catalog import RecordingCatalog

    with opened(settings, NOUN) as store:
        RecordingCatalog(store).remove(name)
    print_result(f"{name} is removed", {"name": name, "removed": True}, as_json=as_json)


def clean_runs(
    paths: Sequence[Path], options: "ReadOptions | None" = None
) -> tuple["Motion", ...]:
    """Return the clean runs of files, named by file (and folder, where two names are alike).

    Args:
        options: How all of them are read; found from each file by default.

    Raises:
        BadRecording: A file is unsound; carries every fault of every file, with its path.
        InvalidInput: A file cannot be read.
    """
    from app.sim.mocap.importer import MAX_BYTES, read_motion
    from app.sim.mocap.read_options import NOTHING_STATED

    alike = len({path.stem for path in paths}) < len(paths)
    runs: list[Motion] = []
    faults: list[Fault] = []
    for path in paths:
        name = f"{path.parent.name}-{path.stem}" if alike else path.stem
        content = file_content(path, MAX_BYTES)
        try:
            found = read_motion(content, path.name, options or NOTHING_STATED)
        except BadRecording as error:
            faults += [replace(one, place=f"{path}: {one.place}") for one in error.faults]
            continue
        runs.extend(replace(run, name=name) for run in found.runs)
    if faults:
        raise BadRecording(faults)
    return tuple(runs)


def _data(record: "StoredRecording") -> dict[str, Any]:
    detail = record.detail or {}
    return {
        "ok": True,
        "name": record.name,
        "file_name": record.file_name,
        "sha256": record.sha256,
        "frames": record.n_frames,
        "duration_s": record.duration,
        "n_runs": record.n_runs,
        **record.summary,
        **{part: detail[part] for part in ("artifacts", "clean_runs") if part in detail},
    }


def _description(found: Mapping[str, Any]) -> str:
    lengths = ", ".join(
        f"{name.replace('_', ' ')} {1000.0 * length:.0f}"
        for name, length in found["body_m"].items()
    )
    error = found["error_mm"]
    lines = [
        f"{found['name']}: {found['frames']} frames, {found['duration_s']:.2f} s, "
        f"{found['format']} in {found['unit']}",
        *_reading(found.get("reading")),
        f"body [mm]: {lengths}",
        "error [mm]                           p50     p99   worst",
        _row("wrists", error["wrists"]),
        _row("elbows", error["elbows"]),
        _row("pelvis", error["pelvis"]),
        _row("wrists, constant pelvis height", error["wrists_at_fixed_height"]),
        _row("wrists, simulator's body", error["fixed_body"]),
        f"artefacts: {found['n_artifacts']}",
        *_first_lines([_artifact(one) for one in found["artifacts"]]),
        f"clean runs: {len(found['clean_runs'])}, {found['clean_frames']} frames",
        *_first_lines([_run(one) for one in found["clean_runs"]]),
    ]
    for name, beyond in found["beyond_limits"].items():
        text = f"{name} beyond its limits in {100.0 * beyond['share']:.1f} % of the frames"
        lines.append(f"{text}, by {beyond['farthest_rad']:.2f} rad at most")
    return "\n".join(lines)


def _reading(reading: Mapping[str, Any] | None) -> list[str]:
    """Return how the file was read; no lines for a recording of an older version."""
    if reading is None:
        return []
    words = [f"{reading['up']} up", f"{reading['rate_hz']:.4g} frames/s"]
    if reading["root_unit"] != reading["unit"]:
        words.append(f"root's path in {reading['root_unit']}")
    if reading["stature"] is not None:
        words.append(f"{reading['stature']:.2f} m tall")
    lines = [f"read as: {', '.join(words)}"]
    if reading["names"]:
        names = ", ".join(f"{ours} = {theirs}" for ours, theirs in reading["names"].items())
        lines.append(f"names: {names}")
    return [*lines, *reading["notes"]]


def _row(name: str, spread: Mapping[str, float]) -> str:
    numbers = (f"{spread[key]:8.2f}" for key in ("p50", "p99", "worst"))
    return f"  {name:30}{''.join(numbers)}"


def _artifact(one: Mapping[str, Any]) -> str:
    parts = one["parts"]
    also = f" (also {', '.join(parts[1:])})" if len(parts) > 1 else ""
    return f"  frames {one['first']} to {one['last']}: {one['reason']}{also}"


def _run(one: Mapping[str, Any]) -> str:
    return f"  frames {one['first']} to {one['last']}: {one['duration_s']:.2f} s"


def _first_lines(lines: list[str]) -> list[str]:
    if len(lines) <= MAX_LINES:
        return lines
    return [*lines[:MAX_LINES], f"  and {len(lines) - MAX_LINES} more (--json has all)"]
