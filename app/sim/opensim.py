"""Reading OpenSim's tables of joint angles (``.mot``, ``.sto``) onto the 18-DoF model.

Coordinates are those of the full-body models (Hamner 2010, Rajagopal 2015): ``pelvis_tilt``,
``pelvis_list``, ``pelvis_rotation``, ``pelvis_tx``, ``_ty``, ``_tz``, ``lumbar_extension``,
``lumbar_bending``, ``lumbar_rotation``, and per arm ``arm_flex``, ``arm_add``, ``arm_rot``,
``elbow_flex``. OpenSim's x points forward, y up, z right. Our shoulder turns in the same order
about the same axes, so its angles go over one to one; pelvis and lumbar rotations are composed
and taken apart again into yaw and abdomen. Those models have no clavicles: they stay at zero.
Source: Rajagopal et al., "Full-body musculoskeletal model", IEEE TBME 63(10), 2016.
"""

from collections.abc import Mapping

import numpy as np

from app.errors import BadMotion, Fault
from app.sim.bvh import axis_turns, read_rows, shown
from app.sim.joint_tables import (
    AngleTrack,
    check_columns,
    check_times,
    in_radians,
    require_places,
)
from app.sim.ports import Vec
from app.sim.track_angles import euler_angles

_TRUNK = (
    "pelvis_tilt",
    "pelvis_list",
    "pelvis_rotation",
    "lumbar_extension",
    "lumbar_bending",
    "lumbar_rotation",
)
_ARMS = tuple(
    f"{name}_{hand}"
    for hand in ("r", "l")
    for name in ("arm_flex", "arm_add", "arm_rot", "elbow_flex")
)
_PLACES = ("pelvis_tx", "pelvis_ty", "pelvis_tz")
COORDINATES = (*_TRUNK, *_PLACES, *_ARMS)
"""Columns that must be there, besides ``time``; others (legs, forces) are not read."""


def read_opensim(text: str) -> AngleTrack:
    """Return the joint angles of a ``.mot`` or ``.sto`` file.

    Raises:
        BadMotion: It is no sound table of those coordinates; the faults name lines, columns.
    """
    lines = text.splitlines()
    end = next((k for k, line in enumerate(lines) if line.strip() == "endheader"), None)
    if end is None:
        rule = "has no line endheader"
        raise _bad(f"line {len(lines)}", "", rule, "the file is cut off or not OpenSim's")
    said = {
        key.strip().lower(): value.strip()
        for key, _, value in (line.partition("=") for line in lines[:end])
    }
    degrees = {"yes": True, "no": False}.get(said.get("indegrees", "").lower())
    if degrees is None:
        value = shown(said["indegrees"]) if "indegrees" in said else ""
        raise _bad("head, inDegrees", value, "must be declared: inDegrees=yes or inDegrees=no")
    table = [(k + 1, lines[k]) for k in range(end + 1, len(lines)) if lines[k].strip()]
    if not table:
        raise _bad(f"line {len(lines)}", "", "ends after endheader", "the file is cut off")
    names = check_columns(table[0][1].split(), table[0][0])
    missing = [name for name in ("time", *COORDINATES) if name not in names]
    if missing:
        hint = "a full-body model with arms is needed, such as Rajagopal's"
        raise _bad(f"line {table[0][0]}", "", f"lacks the columns {', '.join(missing)}", hint)
    _check_count(said, "ncolumns", len(names), f"line {table[0][0]}")
    values = read_rows(table[1:], len(names), _promised_rows(said), "one per column")
    columns = dict(zip(names, values.T, strict=True))
    times = check_times(columns["time"], table[1:])
    return _onto_model(times, columns, degrees)


def _onto_model(times: Vec, columns: Mapping[str, Vec], degrees: bool) -> AngleTrack:
    require_places({name: columns[name] for name in _PLACES})
    turning = {name: columns[name] for name in (*_TRUNK, *_ARMS)}
    angle = dict(zip(turning, in_radians(turning, degrees).T, strict=True))
    yaw, abdomen = trunk_angles(angle)
    q = np.zeros((len(times), 18))
    q[:, 0], q[:, 1], q[:, 2] = columns["pelvis_tx"], -columns["pelvis_tz"], yaw
    q[:, 3:6] = abdomen
    for hand, first, side in (("r", 10, -1.0), ("l", 14, 1.0)):
        q[:, first] = angle[f"arm_flex_{hand}"]
        q[:, first + 1] = -angle[f"arm_add_{hand}"]
        q[:, first + 2] = -side * angle[f"arm_rot_{hand}"]
        q[:, first + 3] = angle[f"elbow_flex_{hand}"]
    return AngleTrack(times=times, q=q, pelvis_z=columns["pelvis_ty"].copy())


def trunk_angles(angle: Mapping[str, Vec]) -> tuple[Vec, Vec]:
    """Return yaw [rad], shape (n,), and abdomen [rad], shape (n, 3).

    The yaw is where the pelvis's forward axis points, seen from above; the abdomen takes what
    is left of pelvis and lumbar rotations together.

    Args:
        angle: The six rotations of pelvis and lumbar joint by name [rad], shape (n,).
    """
    tilt, listing, rotation = (angle[name] for name in _TRUNK[:3])
    pelvis = _turn(tilt, listing, rotation)
    torso = pelvis @ _turn(*(angle[name] for name in _TRUNK[3:]))
    yaw = np.unwrap(np.arctan2(pelvis[:, 1, 0], pelvis[:, 0, 0]))
    return yaw, euler_angles(axis_turns(2, -yaw) @ torso)


def _turn(about_z: Vec, about_x: Vec, about_y: Vec) -> Vec:
    """Return OpenSim's ``Rz Rx Ry`` in our axes (x forward, y left, z up), shape (n, 3, 3)."""
    turns: Vec = axis_turns(1, -about_z) @ axis_turns(0, about_x) @ axis_turns(2, about_y)
    return turns


def _promised_rows(said: Mapping[str, str]) -> int | None:
    word = said.get("nrows", said.get("datarows"))
    if word is None:
        return None
    if not word.isascii() or not word.isdigit():
        raise _bad("head, nRows", shown(word), "must be a whole number")
    return int(word[:9])


def _check_count(said: Mapping[str, str], key: str, found: int, place: str) -> None:
    if key in said and said[key] != str(found):
        rule = f"must be the nColumns={said[key][:20]} that the head promises"
        raise _bad(place, f"<{found} columns>", rule)


def _bad(place: str, value: str, rule: str, hint: str = "") -> BadMotion:
    return BadMotion([Fault(place=place, value=value, rule=rule, hint=hint)])
