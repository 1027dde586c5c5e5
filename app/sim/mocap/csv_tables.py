"""Reader of joint angles in CSV files with the columns of this project.

Comments declare ``# angles = degrees`` (or ``radians``) and, without a column ``time``,
``# rate_hz = 100``. A line names the columns: the 18 of ``human.JOINT_NAMES`` in any order and,
optionally, ``time`` [s] and ``pelvis_z``, the height of the pelvis above its standing height
[m]. ``pelvis_x`` and ``pelvis_y`` are in metres.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.errors import BadRecording, digits
from app.sim.core.arrays import Vec
from app.sim.human.model import JOINT_NAMES
from app.sim.mocap.artifacts import Artifact
from app.sim.mocap.bvh import check_dt
from app.sim.mocap.csv_text import CsvText, read_csv_text
from app.sim.mocap.faults import bad, shown
from app.sim.mocap.length_units import MAX_HIGH, MAX_PACE, pace
from app.sim.mocap.tables import TextTable, complete_rows

CSV_COLUMNS = ("time", *JOINT_NAMES, "pelvis_z")
"""Columns of a CSV file."""
ANGLE_UNITS: Mapping[str, tuple[str, ...]] = {
    "degrees": ("deg", "degs", "degree", "degrees", "°"),
    "radians": ("rad", "rads", "radian", "radians"),
}
"""Units of angles, and their names in files."""
MAX_RADIANS = 8.0
"""Largest joint angle of a table in radians [rad]; larger ones indicate degrees."""
MIN_DEGREES = 3.2
"""Least maximum of a table in degrees [deg]; a lower one indicates radians."""
MAX_RISE = 0.5
"""Largest median rise of the pelvis above its standing height [m]; a larger one indicates a
height over the floor."""
SAME_RATE = 0.05
"""Relative difference of the declared rate and that of the times that counts as none."""
MAX_PLACE = 100.0
"""Largest distance of the pelvis from the origin [m]."""
SPAN_Z = (-1.2, 2.0)
"""Range of the height of the pelvis relative to standing [m]."""

_SECONDS = ("s", "sec", "second", "seconds")
_METRES = ("m", "metre", "metres", "meter", "meters")
_PLACES = ("pelvis_x", "pelvis_y", "pelvis_z")


@dataclass(frozen=True, slots=True, kw_only=True)
class AngleTrack:
    """Joint angles over time, as given in a file."""

    times: Vec
    """Increasing times [s], shape (n,)."""
    q: Vec
    """Joint positions of the 18-DoF model [m, rad], shape (n, 18)."""
    pelvis_z: Vec
    """Height of the pelvis as in the file [m], shape (n,): above that of standing (CSV), or in
    the frame of the file (OpenSim)."""
    frames: NDArray[np.int64]
    """Frame number of each row, counted from 0, shape (n,)."""
    n_frames: int
    """Number of frames in the file, with incomplete ones."""
    missing: tuple[Artifact, ...]
    """Incomplete frames, which are omitted."""
    names: Mapping[str, str]
    """Names in the file that differ from ours, by our name."""


def read_csv(text: str, names: Mapping[str, str] | None = None) -> AngleTrack:
    """Return the joint angles of a CSV file.

    Args:
        names: Name map, theirs to ours.

    Raises:
        BadRecording: The table is invalid; the faults name lines and columns.
    """
    names = names or {}
    file = read_csv_text(text, (*CSV_COLUMNS, *names))
    columns = _columns(file.table, names)
    degrees = _declared_degrees(file, columns)
    _check_units(file, columns, degrees)
    sound, good, missing = complete_rows(file.table.values(columns))
    q = np.stack([sound[name] for name in JOINT_NAMES], axis=1)
    q[:, 2:] = in_radians({name: sound[name] for name in JOINT_NAMES[2:]}, degrees)
    places = {name: sound[name] for name in _PLACES if name in sound}
    pelvis_z = places.get("pelvis_z", np.zeros(len(q)))
    _require_rise(pelvis_z)
    require_places({name: places[name] for name in ("pelvis_x", "pelvis_y")})
    times: Vec
    if "time" in sound:
        times = check_times(sound["time"], file.table, good)
        _require_rate(times, file.declared)
    else:
        times = np.asarray(_dt(file.declared.get("rate_hz")) * np.flatnonzero(good))
    require_pace(places, times)
    return AngleTrack(
        times=times,
        q=q,
        pelvis_z=pelvis_z,
        frames=np.flatnonzero(good),
        n_frames=len(good),
        missing=missing,
        names=file.table.foreign(columns),
    )


def _columns(table: TextTable, names: Mapping[str, str]) -> dict[str, int]:
    """Return the index of each column by our name; all must be known."""
    columns = table.columns(CSV_COLUMNS, names)
    place = f"line {table.line}"
    missing = [name for name in JOINT_NAMES if name not in columns]
    if missing:
        rule = f"lacks the columns {', '.join(missing)}"
        raise bad(place, "", rule, table.near(missing, columns))
    known = set(columns.values())
    strange = [name for k, name in enumerate(table.labels) if name and k not in known]
    if strange:
        optional = [name for name in CSV_COLUMNS if name not in columns]
        hint = table.near(optional, columns)
        raise bad(place, "", f"has unknown columns: {', '.join(strange)[:200]}", hint)
    return columns


def _declared_degrees(file: CsvText, columns: Mapping[str, int]) -> bool:
    """Return whether a comment or all units declare angles in degrees."""
    declared = file.declared.get("angles", "")
    stated = {file.units.get(columns[name]) for name in JOINT_NAMES[2:]}
    for unit, spellings in ANGLE_UNITS.items():
        if declared == unit or (not declared and stated <= set(spellings)):
            return unit == "degrees"
    rule = "must be declared in a comment: # angles = degrees, or # angles = radians"
    raise bad("angles", shown(declared) if declared else "", rule)


def _check_units(file: CsvText, columns: Mapping[str, int], degrees: bool) -> None:
    """Check the stated units of columns."""
    angles = ANGLE_UNITS["degrees" if degrees else "radians"]
    for name, k in columns.items():
        wanted = _SECONDS if name == "time" else _METRES if name in _PLACES else angles
        unit = file.units.get(k)
        if unit is not None and unit not in wanted:
            rule = f"is the unit that the file states; must be {wanted[0]}"
            raise bad(f"column {name}", shown(unit), rule)


def _require_rise(pelvis_z: Vec) -> None:
    """Check that the pelvis's height is in metres, and relative to standing."""
    extreme = float(max(pelvis_z.min(), pelvis_z.max(), key=abs))
    if not SPAN_Z[0] <= extreme <= SPAN_Z[1]:
        rule = f"is the height relative to standing; must be {SPAN_Z[0]:g} to {SPAN_Z[1]:g} m"
        raise _not_metres("column pelvis_z", extreme, rule)
    rise = float(np.median(pelvis_z))
    if rise > MAX_RISE:
        rule = f"is the median rise above standing; must be at most {MAX_RISE:g} m"
        hint = "looks like the height over the floor: subtract that of standing"
        raise bad("column pelvis_z", f"{rise:.4g}", rule, hint)


