"""Reader of OpenSim's tables of joint angles (``.mot``, ``.sto``) for the 18-DoF model.

Coordinates are those of the full-body models (Hamner 2010, Rajagopal 2015, LaiUhlrich2022 of
OpenCap, Pose2Sim): six of the pelvis, and trunk, shoulders and elbows under the names below.
OpenSim 4 names states by paths, ``/jointset/acromial_r/arm_flex_r/value``. Speeds, activations,
controls and multipliers are ignored.

OpenSim's x points forward, y up, z right. ``arm_flex``, ``arm_add`` and ``arm_rot`` equal the
model's shoulder angles; other shoulders are converted by rotation matrices, and so are pelvis
and lumbar rotations (to yaw and abdomen). Clavicles stay at zero. Sources: Rajagopal et al.,
"Full-body musculoskeletal model", IEEE TBME 63(10), 2016; joints ``glenohumeral_r`` and ``_l``
of ``LaiUhlrich2022_shoulder.osim``.
"""

import re
from collections.abc import Mapping, Sequence
from functools import reduce

import numpy as np
import scipy

from app.sim.core.arrays import Vec
from app.sim.mocap.bvh import axis_turns, lines_of
from app.sim.mocap.csv_tables import (
    AngleTrack,
    check_times,
    in_radians,
    require_height,
    require_pace,
    require_places,
)
from app.sim.mocap.faults import bad, shown
from app.sim.mocap.inverse_kinematics import euler_angles, one_branch
from app.sim.mocap.tables import (
    MAX_COLUMNS,
    TextTable,
    complete_rows,
    named_columns,
)

PELVIS = ("pelvis_tilt", "pelvis_list", "pelvis_rotation")
PLACES = ("pelvis_tx", "pelvis_ty", "pelvis_tz")
LUMBAR = ("lumbar_extension", "lumbar_bending", "lumbar_rotation")
LEVELS = tuple(
    tuple(f"{level}_{turn}" for turn in ("Flex_Ext", "Lat_Bending", "axial_rotation"))
    for level in ("L5_S1", "L4_L5", "L3_L4", "L2_L3", "L1_L2", "L1_T12")
)
"""Alternative: lumbar rotations by level, or at the lowest level only."""
ARMS = {hand: tuple(f"arm_{turn}_{hand}" for turn in ("flex", "add", "rot")) for hand in "rl"}
ELEVATED = {
    hand: tuple(f"sh_{turn}_{hand}" for turn in ("plane_elev", "elev", "axial_rot"))
    for hand in "rl"
}
"""Alternative: shoulders by plane of elevation, elevation and axial rotation."""
ELBOWS = {hand: f"elbow_flex_{hand}" for hand in "rl"}
COORDINATES = (
    *PELVIS,
    *LUMBAR,
    *PLACES,
    *(name for hand in "rl" for name in (*ARMS[hand], ELBOWS[hand])),
)
"""Required columns besides ``time``; others (legs, forces) are ignored."""
KNOWN = (
    "time",
    *COORDINATES,
    *(name for level in LEVELS for name in level),
    *(name for hand in "rl" for name in ELEVATED[hand]),
)
"""All columns that are read."""

_AXIAL = np.array([-0.0846, 0.0584, 0.9947])
"""Axis of the right shoulder's axial rotation in our axes (x forward, y left, z up)."""
_RATES = ("speeds", "velocities", "accelerations")


