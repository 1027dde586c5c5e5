"""Key-points of a depth camera in the layout BODY_25: names, checks, sides, our body's own.

A frame is 25 points [m] in the cell's frame, NaN where a point is missing, as OpenPose with a
depth image gives them (METHOD 2.8). :func:`check_keypoints` lets nothing else in: what cannot
be a person in metres is an error with its rule; single points far from all others are dropped
and named.

:func:`keypoints_of` gives the key-points of our 18-DoF person. Shoulders, elbows, wrists, neck
and mid-hip are joints of the model. The model has no face, knees or feet, so these are placed
by proportion: the face rigid on the torso (the model's head does not turn), the hips half their
distance to either side of the pelvis, and under each hip a straight upright leg, as its
capsule, with the knee half-way and the foot pointing where the pelvis faces.

Source: Cao et al., OpenPose (2019), output format BODY_25; METHOD 2.8.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from app.errors import InvalidInput
from app.sim import human
from app.sim.kernels import body
from app.sim.ports import Vec

BODY_25 = (
    *("nose", "neck", "shoulder_r", "elbow_r", "wrist_r", "shoulder_l", "elbow_l", "wrist_l"),
    *("mid_hip", "hip_r", "knee_r", "ankle_r", "hip_l", "knee_l", "ankle_l"),
    *("eye_r", "eye_l", "ear_r", "ear_l"),
    *("big_toe_l", "small_toe_l", "heel_l", "big_toe_r", "small_toe_r", "heel_r"),
)
"""Names of the key-points in OpenPose's order."""
N_KEYPOINTS = len(BODY_25)
K = {name: index for index, name in enumerate(BODY_25)}
"""Index of a key-point by its name."""

Group = Literal["arms", "legs", "face"]
GROUPS: dict[Group, tuple[int, ...]] = {
    "arms": tuple(K[f"{part}_{s}"] for part in ("shoulder", "elbow", "wrist") for s in "rl"),
    "legs": tuple(
        K[f"{part}_{s}"]
        for part in ("hip", "knee", "ankle", "big_toe", "small_toe", "heel")
        for s in "rl"
    ),
    "face": tuple(K[f"{part}_{s}"] for part in ("eye", "ear") for s in "rl"),
}
"""Pairs of key-points whose sides a tracker confuses together."""
MIRROR = np.array(
    [K[f"{n[:-1]}{'l' if n[-1] == 'r' else 'r'}"] if n[-2:-1] == "_" else K[n] for n in BODY_25]
)
"""The same key-point of the other side, shape (25,)."""

_FACE = {
    "nose": (0.12, 0.0, -0.01),
    "eye_r": (0.10, -0.03, 0.03),
    "eye_l": (0.10, 0.03, 0.03),
    "ear_r": (0.0, -0.075, 0.0),
    "ear_l": (0.0, 0.075, 0.0),
}
"""Face from the centre of the head in the torso's axes [m]; proportions of an adult's head."""
_ANKLE, _HEEL, _BIG_TOE, _SMALL_TOE = (
    (0, 0, 0.08),
    (-0.06, 0, 0.03),
    (0.17, 1, 0.02),
    (0.13, -1, 0.02),
)
"""Foot under the hip: forward [m], toward the other foot (1 or -1), above the floor [m]."""
_HALF_FOOT = 0.035
"""Half the distance of big and small toe [m]."""

FARTHEST_M = 100.0
"""Coordinates beyond this are no cell's; ours."""
PERSON_M = (0.02, 1.2)
"""Least and greatest median distance of a person's key-points from their middle [m]; ours. A
standing adult has 0.4 m."""
STRAY_M = 1.6
"""Distance from the middle at which a key-point is no part of the person [m]; an arm stretched
up or out is within 1.3 m."""
_ENOUGH = 5
"""Key-points from which on the size of what is seen is judged."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Keypoints:
    """One checked frame of one person."""

    points: Vec
    """Key-points [m], shape (25, 3); rows of NaN are missing."""
    confidences: Vec
    """Trust in each in (0, 1], 0 where it is missing, shape (25,)."""
    strays: tuple[str, ...]
    """Names of key-points dropped because they lie too far from all others."""

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Which key-points are there, shape (25,)."""
        return self.confidences > 0.0


def check_keypoints(
    keypoints: ArrayLike,
    confidences: ArrayLike | None = None,
    min_confidence: float = 0.1,
    place: str = "",
) -> Keypoints:
    """Check one frame of one person as it comes from outside.

    Missing is: NaN in any coordinate; exactly (0, 0, 0), as OpenPose writes it; a confidence
    below ``min_confidence`` or NaN. A frame in which all are missing is a valid frame.

    Args:
        keypoints: Order of BODY_25, cell's frame [m], shape (25, 3).
        confidences: Trust in each in [0, 1], shape (25,); 1 where None.
        min_confidence: Trust below which a key-point counts as missing.
        place: Put before the field's name in errors, such as ``"people[1]."``.

    Raises:
        InvalidInput: Not numbers, another shape, infinite, confidences outside [0, 1], or not
            a person in metres.
    """
    points = _numbers(f"{place}keypoints", keypoints, (N_KEYPOINTS, 3))
    trust = np.ones(N_KEYPOINTS)
    if confidences is not None:
        given = _numbers(f"{place}confidences", confidences, (N_KEYPOINTS,))
        trust = np.nan_to_num(given, nan=0.0)
        if trust.min() < 0.0 or trust.max() > 1.0:
            wrong = trust[(trust < 0.0) | (trust > 1.0)]
            raise InvalidInput(f"{place}confidences", float(wrong[0]), "must lie in [0, 1]")
    missing = ~np.isfinite(points).all(axis=1) | (points == 0.0).all(axis=1)
    missing |= trust < max(min_confidence, 1e-6)
    strays = _strays(points, ~missing, place)
    missing[strays] = True
    points[missing], trust[missing] = np.nan, 0.0
    return Keypoints(
        points=points, confidences=trust, strays=tuple(BODY_25[int(k)] for k in strays)
    )


