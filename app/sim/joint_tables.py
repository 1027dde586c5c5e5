"""Joint angles in tables: CSV with our own columns.

The first lines are declarations, ``# angles = degrees`` (or ``radians``) and, where there is no
column ``time``, ``# rate_hz = 100``. Then one line of column names: the 18 of
``human.JOINT_NAMES`` in any order, and, if wanted, ``time`` [s] and ``pelvis_z``, the height of
the pelvis above its height in standing [m]. ``pelvis_x`` and ``pelvis_y`` are metres.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from app.errors import BadMotion, Fault
from app.sim.bvh import check_dt, read_rows, shown
from app.sim.human import JOINT_NAMES
from app.sim.ports import Vec

MAX_COLUMNS = 400
"""Most columns of a table."""
ANGLE_UNITS = ("degrees", "radians")
MAX_RADIANS = 8.0
"""A table in radians whose joint angles exceed this is in degrees [rad]."""
MIN_DEGREES = 3.2
"""A table in degrees none of whose joint angles exceeds this is in radians [deg]."""
MAX_PLACE = 100.0
"""Farthest from the origin that a pelvis stands [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AngleTrack:
    """Joint angles over time, as a file gives them."""

    times: Vec
    """Rising [s], shape (n,)."""
    q: Vec
    """Joint positions of the 18-DoF model [m, rad], shape (n, 18)."""
    pelvis_z: Vec
    """Height of the pelvis [m], shape (n,)."""


def read_csv(text: str) -> AngleTrack:
    """Return the joint angles of a CSV file.

    Raises:
        BadMotion: It is no sound table; the faults name lines and columns.
    """
    lines = [(k, line) for k, line in enumerate(text.splitlines(), 1) if line.strip()]
    marked = [line.lstrip("# ") for _, line in lines if line.startswith("#")]
    table = [(k, line) for k, line in lines if not line.startswith("#")]
    said = {
        key.strip().lower(): value.strip().lower()
        for key, _, value in (line.partition("=") for line in marked)
    }
    if not table:
        raise _bad("file", "", "holds no table")
    if said.get("angles") not in ANGLE_UNITS:
        value = shown(said["angles"]) if "angles" in said else ""
        rule = "must be declared in the first line: # angles = degrees, or # angles = radians"
        raise _bad("angles", value, rule)
    (line, head), *rows = table
    names = check_columns([name.strip() for name in head.split(",")], line)
    missing = [name for name in JOINT_NAMES if name not in names]
    if missing:
        raise _bad(f"line {line}", "", f"lacks the columns {', '.join(missing)}")
    strange = [name for name in names if name not in (*JOINT_NAMES, "time", "pelvis_z")]
    if strange:
        known = f"known are time, pelvis_z, {', '.join(JOINT_NAMES)}"
        raise _bad(
            f"line {line}", "", f"has unknown columns: {', '.join(strange)[:200]}", known
        )
    values = read_rows(rows, len(names), None, "one per column", ",")
    columns = dict(zip(names, values.T, strict=True))
    q = np.stack([columns[name] for name in JOINT_NAMES], axis=1)
    q[:, 2:] = in_radians(
        {name: columns[name] for name in JOINT_NAMES[2:]}, said["angles"] == "degrees"
    )
    require_places({name: columns[name] for name in ("pelvis_x", "pelvis_y")})
    times = _times(columns, said.get("rate_hz"), len(q), rows)
    pelvis_z = columns.get("pelvis_z", np.zeros(len(q)))
    require_places({"pelvis_z": pelvis_z}, most=2.0)
    return AngleTrack(times=times, q=q, pelvis_z=pelvis_z)


def check_columns(names: Sequence[str], line: int) -> list[str]:
    """Return the names of the columns.

    Raises:
        BadMotion: Too many, unnamed or twice the same.
    """
    if len(names) > MAX_COLUMNS:
        raise _bad(f"line {line}", f"<{len(names)} columns>", f"must be at most {MAX_COLUMNS}")
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise _bad(f"line {line}", shown(twice[0]), "is the name of two columns")
    return list(names)


def in_radians(angles: Mapping[str, Vec], degrees: bool) -> Vec:
    """Return joint angles [rad], shape (n, number of columns).

    Args:
        angles: Columns by name, in the declared unit; the yaw may turn round and round.
        degrees: The declared unit.

    Raises:
        BadMotion: The numbers fit the other unit.
    """
    turning = ("pelvis_yaw", "pelvis_rotation")
    largest = {
        name: float(np.abs(column).max())
        for name, column in angles.items()
        if name not in turning
    }
    name = max(largest, key=largest.__getitem__)
    most = largest[name]
    if not degrees and most > MAX_RADIANS:
        rule = f"must be at most {MAX_RADIANS} rad, as the file declares radians"
        raise _bad(f"column {name}", f"{most:.4g}", rule, "looks like degrees")
    if degrees and 0.0 < most <= MIN_DEGREES:
        rule = f"is the largest angle, and a motion in degrees exceeds {MIN_DEGREES}"
        raise _bad(f"column {name}", f"{most:.4g}", rule, "looks like radians")
    if degrees and most > 720.0:
        rule = "must be at most 720 degrees"
        raise _bad(f"column {name}", f"{most:.4g}", rule)
    columns = np.stack(list(angles.values()), axis=1)
    return np.radians(columns) if degrees else columns


def require_places(places: Mapping[str, Vec], most: float = MAX_PLACE) -> None:
    """Refuse positions that are no metres.

    Raises:
        BadMotion: One lies farther than ``most`` [m] from the origin.
    """
    for name, column in places.items():
        far = float(np.abs(column).max())
        if far > most:
            hint = f"looks like millimetres: in m that is {far / 1000.0:.4g}"
            rule = f"must be at most {most:g} m"
            raise _bad(f"column {name}", f"{far:.4g}", rule, hint if far > 100.0 else "")


def check_times(times: Vec, lines: Sequence[tuple[int, str]]) -> Vec:
    """Return a column of times [s].

    Args:
        times: Shape (n,).
        lines: Line numbers and texts of the rows.

    Raises:
        BadMotion: They do not rise, or at no rate of motion capture.
    """
    dt = np.diff(times)
    stuck = np.flatnonzero(dt <= 0.0)
    if stuck.size:
        k = int(stuck[0]) + 1
        rule = f"must be later than the row before, {times[k - 1]:g} s"
        raise _bad(f"line {lines[k][0]}, column time", f"{times[k]:g}", rule)
    check_dt(float(np.median(dt)), "column time, between rows")
    return times


def _times(
    columns: Mapping[str, Vec], rate: str | None, n: int, rows: Sequence[tuple[int, str]]
) -> Vec:
    if "time" in columns:
        return check_times(columns["time"], rows)
    try:
        rate_hz = float(rate or "")
    except ValueError:
        rate_hz = 0.0
    if not 0.0 < rate_hz < np.inf:
        rule = "must be declared where there is no column time: # rate_hz = 100"
        raise _bad("rate_hz", shown(rate) if rate else "", rule)
    return np.asarray(check_dt(1.0 / rate_hz, "rate_hz, the time between rows") * np.arange(n))


def _bad(place: str, value: str, rule: str, hint: str = "") -> BadMotion:
    return BadMotion([Fault(place=place, value=value, rule=rule, hint=hint)])