def read_opensim(text: str, names: Mapping[str, str] | None = None) -> AngleTrack:
    """Return the joint angles of a ``.mot`` or ``.sto`` file.

    Args:
        names: Name map, theirs to ours.

    Raises:
        BadRecording: The table is invalid; the faults name lines and columns.
    """
    lines = lines_of(text)
    end = next((k for k, line in enumerate(lines) if line.strip() == "endheader"), None)
    if end is None:
        rule = "has no line endheader"
        raise bad(f"line {len(lines)}", "", rule, "the file is cut off or not OpenSim's")
    head = _head(lines[:end])
    degrees = _in_degrees(head)
    rows = [(k + 1, lines[k]) for k in range(end + 1, len(lines)) if lines[k].strip()]
    if not rows:
        raise bad(f"line {len(lines)}", "", "ends after endheader", "the file is cut off")
    table = _table(rows)
    _check_counts(head, table)
    columns = _columns(table, names or {})
    sound, good, missing = complete_rows(table.values(columns))
    times = check_times(sound.pop("time"), table, good)
    places = {name: sound[name] for name in PLACES}
    require_height("pelvis_ty", places["pelvis_ty"])
    require_places(places)
    require_pace(places, times)
    turning = {name: column for name, column in sound.items() if name not in PLACES}
    angle = dict(zip(turning, in_radians(turning, degrees).T, strict=True))
    return AngleTrack(
        times=times,
        q=_onto_model({**sound, **angle}),
        pelvis_z=sound["pelvis_ty"],
        frames=np.flatnonzero(good),
        n_frames=len(good),
        missing=missing,
        names=table.foreign(columns),
    )


def coordinate(column: str) -> str:
    """Return the coordinate of a column; empty if the column is not a coordinate's value.

    Args:
        column: Name of a coordinate, or path of a state or an output.
    """
    parts = re.split(r"[/|]", column.strip("/"))
    if parts[-1] == "value" and len(parts) > 1:
        return parts[-2]
    is_joint = len(parts) == 3 and parts[0] == "jointset"
    return parts[-1] if is_joint or len(parts) == 1 else ""


def _head(lines: Sequence[str]) -> dict[str, str]:
    """Return the declarations of the head, by key in lower case.

    Raises:
        BadRecording: The file holds speeds or accelerations.
    """
    title = next((line.strip() for line in lines if line.strip()), "")
    if title.lower() in _RATES:
        hint = "take the file of coordinates, which ends with _q"
        raise bad("line 1", shown(title), "must be coordinates", hint)
    return {
        key.strip().lower(): value.strip()
        for key, _, value in (line.partition("=") for line in lines)
    }


def _in_degrees(head: Mapping[str, str]) -> bool:
    degrees = {"yes": True, "no": False}.get(head.get("indegrees", "").lower())
    if degrees is None:
        value = shown(head["indegrees"]) if "indegrees" in head else ""
        raise bad("head, inDegrees", value, "must be declared: inDegrees=yes or inDegrees=no")
    return degrees


def _table(rows: Sequence[tuple[int, str]]) -> TextTable:
    line, head = rows[0]
    separator = next((one for one in "\t," if one in head), None)
    names = named_columns(head.split(separator, MAX_COLUMNS), line)

    def split(text: str, most: int) -> list[str]:
        here = separator if separator is None or separator in text else None
        return text.split(here, most)

    return TextTable(
        names=names,
        labels=tuple(coordinate(name) for name in names),
        line=line,
        rows=rows[1:],
        split=split,
    )


def _check_counts(head: Mapping[str, str], table: TextTable) -> None:
    """Check the numbers of columns and rows against the head."""
    n_columns, n_rows = len(table.names), len(table.rows)
    if head.get("ncolumns", str(n_columns)) != str(n_columns):
        rule = f"must be the nColumns={head['ncolumns'][:20]} that the head states"
        raise bad(f"line {table.line}", f"<{n_columns} columns>", rule)
    word = head.get("nrows", head.get("datarows", str(n_rows)))
    if not word.isascii() or not word.isdigit():
        raise bad("head, nRows", shown(word), "must be a whole number")
    if (word.lstrip("0") or "0") != str(n_rows):
        rule = f"must be the {word[:20]} that the head of the file states"
        hint = "the file is cut off" if n_rows < int(word[:9]) else ""
        place = f"frames, last line {table.rows[-1][0]}" if table.rows else "frames"
        raise bad(place, f"<{n_rows}>", rule, hint)


