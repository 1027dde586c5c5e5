"""The verb ``motions`` of the command line: import a file of recorded human motion.

Returns what is to be printed; the entry point prints it.
"""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from app.errors import BadMotion, Fault, InvalidInput
from app.sim.glitches import Glitch
from app.sim.motions import MAX_BYTES, ImportedMotion, Spread, read_motion

Printed = tuple[str, dict[str, Any]]
"""Text for people, and the same as data."""
MAX_LINES = 12
"""Most glitches, and most runs, that are told to people; the data has all."""


def import_motion(path: Path) -> Printed:
    """Read a file and tell what is in it.

    Raises:
        BadMotion: It is no sound motion; carries every fault.
        InvalidInput: The file cannot be read.
    """
    try:
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise InvalidInput("FILE", str(path), f"cannot be read: {error.strerror}") from error
    found = read_motion(content, path.name)
    return _told(found), _data(found)


def _told(found: ImportedMotion) -> str:
    lengths = ", ".join(
        f"{name.replace('_', ' ')} {1000.0 * length:.0f}"
        for name, length in found.size.lengths().items()
    )
    lines = [
        f"{found.name}: {found.n_frames} frames, {found.duration:.2f} s, "
        f"{found.format} in {found.unit}",
        f"body [mm]: {lengths}",
        "error [mm]                           p50     p99   worst",
        _row("wrists", found.wrists),
        _row("elbows", found.elbows),
        _row("pelvis", found.pelvis),
        _row("wrists, pelvis at one height", found.wrists_at_fixed_height),
        _row("wrists of the simulator's body", found.fixed_body),
        f"{len(found.glitches)} glitches",
        *_short([_glitch(one) for one in found.glitches]),
        f"{len(found.runs)} clean runs, {found.n_clean} frames",
        *_short([_run(k, found) for k in range(len(found.runs))]),
    ]
    for name, (share, farthest) in found.beyond_limits.items():
        text = f"{name} beyond its limits in {100.0 * share:.1f} % of the frames"
        lines.append(f"{text}, by {farthest:.2f} rad at most")
    return "\n".join(lines)


def _data(found: ImportedMotion) -> dict[str, Any]:
    return {
        "ok": True,
        "name": found.name,
        "format": found.format,
        "unit": found.unit,
        "frames": found.n_frames,
        "duration_s": found.duration,
        "body_m": found.size.lengths(),
        "error_mm": {
            "wrists": _mm(found.wrists),
            "elbows": _mm(found.elbows),
            "pelvis": _mm(found.pelvis),
            "wrists_at_fixed_height": _mm(found.wrists_at_fixed_height),
            "fixed_body": _mm(found.fixed_body),
        },
        "glitches": [asdict(one) for one in found.glitches],
        "clean_runs": [
            {
                "first": run.first_frame,
                "last": run.first_frame + len(run.times) - 1,
                "duration_s": float(run.times[-1]),
            }
            for run in found.runs
        ],
        "clean_frames": found.n_clean,
        "beyond_limits": {
            name: {"share": share, "farthest_rad": farthest}
            for name, (share, farthest) in found.beyond_limits.items()
        },
    }


def faulty(error: BadMotion) -> dict[str, Any]:
    """Return a bad file's faults as data."""
    faults: tuple[Fault, ...] = error.faults
    return {"ok": False, "faults": [asdict(one) for one in faults]}


def _row(what: str, spread: Spread) -> str:
    numbers = (f"{1000.0 * one:8.2f}" for one in (spread.p50, spread.p99, spread.worst))
    return f"  {what:30}{''.join(numbers)}"


def _mm(spread: Spread) -> dict[str, float]:
    return {name: 1000.0 * value for name, value in asdict(spread).items()}


def _glitch(one: Glitch) -> str:
    also = f" (also {', '.join(one.parts[1:])})" if len(one.parts) > 1 else ""
    return f"  frames {one.first} to {one.last}: {one.reason}{also}"


def _run(k: int, found: ImportedMotion) -> str:
    run = found.runs[k]
    last = run.first_frame + len(run.times) - 1
    return f"  frames {run.first_frame} to {last}: {run.times[-1]:.2f} s"


def _short(lines: list[str]) -> list[str]:
    if len(lines) <= MAX_LINES:
        return lines
    return [*lines[:MAX_LINES], f"  and {len(lines) - MAX_LINES} more (--json has all)"]