def _require_rate(times: Vec, declared: Mapping[str, str]) -> None:
    """Check that the times have the declared rate, if one is declared."""
    if "rate_hz" not in declared:
        return
    dt, found = _dt(declared["rate_hz"]), float(np.median(np.diff(times)))
    if abs(found - dt) > SAME_RATE * dt:
        rule = f"must be the rate of the column time, {1.0 / found:.4g} Hz"
        raise bad("rate_hz", shown(declared["rate_hz"]), rule, "delete the wrong one")


def in_radians(angles: Mapping[str, Vec], degrees: bool) -> Vec:
    """Return continuous joint angles [rad], shape (n, number of columns).

    Args:
        angles: Columns by name, in the declared unit; the yaw is not bounded. Angles may be
            wrapped to one turn.
        degrees: Whether the declared unit is degrees.

    Raises:
        BadRecording: The values fit the other unit.
    """
    turning = ("pelvis_yaw", "pelvis_rotation")
    bounded = {
        name: np.abs(column).max() for name, column in angles.items() if name not in turning
    }
    name = max(bounded, key=bounded.__getitem__)
    most = float(bounded[name])
    if not degrees and most > MAX_RADIANS:
        rule = f"must be at most {MAX_RADIANS} rad, as the file declares radians"
        hint = "looks like degrees"
    elif degrees and 0.0 < most <= MIN_DEGREES:
        rule = f"is the largest angle, and a motion in degrees exceeds {MIN_DEGREES}"
        hint = "looks like radians"
    elif degrees and most > 720.0:
        rule, hint = "must be at most 720 degrees", ""
    else:
        columns = np.stack(list(angles.values()), axis=1)
        return _continuous(np.radians(columns) if degrees else columns)
    raise bad(f"column {name}", f"{most:.4g}", rule, hint)