def _columns(table: TextTable, names: Mapping[str, str]) -> dict[str, int]:
    """Return the indices of the columns, by one set of names per part of the body."""
    there = table.columns(KNOWN, names)
    lumbar = [LUMBAR] if _all(LUMBAR, there) else [one for one in LEVELS if _all(one, there)]
    shoulders = [
        next((one for one in (ARMS[h], ELEVATED[h]) if _all(one, there)), ARMS[h]) for h in "rl"
    ]
    wanted = [
        "time",
        *PELVIS,
        *PLACES,
        *(name for part in lumbar or [LUMBAR] for name in part),
        *(name for part in shoulders for name in part),
        *ELBOWS.values(),
    ]
    missing = [name for name in wanted if name not in there]
    if missing:
        hint = table.near(missing, there)
        arms = re.compile("arm|elbow|should|humer|(^|_)sh_", re.IGNORECASE)
        if not any(arms.search(label) for label in table.labels):
            hint = "a full-body model with arms is needed, such as Rajagopal's"
        raise bad(f"line {table.line}", "", f"lacks the columns {', '.join(missing)}", hint)
    return {name: there[name] for name in wanted}


def _all(part: Sequence[str], there: Mapping[str, int]) -> bool:
    return all(name in there for name in part)


def _onto_model(values: Mapping[str, Vec]) -> Vec:
    """Return joint positions [m, rad], shape (n, 18), from coordinates [m, rad]."""
    yaw, abdomen = trunk_angles(values)
    q = np.zeros((len(yaw), 18))
    q[:, 0], q[:, 1], q[:, 2] = values["pelvis_tx"], -values["pelvis_tz"], yaw
    q[:, 3:6] = abdomen
    for hand, first, side in (("r", 10, -1.0), ("l", 14, 1.0)):
        if ARMS[hand][0] in values:
            flex, add, rot = (values[name] for name in ARMS[hand])
            q[:, first : first + 3] = np.column_stack([flex, -add, -side * rot])
        else:
            q[:, first : first + 3] = _elevated(values, hand, side, first)
        q[:, first + 3] = values[ELBOWS[hand]]
    return q


def _elevated(values: Mapping[str, Vec], hand: str, side: float, first: int) -> Vec:
    """Return shoulder angles [rad], shape (n, 3), from plane of elevation, elevation, rotation.

    The left shoulder rotates about the axes of the right one, with opposite sign.
    """
    plane, elevation, axial = (-side * values[name] for name in ELEVATED[hand])
    rotation = scipy.spatial.transform.Rotation
    turns = rotation.from_euler("ZX", np.column_stack([plane, -elevation]))
    turns = turns * rotation.from_rotvec(np.outer(axial, _AXIAL))
    return one_branch(euler_angles(turns.as_matrix()) * np.array([-1.0, side, 1.0]), first)


def trunk_angles(angle: Mapping[str, Vec]) -> tuple[Vec, Vec]:
    """Return yaw [rad], shape (n,), and abdomen [rad], shape (n, 3).

    The yaw is the heading of the pelvis's forward axis; the abdomen is the remainder of pelvis
    and lumbar rotations.

    Args:
        angle: Rotations of the pelvis and of the lumbar joint or its levels, by name [rad],
            shape (n,).
    """
    joints = [one for one in (PELVIS, LUMBAR, *LEVELS) if one[0] in angle]
    turns = [_turn(*(angle[name] for name in one)) for one in joints]
    pelvis, torso = turns[0], reduce(np.matmul, turns)
    yaw = np.unwrap(np.arctan2(pelvis[:, 1, 0], pelvis[:, 0, 0]))
    return yaw, euler_angles(axis_turns(2, -yaw) @ torso)


def _turn(about_z: Vec, about_x: Vec, about_y: Vec) -> Vec:
    """Return OpenSim's ``Rz Rx Ry`` in our axes (x forward, y left, z up), shape (n, 3, 3)."""
    angles = np.column_stack([-about_z, about_x, about_y])
    return np.asarray(scipy.spatial.transform.Rotation.from_euler("YXZ", angles).as_matrix())
