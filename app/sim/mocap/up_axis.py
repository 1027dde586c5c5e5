"""Detection of the up axis of a recording.

Evidence is the rest pose (legs below the pelvis, trunk above it) and the motion: legs and feet
of standing or sitting people, the shoulder line, and the lean of the trunk. The trunk alone is
ambiguous: bent forward by 90 degrees in a file with y up, it has the direction of an upright
one in a file with z up. If both axes fit, the file is rejected.
"""

from dataclasses import dataclass

import numpy as np

from app.errors import BadRecording
from app.sim.core.arrays import Vec
from app.sim.mocap.faults import bad
from app.sim.mocap.joint_centres import unit
from app.sim.mocap.read_options import UP_AXES

FOUND = ("y", "z")
"""Axes that are detected; others must be stated."""
NEAR, NEAR_AT_REST = 45.0, 35.0
"""Largest angles between a direction and its axis, in motion and in the rest pose [deg]."""
UPPER_BODY = {"shoulders", "trunk"}
"""Objections that hold for standing, sitting and kneeling people."""
MAX_LEG = 50.0
"""Largest median angle between lower legs and vertical [deg]."""
MAX_TOES = 35.0
"""Largest median elevation of the toes seen from the ankle [deg]."""
MIN_LEAN, MAX_LEAN = -20.0, 110.0
"""Range of the trunk's median lean relative to the rest pose, forward positive [deg]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyDirections:
    """Directions of body segments in the frame of the file, each of shape (n, 3)."""

    trunk: Vec
    """Pelvis to neck."""
    across: Vec
    """Right to left shoulder."""
    legs: Vec | None
    """Knee to ankle, of both legs; None without legs."""
    toes: Vec | None
    """Ankle to toe, of both feet; None without toes."""


def find_up_axis(motion: BodyDirections, rest: BodyDirections) -> str:
    """Return the up axis, one of FOUND.

    Args:
        motion: Directions in all frames.
        rest: Directions in the rest pose; zero if unknown.

    Raises:
        BadRecording: No axis or two axes fit; the fault names them.
    """
    resting, leaning = rest_axis(rest), _nearest(_direction(motion.trunk))
    straight = _lean(rest, resting) if resting else 0.0  # the hip is often a marker on the belt
    resting = resting if resting in FOUND else None
    against = {axis: _objections(motion, axis, straight) for axis in FOUND}
    fits = [axis for axis in FOUND if not against[axis]]
    if not fits:
        if kneeling := _kneeling(resting, leaning, against):
            return kneeling
        raise _no_axis(motion, against, straight)
    if len(fits) == 1 and (resting in (None, fits[0]) or leaning == fits[0]):
        return fits[0]
    if len(fits) == 1 and {"lower legs"} < against.get(resting or "", {}).keys() - {"toes"}:
        return fits[0]  # the rest pose lies in the frame of the motion
    if len(fits) == 2 and leaning in fits and resting in (None, leaning):
        return leaning
    raise _ambiguous(motion, fits, resting)


def require_not_head_down(motion: BodyDirections, axis: str) -> None:
    """Raise BadRecording if the trunk points down along an axis in most frames."""
    if _elevation(motion.trunk, axis) < -NEAR:
        rule = f"turns the person head down: the trunk {_leaning(motion, axis)}"
        raise bad("up", axis, rule)


def _kneeling(
    resting: str | None, leaning: str | None, against: dict[str, dict[str, str]]
) -> str | None:
    """Return the axis of kneeling or squatting people, where only the lower legs object."""
    for axis, other in (FOUND, FOUND[::-1]):
        if against[axis].keys() == {"lower legs"} and resting in (None, axis):
            only = axis in (resting, leaning) and against[other].keys() & UPPER_BODY
            if only or resting == leaning == axis:
                return axis
    return None


def rest_axis(rest: BodyDirections) -> str | None:
    """Return the up direction of the rest pose, one of UP_AXES; None if unknown."""
    axis = _nearest(_direction(rest.trunk), NEAR_AT_REST)
    if axis is None or abs(_elevation(rest.across, axis)) > NEAR_AT_REST:
        return None
    if rest.legs is not None and _nearest(-_direction(rest.legs), NEAR_AT_REST) != axis:
        return None
    return axis


def vector(axis: str) -> Vec:
    """Return the unit vector of one of UP_AXES, shape (3,)."""
    return np.asarray((-1.0 if axis[0] == "-" else 1.0) * np.eye(3)["xyz".index(axis[-1])])


def z_up(v: Vec, up: str) -> Vec:
    """Return vectors, shape (..., 3), rotated so that ``up`` of the file becomes z."""
    turns = {
        "x": [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]],
        "y": [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]],
        "z": [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        "-x": [[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]],
        "-y": [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]],
        "-z": [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]],
    }
    return np.asarray(v @ np.array(turns[up]).T)


def _objections(motion: BodyDirections, axis: str, straight: float) -> dict[str, str]:
    """Return the objections to an axis, by body part, as text with the angle.

    Args:
        motion: Directions in all frames.
        axis: One of UP_AXES.
        straight: Lean of the trunk in the rest pose [deg].
    """
    found: dict[str, str] = {}
    tilt = float(np.degrees(np.arcsin(np.median(np.abs(motion.across @ vector(axis))))))
    if tilt > NEAR:
        found["shoulders"] = f"the shoulders are {tilt:.0f} degrees out of the level"
    if not MIN_LEAN <= _lean(motion, axis) - straight <= MAX_LEAN:
        found["trunk"] = f"the trunk {_leaning(motion, axis)}"
    if motion.legs is not None and (leg := 90.0 + _elevation(motion.legs, axis)) > MAX_LEG:
        found["lower legs"] = f"the lower legs are {leg:.0f} degrees off the vertical"
    if motion.toes is not None and (toes := _elevation(motion.toes, axis)) > MAX_TOES:
        found["toes"] = f"the toes point {toes:.0f} degrees up"
    return found


def _lean(motion: BodyDirections, axis: str) -> float:
    """Return the median lean of the trunk [deg], forward positive."""
    up = vector(axis)
    front = unit(np.cross(motion.across, up))
    ahead = np.median(np.einsum("ni,ni->n", motion.trunk, front))
    return float(np.degrees(np.arctan2(ahead, np.median(motion.trunk @ up))))


def _leaning(motion: BodyDirections, axis: str) -> str:
    """Return the lean of the trunk as text."""
    lean = _lean(motion, axis)
    return f"leans {abs(lean):.0f} degrees {'forward' if lean > 0.0 else 'backward'}"


def _elevation(directions: Vec, axis: str) -> float:
    """Return the median elevation of directions [deg]."""
    return float(np.degrees(np.arcsin(np.clip(np.median(directions @ vector(axis)), -1, 1))))


def _direction(directions: Vec) -> Vec:
    """Return the median of directions, shape (3,)."""
    return np.asarray(np.median(directions, axis=0))


def _nearest(direction: Vec, within: float = NEAR) -> str | None:
    """Return the axis near a direction; None if there is none."""
    length = float(np.linalg.norm(direction))
    if length < 0.5:  # no common direction
        return None
    axis = max(UP_AXES, key=lambda one: float(vector(one) @ direction))
    near = float(vector(axis) @ direction) > np.cos(np.radians(within)) * length
    return axis if near else None


def _no_axis(
    motion: BodyDirections, against: dict[str, dict[str, str]], straight: float
) -> BadRecording:
    reasons = "; ".join(f"with {axis} up {', '.join(against[axis].values())}" for axis in FOUND)
    others = [
        one for one in UP_AXES if one not in FOUND and not _objections(motion, one, straight)
    ]
    leaning = _nearest(_direction(motion.trunk))
    hint = f"state up = {' or '.join([*FOUND, *others])}"
    if leaning in others:
        hint = f"state up = {leaning}, which fits"
    rule = f"must point up, along {' or '.join(FOUND)}, in most frames: {reasons}"
    return _bad(motion, "pelvis to neck", rule, hint)


def _ambiguous(motion: BodyDirections, fits: list[str], resting: str | None) -> BadRecording:
    parts = [f"{axis} up by the motion (the trunk {_leaning(motion, axis)})" for axis in fits]
    named = fits
    if resting:
        parts.append(f"{resting} up by the rest pose")
        named = sorted({*fits, resting})
    rule, hint = f"fits {' and '.join(parts)}", f"state up = {' or '.join(named)}"
    return _bad(motion, "up axis: pelvis to neck", rule, hint)


def _bad(motion: BodyDirections, place: str, rule: str, hint: str) -> BadRecording:
    value = "(" + ", ".join(f"{one:.2f}" for one in _direction(motion.trunk)) + ")"
    return bad(place, value, rule, hint)
