"""The verb ``motions`` of the command line: import, list, show and remove human motions.

Each function returns what is to be printed; the entry point prints it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from app.database import has_database, opened
from app.errors import BadMotion, Fault, InvalidInput
from app.settings import Settings
from app.sim.mocap.importer import MAX_BYTES, Motion, read_motion
from app.sim.mocap.read_options import NOTHING_STATED, ReadOptions
from app.store.records import MotionRecord
from jobs.motions import MotionCatalog
from jobs.stored_motion import detail_of, summary_of

Printed = tuple[str, dict[str, Any]]
"""Text for people, and the same as data."""
MAX_LINES = 12
"""Most artifacts, and most runs, that are told to people; the data has all."""
_FLAGS = {"unit": "--unit", "root_unit": "--root-unit", "up": "--up", "names": "--map"}
NOUN = "stored motion"


def run(
    action: str,
    target: str | None,
    settings: Settings,
    *,
    keep: bool = False,
    name: str | None = None,
    options: ReadOptions = NOTHING_STATED,
) -> Printed:
    """Carry out one action.

    Args:
        action: ``import``, ``list``, ``show`` or ``remove``.
        target: A file (``import``) or a motion's name (``show``, ``remove``).
        settings: Where the database is.
        keep: Whether an imported motion is stored.
        name: Name under which; made from the file's name if None.
        options: What is stated about the file that is imported.

    Raises:
        BadMotion: The file is no sound motion; carries every fault.
        ServiceError: It cannot be done.
    """
    if name is not None and not keep:
        raise InvalidInput("--name", name, "is the name of a motion that is kept: add --keep")
    if keep and action != "import":
        raise InvalidInput("--keep", action, "goes with import only")
    if options.stated() and action != "import":
        flag = _FLAGS[min(options.stated())]
        raise InvalidInput(flag, action, "goes with import only")
    if action == "list":
        return _listed(settings)
    if target is None:
        noun = "FILE" if action == "import" else "NAME"
        raise InvalidInput(noun, None, f"must be given: motions {action} {noun}")
    if action == "import":
        path = Path(target)
        if keep:
            return keep_motion(path, settings, name, options)
        return import_motion(path, options)
    with opened(settings, NOUN) as store:
        motions = MotionCatalog(store)
        if action == "show":
            data = _data_of(motions.record(target))
            return _told(data), data
        motions.remove(target)
    return f"{target} is removed", {"name": target, "removed": True}


def import_motion(path: Path, options: ReadOptions = NOTHING_STATED) -> Printed:
    """Read a file and tell what is in it.

    Raises:
        BadMotion: It is no sound motion; carries every fault.
        InvalidInput: The file cannot be read.
    """
    found = read_motion(_content(path), path.name, options)
    data = {
        "ok": True,
        "name": found.name,
        "frames": found.n_frames,
        "duration_s": found.duration,
        **summary_of(found),
        **detail_of(found),
    }
    return _told(data), data


def keep_motion(
    path: Path,
    settings: Settings,
    name: str | None,
    options: ReadOptions = NOTHING_STATED,
) -> Printed:
    """Read a file, store its motion and tell what is in it.

    Raises:
        BadMotion: It is no sound motion; carries every fault.
        InvalidInput: The file cannot be read, or the name is none.
        Conflict: Another file has that name, or there are too many motions.
    """
    content = _content(path)
    with opened(settings, NOUN, create=True) as store:
        record, new = MotionCatalog(store).add(content, path.name, name, options)
    data = {**_data_of(record), "new": new}
    stored = "is stored" if new else "was stored already"
    return f"{_told(data)}\n{stored} as {record.name}", data


def runs_of(paths: Sequence[Path], options: ReadOptions = NOTHING_STATED) -> tuple[Motion, ...]:
    """Return the clean runs of files; where two have one name, all are named by folder too.

    Args:
        paths: The files.
        options: What is stated about all of them.

    Raises:
        BadMotion: Some are no sound motion; carries every fault of every file, with its path.
        InvalidInput: One cannot be read.
    """
    alike = len({path.stem for path in paths}) < len(paths)
    runs: list[Motion] = []
    faults: list[Fault] = []
    for path in paths:
        name = f"{path.parent.name}-{path.stem}" if alike else path.stem
        try:
            found = read_motion(_content(path), path.name, options)
        except BadMotion as error:
            faults += [replace(one, place=f"{path}: {one.place}") for one in error.faults]
            continue
        runs.extend(replace(run, name=name) for run in found.runs)
    if faults:
        raise BadMotion(faults)
    return tuple(runs)


def _content(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(MAX_BYTES + 1)
    except OSError as error:
        raise InvalidInput("FILE", str(path), f"cannot be read: {error.strerror}") from error


def _listed(settings: Settings) -> Printed:
    found: tuple[MotionRecord, ...] = ()
    if has_database(settings):
        with opened(settings, NOUN) as store:
            found = MotionCatalog(store).all()
    lines = [
        f"{one.name:24} {one.duration:8.2f} s, {one.n_runs} clean runs, wrists p99 "
        f"{one.summary['error_mm']['wrists']['p99']:.2f} mm"
        for one in found
    ]
    data = {"motions": [_data_of(one) for one in found]}
    return "\n".join(lines) or "no motion is stored", data


def _data_of(record: MotionRecord) -> dict[str, Any]:
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


def _told(found: Mapping[str, Any]) -> str:
    """Write what an import found, from its data."""
    lengths = ", ".join(
        f"{name.replace('_', ' ')} {1000.0 * length:.0f}"
        for name, length in found["body_m"].items()
    )
    error = found["error_mm"]
    runs, artifacts = found["clean_runs"], found["artifacts"]
    lines = [
        f"{found['name']}: {found['frames']} frames, {found['duration_s']:.2f} s, "
        f"{found['format']} in {found['unit']}",
        *_reading(found.get("reading")),
        f"body [mm]: {lengths}",
        "error [mm]                           p50     p99   worst",
        _row("wrists", error["wrists"]),
        _row("elbows", error["elbows"]),
        _row("pelvis", error["pelvis"]),
        _row("wrists, pelvis at one height", error["wrists_at_fixed_height"]),
        _row("wrists of the simulator's body", error["fixed_body"]),
        f"{found['n_artifacts']} artifacts",
        *_short([_artifact(one) for one in artifacts]),
        f"{len(runs)} clean runs, {found['clean_frames']} frames",
        *_short([_run(one) for one in runs]),
    ]
    for name, beyond in found["beyond_limits"].items():
        text = f"{name} beyond its limits in {100.0 * beyond['share']:.1f} % of the frames"
        lines.append(f"{text}, by {beyond['farthest_rad']:.2f} rad at most")
    return "\n".join(lines)


def _reading(reading: Mapping[str, Any] | None) -> list[str]:
    """Write how a file was read; nothing where an older version read it."""
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


def faulty(error: BadMotion) -> dict[str, Any]:
    """Return a bad file's faults as data."""
    faults: tuple[Fault, ...] = error.faults
    return {"ok": False, "faults": [asdict(one) for one in faults]}


def _row(what: str, spread: Mapping[str, float]) -> str:
    numbers = (f"{spread[key]:8.2f}" for key in ("p50", "p99", "worst"))
    return f"  {what:30}{''.join(numbers)}"


def _artifact(one: Mapping[str, Any]) -> str:
    parts = one["parts"]
    also = f" (also {', '.join(parts[1:])})" if len(parts) > 1 else ""
    return f"  frames {one['first']} to {one['last']}: {one['reason']}{also}"


def _run(one: Mapping[str, Any]) -> str:
    return f"  frames {one['first']} to {one['last']}: {one['duration_s']:.2f} s"


def _short(lines: list[str]) -> list[str]:
    if len(lines) <= MAX_LINES:
        return lines
    return [*lines[:MAX_LINES], f"  and {len(lines) - MAX_LINES} more (--json has all)"]
