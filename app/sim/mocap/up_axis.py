"""Which axis of a recording points up.

Asked are the skeleton's rest pose (legs below the pelvis, trunk above it) and the motion: legs
and feet of a person who stands or sits, the line across the shoulders, and the lean of the
trunk. A trunk alone cannot tell: a worker bent forward by 90 degrees in a file with y up has
the trunk of one who stands in a file with z up. If both fit, the file is rejected.
"""

from dataclasses import dataclass

import numpy as np

from app.errors import BadRecording, Fault
from app.sim.core.arrays import Vec
from app.sim.mocap.read_options import UP_AXES

FOUND = ("y", "z")
"""Axes that are found; others have to be stated."""
NEAR, NEAR_AT_REST = 45.0, 35.0
"""Angles below which a direction counts as that of an axis, in motion and at rest [deg]."""
UPPER_BODY = {"shoulders", "trunk"}
"""What contradicts an axis whether a person stands, sits or kneels."""
MAX_LEG = 50.0
"""Most that lower legs are off the vertical in half of the frames [deg]."""
MAX_TOES = 35.0
"""Most that toes are above the level of the ankle, seen from there [deg]."""
MIN_LEAN, MAX_LEAN = -20.0, 110.0
"""Range of the trunk's lean, forward positive and from the rest pose, in half of the frames
[deg]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyDirections:
    """Directions of a person's parts, in the frame of the file, each of shape (n, 3)."""

    trunk: Vec
    """Pelvis to neck."""
    across: Vec
    """Right to left shoulder."""
    legs: Vec | None
    """Knee to ankle, of both legs; None where no legs were recorded."""
    toes: Vec | None
    """Ankle to toe, of both feet; None where no toes were recorded."""


def find_up_axis(motion: BodyDirections, rest: BodyDirections) -> str:
    """Return the axis that points up, one of FOUND.

    Args:
        motion: In all frames.
        rest: In the rest pose; zero where the file does not tell it.

    Raises:
        BadRecording: None fits, or two do; the fault names them.
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
    raise _two(motion, fits, resting)


def require_not_head_down(motion: BodyDirections, axis: str) -> None:
    """Refuse an axis that is stated where the trunk points down along it.

    Raises:
        BadRecording: It does in most frames.
    """
    if _elevation(motion.trunk, axis) < -NEAR:
        rule = f"turns the person head down: the trunk {_leaning(motion, axis)}"
        raise BadRecording([Fault(place="up", value=axis, rule=rule)])


def _kneeling(
    resting: str | None, leaning: str | None, against: dict[str, dict[str, str]]
) -> str | None:
    """Return the axis of a person who kneels or squats: only the lower legs are against it."""
    for axis, other in (FOUND, FOUND[::-1]):
        if against[axis].keys() == {"lower legs"} and resting in (None, axis):
            only = axis in (resting, leaning) and against[other].keys() & UPPER_BODY
            if only or resting == leaning == axis:
                return axis
    return None


def rest_axis(rest: BodyDirections) -> str | None:
    """Return the direction along which the rest pose stands, one of UP_AXES.

    None where trunk and legs are not in line, or nothing is known.
    """
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
    """Return vectors turned so that a direction of the file points along z."""
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
    """Return what contradicts an axis, by part, with its angle in words.

    Args:
        motion: In all frames.
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
    front = np.cross(motion.across, up)
    front /= np.maximum(np.linalg.norm(front, axis=1, keepdims=True), 1e-9)
    ahead = np.median(np.einsum("ni,ni->n", motion.trunk, front))
    return float(np.degrees(np.arctan2(ahead, np.median(motion.trunk @ up))))


def _leaning(motion: BodyDirections, axis: str) -> str:
    """Return the lean of the trunk in words."""
    lean = _lean(motion, axis)
    return f"leans {abs(lean):.0f} degrees {'forward' if lean > 0.0 else 'backward'}"


def _elevation(directions: Vec, axis: str) -> float:
    """Return the median angle of directions above the level [deg]."""
    return float(np.degrees(np.arcsin(np.clip(np.median(directions @ vector(axis)), -1, 1))))


def _direction(directions: Vec) -> Vec:
    """Return the median of directions, shape (3,)."""
    return np.asarray(np.median(directions, axis=0))


def _nearest(direction: Vec, within: float = NEAR) -> str | None:
    """Return the axis that a direction is near to; None where it is near to none."""
    length = float(np.linalg.norm(direction))
    if length < 0.5:  # unit vectors that point everywhere
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


def _two(motion: BodyDirections, fits: list[str], resting: str | None) -> BadRecording:
    parts = [f"{axis} up by the motion (the trunk {_leaning(motion, axis)})" for axis in fits]
    named = fits
    if resting:
        parts.append(f"{resting} up by the rest pose")
        named = sorted({*fits, resting})
    rule, hint = f"fits {' and '.join(parts)}", f"state up = {' or '.join(named)}"
    return _bad(motion, "up axis: pelvis to neck", rule, hint)


def _bad(motion: BodyDirections, place: str, rule: str, hint: str) -> BadRecording:
    value = "(" + ", ".join(f"{one:.2f}" for one in _direction(motion.trunk)) + ")"
    return BadRecording([Fault(place=place, value=value, rule=rule, hint=hint)])
