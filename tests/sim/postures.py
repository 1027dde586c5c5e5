"""Key-points of people in many postures, by bone lengths and directions."""

import numpy as np

from app.sim.perception.keypoints import N_KEYPOINTS, K

X, Y, Z = np.eye(3)
STANDING = {"thigh": -Z, "shank": -Z, "arm": -Z, "forearm": -Z, "trunk": Z, "hips": 0.92}
POSTURES: dict[str, dict[str, object]] = {
    "standing": {},
    "arms up": {"arm": Z, "forearm": Z},
    "reaching forward": {"arm": Y, "forearm": Y, "trunk": Y + 2 * Z},
    "arms wide": {"arm": "out", "forearm": "out"},
    "bent by 90 degrees": {"trunk": Y},
    "hands on the floor": {"trunk": 2 * Y - Z, "hips": 0.88},
    "kneeling": {"shank": -Y, "hips": 0.5},
    "kneeling on one knee": {"thigh": Y - Z, "shank": -Z - 0.3 * Y, "hips": 0.72},
    "squatting": {"thigh": 2 * Y + Z, "shank": -2 * Z - Y, "hips": 0.35, "trunk": Y + 2 * Z},
    "sitting on a chair": {"thigh": Y, "hips": 0.5},
    "sitting on the table": {"thigh": Y, "hips": 0.85},
    "sitting on the floor": {"thigh": Y, "shank": Y, "hips": 0.12},
    "on all fours": {"trunk": Y, "shank": -Y, "hips": 0.5},
    "lying on the back": {"trunk": -Y, "thigh": Y, "shank": Y, "arm": Y, "hips": 0.12},
    "lying on the front": {"trunk": Y, "thigh": -Y, "shank": -Y, "arm": -Y, "hips": 0.12},
    "lying on the table": {"trunk": -Y, "thigh": Y, "shank": Y, "arm": Y, "hips": 0.88},
    "on a step": {"hips": 0.92 + 0.4},
    "on a step, arms up": {"hips": 0.92 + 0.4, "arm": Z, "forearm": Z},
    "leaning over the table": {"trunk": 2 * Y + Z, "arm": Y, "forearm": Y - 0.2 * Z},
}


def posture(name: str, floor_z: float, scale: float = 1.0) -> np.ndarray:
    """Return key-points [m], shape (25, 3), of a person at (0.2, 1.4) who faces the robot."""
    pose = STANDING | POSTURES[name]
    points = np.full((N_KEYPOINTS, 3), np.nan)

    def put(joint: str, start: np.ndarray, axis: object, length: float) -> np.ndarray:
        direction = np.asarray(axis, dtype=np.float64)
        points[K[joint]] = start + length * direction / np.linalg.norm(direction)
        return points[K[joint]]

    hips = float(str(pose["hips"])) * Z
    points[K["mid_hip"]] = hips
    neck = put("neck", hips, pose["trunk"], 0.48)
    nose = put("nose", neck, np.asarray(pose["trunk"]) + 0.3 * Y, 0.22)
    for s, side in (("r", X), ("l", -X)):
        put(f"eye_{s}", nose, 0.03 * side + 0.03 * Z - 0.02 * Y, 0.05)
        put(f"ear_{s}", nose, 0.07 * side - 0.1 * Y, 0.14)
        elbow_axis, wrist_axis = (
            side if isinstance(pose[part], str) else pose[part] for part in ("arm", "forearm")
        )
        shoulder = put(f"shoulder_{s}", neck, side, 0.18)
        put(f"wrist_{s}", put(f"elbow_{s}", shoulder, elbow_axis, 0.29), wrist_axis, 0.26)
        hip = put(f"hip_{s}", hips, side, 0.09)
        ankle = put(
            f"ankle_{s}", put(f"knee_{s}", hip, pose["thigh"], 0.42), pose["shank"], 0.42
        )
        put(f"heel_{s}", ankle, -Y - Z, 0.08)
        put(f"big_toe_{s}", ankle, Y - 0.5 * Z - 0.2 * side, 0.18)
        put(f"small_toe_{s}", ankle, Y - 0.5 * Z + 0.2 * side, 0.16)
    facing_the_robot = np.diag([-1.0, -1.0, 1.0])
    return scale * points @ facing_the_robot + [0.2, 1.4, floor_z]


def looking_down(name: str, floor_z: float, pitch: float) -> np.ndarray:
    """Return key-points as :func:`posture`, with the face turned down from level [rad]."""
    points = posture(name, floor_z)
    ears = 0.5 * (points[K["ear_r"]] + points[K["ear_l"]])
    ahead = np.array([0.0, -np.cos(pitch), -np.sin(pitch)])
    points[K["nose"]] = ears + 0.12 * ahead
    for s in "rl":
        points[K[f"eye_{s}"]] = points[K[f"ear_{s}"]] + 0.1 * ahead
    return points


def kneeling_and_looking_down(floor_z: float) -> np.ndarray:
    """Return key-points of a kneeling person, hands on the floor, toes behind the heels."""
    points = looking_down("on all fours", floor_z, pitch=1.8)
    for s in "rl":
        for part in ("big_toe", "small_toe"):
            points[K[f"{part}_{s}"]] = points[K[f"heel_{s}"]] + [0.0, 0.15, -0.04]
    return points


FRAMES: dict[str, np.ndarray] = {
    "a camera's, y down and z ahead": np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "a camera's that looks down": np.diag([1, -1, -1]),
    "y up": np.array([[1, 0, 0], [0, 0, 1], [0, 1, 0]]),
    "y up, right-handed": np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]),
    "z down": np.diag([1, 1, -1]),
}
"""Rotations (some with a reflection) from the cell's frame to others."""
