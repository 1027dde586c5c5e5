"""Validation of received key-points: missing and unusable points, wrong frames and units.

:func:`check_keypoints` accepts the usual markers of missing points; it drops and names unusable
points; only a wrong number of points is an error.

:func:`why_implausible` detects skeletons in another frame (of a camera; with the floor as
origin) or unit by bone lengths, heights of body parts over the floor, and pose. It accepts
people who stand, bend, kneel, sit, lie on the floor or on a table, reach up, or stand on a step
of half a metre. An implausible skeleton counts as unseen, and so does one without a usable
key-point. Bounds are ours.

Some skeletons with the floor as origin remain plausible: of people who kneel, squat or lie, who
then seem to do so on a table; of people whose legs are not seen; and all of them if the
difference of the origins is at most that of a step.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from app.errors import InvalidInput, digits
from app.sim.core.arrays import Vec
from app.sim.human.kernels.kinematics import MEDIAN_TRUNK
from app.sim.perception.keypoints import BODY_25, FARTHEST_M, N_KEYPOINTS, K

MIN_CONFIDENCE = 0.1
"""Confidence below which a key-point counts as missing."""
OUTLIER_M = 1.6
"""Largest distance of a key-point from the median of all [m]; stretched arms reach 1.3 m."""
_ENOUGH = 5
"""Least number of key-points for the detection of outliers."""
_PLACEHOLDERS = (0.0, -1.0)
"""Values of all three coordinates that mark a missing key-point."""
_HUGE = 1e9
"""Bound of coordinates [m], whose squares are finite."""
_TRUST_SLACK = 0.01
"""Tolerance of confidences outside [0, 1], which are clipped."""

_BONES = (
    (K["neck"], K["mid_hip"], MEDIAN_TRUNK),
    (K["shoulder_r"], K["shoulder_l"], 0.36),
    *((K[f"shoulder_{s}"], K[f"elbow_{s}"], 0.29) for s in "rl"),
    *((K[f"elbow_{s}"], K[f"wrist_{s}"], 0.26) for s in "rl"),
    *((K[f"hip_{s}"], K[f"knee_{s}"], 0.42) for s in "rl"),
    *((K[f"knee_{s}"], K[f"ankle_{s}"], 0.42) for s in "rl"),
)
"""Pairs of key-points and their distance in the median person [m]."""
_BONE_RATIO = (0.55, 1.6)
"""Range of the median ratio of bone lengths to those of the median person."""
_ENOUGH_BONES = 3
"""Least number of bones for that check."""
_UNITS = {"millimetres": 1000.0, "centimetres": 100.0, "inches": 39.37, "feet": 3.281}

_STEP_M = 0.5
"""Largest height of a step or platform below a person [m]."""
_LEG_END_M = _STEP_M + 0.15
"""Largest height of the lower end of legs that hang or stand, with errors of a tracker [m]."""
_SHANK_M = 0.15
"""Least height of the knees over the feet of such legs [m]."""
_BELOW_M = -0.3
"""Least height of any part over the floor, with errors of a tracker [m]."""
_KNEES_BELOW_M = -0.15
"""The same of knees, whose centres are over the floor in all postures [m]."""
_PARTS: dict[str, tuple[tuple[int, ...], float]] = {
    "feet": (
        tuple(
            K[f"{part}_{s}"] for part in ("ankle", "heel", "big_toe", "small_toe") for s in "rl"
        ),
        1.0,  # lying on a table
    ),
    "knees": ((K["knee_r"], K["knee_l"]), 1.4),
    "hips": ((K["mid_hip"], K["hip_r"], K["hip_l"]), 1.1 + _STEP_M),
    "shoulders": ((K["neck"], K["shoulder_r"], K["shoulder_l"]), 1.75 + _STEP_M),
    "head": (tuple(K[name] for name in ("nose", "eye_r", "eye_l", "ear_r", "ear_l")), 2.5),
    "elbows": ((K["elbow_r"], K["elbow_l"]), 2.6),
    "wrists": ((K["wrist_r"], K["wrist_l"]), 2.9),
}
"""Body parts: key-points, and largest height over the floor [m], of a person of 1.95 m on a
step with raised arms."""
_FLAT_HIPS_M = 1.25
"""Largest height of the hips over the floor with the trunk level or head down [m]."""
_INVERTED_M = 0.25
"""Largest height of hips over shoulders while the legs are as far above the hips [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Keypoints:
    """One validated frame of one person."""

    points: Vec
    """Key-points [m], shape (25, 3); rows of NaN are missing."""
    confidences: Vec
    """Confidences in (0, 1], 0 for missing key-points, shape (25,)."""
    outliers: tuple[str, ...] = ()
    """Names of key-points dropped because they are too far from all others."""
    unusable: tuple[str, ...] = ()
    """Names of key-points dropped because of unusable values."""
    implausible: str | None = None
    """Reason why the key-points cannot be in the cell's frame, or none is usable, in which
    case all are missing; None otherwise."""

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Whether each key-point is present, shape (25,)."""
        return self.confidences > 0.0


UNSEEN = Keypoints(points=np.full((N_KEYPOINTS, 3), np.nan), confidences=np.zeros(N_KEYPOINTS))
"""Frame without a person."""


def check_keypoints(
    keypoints: ArrayLike,
    confidences: ArrayLike | None = None,
    place: str = "",
    floor_z: float | None = None,
) -> Keypoints:
    """Validate one received frame of one person.

    A key-point is missing if all coordinates are NaN, if it is exactly (0, 0, 0) or
    (-1, -1, -1), or if its confidence is NaN or below ``MIN_CONFIDENCE``. It is unusable if it
    has only some coordinates, is infinite, beyond 100 m, or has a confidence outside [0, 1].
    A frame of missing key-points is empty, unless some have low confidences: these show a
    person, whose place is then unknown.

    Args:
        keypoints: Order of BODY_25, cell's frame [m], shape (25, 3).
        confidences: Confidences in [0, 1], shape (25,); 1 where None.
        place: Prefix of the field's name in errors, such as ``"people[1]."``.
        floor_z: Height of the floor [m]; None: heights are not checked.

    Raises:
        InvalidInput: The values are not numbers, or have another shape.
    """
    points = as_numbers(f"{place}keypoints", keypoints, (N_KEYPOINTS, 3))
    trust = np.ones(N_KEYPOINTS)
    if confidences is not None:
        trust = as_numbers(f"{place}confidences", confidences, (N_KEYPOINTS,))
    missing = np.isnan(points).all(axis=1) | np.isnan(trust)
    for placeholder in _PLACEHOLDERS:
        missing |= (points == placeholder).all(axis=1)
    given, beyond = trust, (trust < -_TRUST_SLACK) | (trust > 1.0 + _TRUST_SLACK)
    unusable = beyond | ~np.isfinite(points).all(axis=1)
    trust = np.clip(np.nan_to_num(trust, nan=0.0), 0.0, 1.0)
    points = np.clip(points, -_HUGE, _HUGE)
    low = ~missing & ~beyond & (trust > 0.0) & (trust < MIN_CONFIDENCE)
    missing |= ~beyond & (trust < MIN_CONFIDENCE)
    unusable |= _too_far(points, ~missing & ~unusable)
    unusable &= ~missing
    missing |= unusable
    points[missing], trust[missing] = np.nan, 0.0
    implausible = why_implausible(points, floor_z)
    if missing.all() and low.any():
        greatest = digits(float(given[low].max()))
        implausible = (
            f"no usable key-point has a confidence of {MIN_CONFIDENCE:g} or more: the greatest "
            f"is {greatest}"
        )
    elif missing.all() and unusable.any():
        implausible = _why_unusable(given[unusable & beyond], int(unusable.sum()))
    outliers = _outliers(points, ~missing) if implausible is None else np.arange(N_KEYPOINTS)
    points[outliers], trust[outliers] = np.nan, 0.0
    return Keypoints(
        points=points,
        confidences=trust,
        outliers=_names(outliers) if implausible is None else (),
        unusable=_names(np.flatnonzero(unusable)),
        implausible=implausible,
    )


def _why_unusable(confidences: Vec, n_unusable: int) -> str:
    """Return the reason why no key-point is usable, by the confidences outside [0, 1]."""
    if len(confidences) < n_unusable:
        return f"no key-point has three finite coordinates within {FARTHEST_M:g} m"
    low, high = (digits(float(one)) for one in (confidences.min(), confidences.max()))
    percent = " (are these percent?)" if 2.0 <= confidences.max() <= 100.0 else ""
    return f"all confidences are outside [0, 1]: {low} to {high}{percent}"


def _names(indices: NDArray[np.intp]) -> tuple[str, ...]:
    return tuple(BODY_25[k] for k in indices.tolist())


def as_numbers(field: str, values: ArrayLike, shape: tuple[int, ...]) -> Vec:
    """Return received values as an array of a shape.

    Raises:
        InvalidInput: The values are not numbers, or have another shape.
    """
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidInput(field, type(values).__name__, "must be numbers") from error
    if array.shape != shape:
        raise InvalidInput(field, array.shape, f"must have the shape {shape}")
    return array


def _too_far(points: Vec, there: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return whether each key-point is an error beyond ``FARTHEST_M``, shape (25,).

    If most are that far, the unit is wrong and only repeated points, which are placeholders,
    are errors.
    """
    far = np.zeros(N_KEYPOINTS, dtype=np.bool_)
    far[there] = np.abs(points[there]).max(axis=1) > FARTHEST_M
    if not far.any():
        return far
    _, where, count = np.unique(points, axis=0, return_inverse=True, return_counts=True)
    repeated = far & (count[where] > 1)
    others = there & ~repeated
    return far if 2 * (far & others).sum() < others.sum() else repeated


def _outliers(points: Vec, seen: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return the indices of key-points far from the others."""
    there = np.flatnonzero(seen)
    if len(there) < _ENOUGH:
        return there[:0]
    away = np.linalg.norm(points[there] - np.median(points[there], axis=0), axis=1)
    return np.asarray(there[away > OUTLIER_M])


def _bone_ratio(points: Vec) -> float:
    """Return the median ratio of bone lengths to the median person's; NaN for too few."""
    ratios = np.array([np.linalg.norm(points[a] - points[b]) / one for a, b, one in _BONES])
    there = ratios[np.isfinite(ratios)]
    return float(np.median(there)) if len(there) >= _ENOUGH_BONES else float("nan")


def _unit_hint(ratio: float) -> str:
    """Return a hint about the unit, by the ratio of bone lengths; NaN: unknown."""
    if np.isnan(ratio):
        return " (are these millimetres?)"
    for unit, per_metre in _UNITS.items():
        if 0.7 <= ratio / per_metre <= 1.4:
            return f" (are these {unit}?)"
    return " (other units?)"


def _axis_hint(points: Vec) -> str:
    """Return a hint about the axis along trunk or legs if it is not z."""
    middles = [_middle(points, part) for part in ("shoulders", "hips", "knees", "feet")]
    there = [middle for middle in middles if np.isfinite(middle).all()]
    if len(there) < 2:
        return ""
    up = there[0] - there[-1]
    axis = int(np.abs(up).argmax())
    if axis == 2 and up[2] > 0.0:
        return ""
    sign = "up" if up[axis] > 0.0 else "down"
    camera = ": a camera's frame" if (axis, sign) == (1, "down") else ""
    return f" (does {'xyz'[axis]} point {sign} here{camera}?)"


def _middle(points: Vec, part: str) -> Vec:
    """Return the median of the key-points of a part [m], shape (3,), NaN without any."""
    own = points[list(_PARTS[part][0])]
    there = own[np.isfinite(own).all(axis=1)]
    return np.median(there, axis=0) if len(there) else np.full(3, np.nan)


def why_implausible(points: Vec, floor_z: float | None) -> str | None:
    """Return the reason why key-points cannot be a person in the cell's frame, or None.

    Args:
        points: Key-points [m], shape (25, 3), NaN where missing.
        floor_z: Height of the floor [m]; None: heights are not checked.
    """
    there = points[np.isfinite(points).all(axis=1)]
    if len(there) == 0:
        return None
    ratio = _bone_ratio(points)
    hint, (least, most) = _unit_hint(ratio), _BONE_RATIO
    if np.abs(there).max(axis=1).min() > FARTHEST_M:
        return f"all key-points are over {FARTHEST_M:g} m away{hint}"
    if not (np.isnan(ratio) or least <= ratio <= most):
        return (
            f"bones are {ratio:.3g} times those of the median adult, a person's {least:g} to "
            f"{most:g} times{hint}"
        )
    reason = None if floor_z is None else _why_not_standing(points, floor_z)
    if reason is None or floor_z is None:
        return reason
    if _why_not_standing(points, 0.0) is None:
        return f"{reason} (does z count from the floor here?)"
    return f"{reason}{_axis_hint(points)}"


def _why_not_standing(points: Vec, floor_z: float) -> str | None:
    """Return the reason why heights over the floor are implausible, or None."""
    heights = {part: float(_middle(points, part)[2] - floor_z) for part in _PARTS}
    for part, height in heights.items():
        low, high = _KNEES_BELOW_M if part == "knees" else _BELOW_M, _PARTS[part][1]
        if not (np.isnan(height) or low <= height <= high):
            return f"{part} are {height:.2f} m over the floor, a person's {low:g} to {high:g} m"
    hips, shoulders, knees = heights["hips"], heights["shoulders"], heights["knees"]
    end = 2.0 * knees - hips if np.isnan(heights["feet"]) else heights["feet"]
    if knees < hips + 0.1 and knees - end > _SHANK_M and end > _LEG_END_M:
        return (
            f"legs reach down to {end:.2f} m over the floor, those of a person who stands or "
            f"sits to {_LEG_END_M:g} m or less"
        )
    if shoulders < hips + 0.1 and hips > _FLAT_HIPS_M:
        return (
            f"hips are {hips:.2f} m over the floor and shoulders {shoulders:.2f} m: level or "
            f"head down, a person's hips are within {_FLAT_HIPS_M:g} m"
        )
    legs = np.fmin(heights["knees"], heights["feet"])
    if shoulders < hips - _INVERTED_M and legs > hips + _INVERTED_M:
        return (
            f"shoulders are {hips - shoulders:.2f} m below the hips and legs "
            f"{legs - hips:.2f} m above them"
        )
    return None