def _numbers(field: str, values: ArrayLike, shape: tuple[int, ...]) -> Vec:
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidInput(field, type(values).__name__, "must be numbers") from error
    if array.shape != shape:
        raise InvalidInput(field, array.shape, f"must have the shape {shape}")
    if np.isinf(array).any():
        first = BODY_25[int(np.argwhere(np.isinf(array))[0][0])]
        raise InvalidInput(f"{field}.{first}", "inf", "must be finite, or NaN where missing")
    return array


def _strays(points: Vec, seen: NDArray[np.bool_], place: str) -> NDArray[np.int64]:
    """Return the indices of key-points far from the others, after a check of the unit."""
    there = np.flatnonzero(seen)
    if len(there) == 0:
        return there
    if float(np.median(np.abs(points[there]).max(axis=1))) > FARTHEST_M:
        largest = float(np.abs(points[there]).max())
        rule = (
            f"must be within {FARTHEST_M:g} m of the robot, in metres (are these millimetres?)"
        )
        raise InvalidInput(f"{place}keypoints", largest, rule)
    away = np.linalg.norm(points[there] - np.median(points[there], axis=0), axis=1)
    if len(there) < _ENOUGH:
        return np.zeros(0, dtype=np.int64)
    size, (least, most) = float(np.median(away)), PERSON_M
    if not least <= size <= most:
        rule = (
            f"is the median distance of the key-points from their middle; a person's lies in "
            f"[{least:g}, {most:g}] m (other units?)"
        )
        raise InvalidInput(f"{place}keypoints", round(size, 4), rule)
    return np.asarray(there[away > STRAY_M])


def keypoints_of(q: Vec, size: Vec, floor_z: float) -> Vec:
    """Return the key-points of our person [m], shape (25, 3), order of BODY_25.

    Args:
        q: Joint positions [m, rad], shape (18,).
        size: The person's size [m], shape (12,) (``Cell.body``).
        floor_z: Height of the floor [m].

    Deviates: face, knees and feet are no joints of the model; see the head of this file.
    """
    joints, frames = human.joint_points(q, size), human.body_frames(q, size)
    torso, pelvis = frames["torso"][:3, :3], frames["pelvis"][:3, :3]
    out = np.empty((N_KEYPOINTS, 3))
    out[K["neck"]], out[K["mid_hip"]] = joints["neck"], joints["pelvis"]
    for name, offset in _FACE.items():
        out[K[name]] = joints["head"] + torso @ np.array(offset)
    for hand, side in (("r", -1.0), ("l", 1.0)):
        for part in ("shoulder", "elbow", "wrist"):
            out[K[f"{part}_{hand}"]] = joints[f"{part}_{hand}"]
        hip = joints["pelvis"] + side * size[body.HIP] * pelvis[:, 1]
        out[K[f"hip_{hand}"]] = hip
        feet = {"ankle": _ANKLE, "heel": _HEEL, "big_toe": _BIG_TOE, "small_toe": _SMALL_TOE}
        for part, (forward, inward, up) in feet.items():
            place = hip + forward * pelvis[:, 0] - side * inward * _HALF_FOOT * pelvis[:, 1]
            place[2] = floor_z + up
            out[K[f"{part}_{hand}"]] = place
        out[K[f"knee_{hand}"]] = 0.5 * (hip + out[K[f"ankle_{hand}"]])
    return out


def swap_sides(values: Vec, group: Group) -> Vec:
    """Return a copy with left and right of one group exchanged, shape as given (25, ...)."""
    out, members = values.copy(), list(GROUPS[group])
    out[members] = values[MIRROR[members]]
    return out


def swapped_against(points: Vec, expected: Vec, group: Group, margin: float = 0.08) -> bool:
    """Return whether a group fits what was expected better with its sides exchanged.

    Args:
        points: Key-points seen [m], shape (25, 3), NaN where missing.
        expected: Where they were expected [m], shape (25, 3), NaN where unknown.
        group: Which of GROUPS.
        margin: How much less the mean distance must be [m].
    """
    members = list(GROUPS[group])
    given = np.linalg.norm(points[members] - expected[members], axis=1)
    crossed = np.linalg.norm(points[members] - expected[MIRROR[members]], axis=1)
    both = np.isfinite(given) & np.isfinite(crossed)
    return bool(both.any() and crossed[both].mean() + margin < given[both].mean())


def faces_backward(points: Vec, group: Group) -> bool:
    """Return whether a group's sides contradict the way the person faces; no history needed.

    Shoulders are held against the nose before the ears, hips against the toes before the
    heels; these directions stay right where left and right are mistaken.

    Args:
        points: Key-points [m], shape (25, 3), NaN where missing.
        group: ``"arms"`` or ``"legs"``; the face itself is never contradicted.
    """
    if group == "face":  # Nose and ears decide, and they say nothing about themselves.
        return False
    if group == "arms":
        across = points[K["shoulder_l"]] - points[K["shoulder_r"]]
        ahead = points[K["nose"]] - 0.5 * (points[K["ear_r"]] + points[K["ear_l"]])
    else:
        across = points[K["hip_l"]] - points[K["hip_r"]]
        ahead = sum(points[K[f"big_toe_{s}"]] - points[K[f"heel_{s}"]] for s in "rl")
    return bool(across[1] * ahead[0] - across[0] * ahead[1] < 0.0)
