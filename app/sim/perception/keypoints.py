"""Key-points in the layout BODY_25: names, sides, and those of the 18-DoF person.

A frame is 25 points [m] in the cell's frame, NaN where a point is missing, as OpenPose with a
depth image gives them (docs/method.md 2.8).

:func:`keypoints_of` gives the key-points of the 18-DoF person. Shoulders, elbows, wrists, neck
and mid-hip are joints of the model. Other points are placed by proportion: the face rigid on
the torso, the hips to either side of the pelvis, and under each hip a straight upright leg with
the knee half-way and the foot in the direction of the pelvis.

Source: Cao et al., OpenPose (2019), output format BODY_25; docs/method.md 2.8.
"""

from typing import Literal

import numpy as np

from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.human.kernels import kinematics as body

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
_PARTS: dict[Group, tuple[str, ...]] = {
    "arms": ("shoulder", "elbow", "wrist"),
    "legs": ("hip", "knee", "ankle", "big_toe", "small_toe", "heel"),
    "face": ("eye", "ear"),
}
GROUPS: dict[Group, list[int]] = {
    group: [K[f"{part}_{s}"] for part in parts for s in "rl"] for group, parts in _PARTS.items()
}
"""Pairs of key-points whose sides a tracker confuses together."""
_OTHER_SIDE = {"r": "l", "l": "r"}
MIRROR = np.array([K.get(n[:-1] + _OTHER_SIDE.get(n[-1], ""), k) for n, k in K.items()])
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
    out, members = values.copy(), GROUPS[group]
    out[members] = values[MIRROR[members]]
    return out


def swapped_against(points: Vec, expected: Vec, group: Group, margin: float = 0.08) -> bool:
    """Return whether a group fits the prediction better with exchanged sides.

    Args:
        points: Key-points seen [m], shape (25, 3), NaN where missing.
        expected: Predicted key-points [m], shape (25, 3), NaN where unknown.
        group: One of GROUPS.
        margin: Least reduction of the mean distance [m].
    """
    members = GROUPS[group]
    given = np.linalg.norm(points[members] - expected[members], axis=1)
    crossed = np.linalg.norm(points[members] - expected[MIRROR[members]], axis=1)
    both = np.isfinite(given) & np.isfinite(crossed)
    return bool(both.any() and crossed[both].mean() + margin < given[both].mean())


def faces_backward(points: Vec, group: Group) -> bool:
    """Return whether a group's sides contradict the facing direction, from one frame.

    Shoulders are compared with the nose before the ears, hips with the toes before the
    heels; these directions stay right where left and right are mistaken. The nose of a person
    who leans forward and looks down is behind the ears: the direction from neck to ears is
    added. The toes of a kneeling person are behind the heels: feet count under upright shanks
    only.

    Args:
        points: Key-points [m], shape (25, 3), NaN where missing.
        group: ``"arms"`` or ``"legs"``; the face itself is never contradicted.
    """
    if group == "face":  # Nose and ears determine the sides of the face.
        return False
    if group == "arms":
        across = points[K["shoulder_l"]] - points[K["shoulder_r"]]
        ears = 0.5 * (points[K["ear_r"]] + points[K["ear_l"]])
        ahead = _unit(points[K["nose"]] - ears)
        if ahead[2] < 0.0:
            ahead += np.nan_to_num(_unit(ears - points[K["neck"]]))
    else:
        across = points[K["hip_l"]] - points[K["hip_r"]]
        ahead = sum(points[K[f"big_toe_{s}"]] - points[K[f"heel_{s}"]] for s in "rl")
        if any(_is_level(points[K[f"ankle_{s}"]] - points[K[f"knee_{s}"]]) for s in "rl"):
            return False
    return bool(across[1] * ahead[0] - across[0] * ahead[1] < 0.0)


def _unit(vector: Vec) -> Vec:
    """Return a vector of length 1; the same where the length is 0."""
    length = float(np.linalg.norm(vector))
    return vector if length == 0.0 else vector / length


def _is_level(direction: Vec) -> bool:
    """Return whether a direction is within 45 degrees of the horizontal; not if unknown."""
    return bool(np.hypot(direction[0], direction[1]) > abs(direction[2]))