def _continuous(angles: Vec) -> Vec:
    """Return angles [rad] without jumps of a full turn; most keep their value, shape (n, k)."""
    path = np.unwrap(angles, axis=0)
    turns = np.median(path - angles, axis=0) / (2.0 * np.pi)
    return np.asarray(path - 2.0 * np.pi * np.round(turns))


def require_places(places: Mapping[str, Vec]) -> None:
    """Raise BadRecording if a distance from the origin exceeds ``MAX_PLACE`` [m]."""
    far = {name: float(np.abs(column).max()) for name, column in places.items()}
    for name, value in far.items():
        if value > MAX_PLACE:
            rule = f"must be at most {MAX_PLACE:g} m"
            raise _not_metres(f"column {name}", value, rule, max(far.values()))


def require_pace(places: Mapping[str, Vec], times: Vec) -> None:
    """Raise BadRecording if the pelvis is faster than a person in most frames."""
    dt = float(np.median(np.diff(times)))
    speed = pace(np.column_stack(list(places.values())), dt, 50.0)
    if speed > MAX_PACE:
        rule = f"is the median speed of the pelvis; must be at most {MAX_PACE:g} m/s"
        raise _not_metres(f"columns {', '.join(places)}", speed, rule)


def require_height(name: str, column: Vec) -> None:
    """Raise BadRecording if the median height exceeds ``MAX_HIGH``, as a child's in cm does."""
    height = float(np.median(column))
    if abs(height) > MAX_HIGH:
        rule = f"is the median height of the pelvis; must be within {MAX_HIGH:g} m of zero"
        raise _not_metres(f"column {name}", height, rule)


def _not_metres(
    place: str, value: float, rule: str, largest: float | None = None
) -> BadRecording:
    """Return the error of a length that is not in metres.

    Args:
        largest: Largest length of the same unit, which determines the unit; None: ``value``.
    """
    most = abs(value if largest is None else largest)
    unit, per_metre = ("centimetres", 100.0) if most <= 300.0 else ("millimetres", 1e3)
    hint = f"looks like {unit}: in m that is {value / per_metre:.4g}"
    return bad(place, f"{value:.4g}", rule, hint)


def check_times(times: Vec, table: TextTable, good: NDArray[np.bool_]) -> Vec:
    """Return the times of the complete rows [s], shape (n,), validated.

    Args:
        times: The same.
        table: Table with all rows.
        good: Whether each row is complete.

    Raises:
        BadRecording: They do not increase, or their interval is not that of motion capture.
    """
    dt = np.diff(times)
    stuck = np.flatnonzero(dt <= 0.0)
    if stuck.size:
        k = int(stuck[0]) + 1
        rule = f"must be later than the row before, {digits(times[k - 1])} s"
        line = table.rows[int(np.flatnonzero(good)[k])][0]
        raise bad(f"line {line}, column time", digits(times[k]), rule)
    check_dt(float(np.median(dt)), "column time, between rows")
    return times


def _dt(rate: str | None) -> float:
    """Return the time between two rows [s], from a declared rate."""
    try:
        rate_hz = float((rate or "").replace(",", "."))
    except ValueError:
        rate_hz = 0.0
    if not 0.0 < rate_hz < np.inf:
        rule = "must be declared where there is no column time: # rate_hz = 100"
        raise bad("rate_hz", shown(rate) if rate else "", rule)
    return check_dt(1.0 / rate_hz, "rate_hz, the time between rows")
