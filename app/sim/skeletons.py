"""Which joint of a recorded skeleton is which, what its unit is, and which way is up.

Names of the skeletons in common use are known: the TUM clips, CMU, Mixamo, Xsens, SMPL, Daz.
The unit is found from the arm: shoulder to wrist measures 0.40 to 0.75 m in exactly one unit.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from app.errors import BadMotion, Fault
from app.sim.body_track import (
    ELBOW_R,
    NECK,
    PELVIS,
    SHOULDER_L,
    SHOULDER_R,
    TRACK_NAMES,
    WRIST_R,
    BodyTrack,
    measure,
    trunk_frame,
    unit,
)
from app.sim.bvh import Bvh, forward
from app.sim.ports import Vec
from app.sim.read_options import NOTHING_STATED, UNITS, ReadOptions, metres

MIN_ARM, MAX_ARM = 0.40, 0.75
"""Shoulder to wrist of a person [m]; the ranges of the units do not overlap."""
LENGTHS: Mapping[str, tuple[float, float]] = {
    "trunk": (0.25, 0.80),
    "clavicle": (0.05, 0.35),
    "upper_arm": (0.15, 0.50),
    "forearm": (0.15, 0.45),
}
"""Segments of people [m], with room for markers that are no joint centres."""
MAX_TILT = np.radians(30.0)
"""Lean of the trunk in a rest pose above which that pose is not taken for upright [rad]."""
MAX_DEGREES_IN_RADIANS = 6.2832
"""A file none of whose angles exceeds this is one in radians, or nobody moves in it."""

MAX_BACKWARD = 0.3
"""Mean of the elbows' backward bend, from -1 to 1, above which sides are mixed up."""

_CENTRE = {
    "pelvis": ("hips", "hip", "pelvis", "root"),
    "neck": ("neck", "neck1", "neckbase", "c7"),
}
_PARTS = {
    "shoulder": ("upperarm", "uparm", "arm", "shldr", "shoulder", "humerus"),
    "elbow": ("forearm", "lowerarm", "lowarm", "elbow", "radius"),
    "wrist": ("hand", "wrist"),
    "hip": ("upleg", "upperleg", "thigh", "hip", "femur"),
}


def skeleton_joints(names: Sequence[str]) -> dict[str, int]:
    """Return the index of each joint of TRACK_NAMES, and of ``hip_r``, ``hip_l`` if there.

    Args:
        names: The skeleton's own, such as ``mixamorig:LeftForeArm`` or ``left_forearm``.

    Raises:
        BadMotion: Joints are missing; the hint lists what the file has.
    """
    plain = {_plain(name): k for k, name in reversed(list(enumerate(names)))}
    found: dict[str, int] = {}
    for role, spellings in _spellings().items():
        match = next((plain[one] for one in spellings if one in plain), None)
        if match is not None:
            found[role] = match
    missing = [role for role in TRACK_NAMES if role not in found]
    if missing:
        listed = ", ".join(names[:40])[:300]
        hint = f"the file's joints are {listed}; known names: docs/motions.md"
        rule = f"has no joint that is known as {', '.join(missing)}"
        raise BadMotion([Fault(place="HIERARCHY", value="", rule=rule, hint=hint)])
    return found


def body_track(bvh: Bvh, options: ReadOptions = NOTHING_STATED) -> tuple[BodyTrack, str]:
    """Return a file's joint centres [m], z up, and the name of its unit.

    Raises:
        BadMotion: It is no upright person in a known unit and in degrees.
    """
    roles = skeleton_joints([joint.name for joint in bvh.joints])
    _require_degrees(bvh)
    chosen = [roles[name] for name in TRACK_NAMES]
    found = options.unit or length_unit(forward(bvh, chosen))
    if options.root_unit is not None:
        bvh = _with_root_scaled(bvh, metres(options.root_unit) / metres(found))
    points = forward(bvh, chosen)
    up = options.up or "xyz"[_up_axis(points)]
    points = metres(found) * _z_up(points, up)
    _require_a_body(points)
    _require_elbows(points)
    rest = _z_up(_rest(bvh)[None, chosen], up)
    hips = None
    if "hip_r" in roles and "hip_l" in roles:
        right, left = forward(bvh, [roles["hip_r"], roles["hip_l"]]).transpose(1, 0, 2)
        hips = metres(found) * _z_up(left - right, up)
    times: Vec = np.asarray(bvh.dt * np.arange(len(points)))
    return BodyTrack(times=times, points=points, upright=_upright(rest), hips=hips), found


def length_unit(points: Vec) -> str:
    """Return the unit in which the arm has the length of a person's.

    Args:
        points: Joint centres [unknown unit], shape (n, 8, 3).

    Raises:
        BadMotion: No unit fits.
    """
    chain = points[:, SHOULDER_R : WRIST_R + 1]
    arm = float(np.median(np.linalg.norm(np.diff(chain, axis=1), axis=2).sum(axis=1)))
    for name, factor in UNITS.items():
        if MIN_ARM <= factor * arm <= MAX_ARM:
            return name
    rule = f"must be {MIN_ARM} to {MAX_ARM} m in one of the units {', '.join(UNITS)}"
    place = "OFFSET of elbow and wrist: shoulder to wrist"
    raise BadMotion([Fault(place=place, value=f"{arm:.4g}", rule=rule)])


def _with_root_scaled(bvh: Bvh, factor: float) -> Bvh:
    """Return a file with the root's path multiplied."""
    moving = [joint == 0 and name.endswith("position") for joint, name in bvh.channels]
    return replace(bvh, values=np.where(moving, factor * bvh.values, bvh.values))


def _spellings() -> dict[str, list[str]]:
    spelt = {role: list(names) for role, names in _CENTRE.items()}
    for part, names in _PARTS.items():
        for letter, word in (("r", "right"), ("l", "left")):
            spelt[f"{part}_{letter}"] = [
                form.format(side=side, name=name)
                for name in names
                for side in (word, letter)
                for form in ("{side}{name}", "{name}{side}")
            ]
    return spelt


def _plain(name: str) -> str:
    """Return a name without its prefix, case and punctuation."""
    return re.sub(r"[^a-z0-9]", "", re.split(r"[:|]", name)[-1].lower())


def _require_degrees(bvh: Bvh) -> None:
    turns = [k for k, (_, name) in enumerate(bvh.channels) if name.endswith("rotation")]
    largest = float(np.abs(bvh.values[:, turns]).max()) if turns else 0.0
    if largest > MAX_DEGREES_IN_RADIANS:
        return
    rule = (
        f"is the largest angle; a person's motion in degrees exceeds {MAX_DEGREES_IN_RADIANS}"
    )
    hint = "looks like radians: write degrees"
    place = f"frames from line {bvh.first_line}"
    raise BadMotion([Fault(place=place, value=f"{largest:.4g}", rule=rule, hint=hint)])


def _up_axis(points: Vec) -> int:
    """Return the axis along which the neck stands above the pelvis: 1 or 2."""
    trunk = np.median(points[:, NECK] - points[:, PELVIS], axis=0)
    axis = int(np.argmax(trunk))
    length = float(np.linalg.norm(trunk))
    if axis == 0 or length <= 0.0 or trunk[axis] < 0.7 * length:
        rule = "must point up, along y or z, in most frames"
        value = "(" + ", ".join(f"{one:.4g}" for one in trunk) + ")"
        raise BadMotion([Fault(place="pelvis to neck", value=value, rule=rule)])
    return axis


def _z_up(v: Vec, up: str) -> Vec:
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


def _rest(bvh: Bvh) -> Vec:
    """Return the joints of the rest pose, all angles zero, shape (n_joints, 3)."""
    rest = np.array([joint.offset for joint in bvh.joints])
    for k, joint in enumerate(bvh.joints):
        if joint.parent >= 0:
            rest[k] += rest[joint.parent]
    return rest


def _upright(rest: Vec) -> Vec:
    """Return the trunk's frame in the rest pose, its heading taken out, shape (3, 3)."""
    across = rest[:, SHOULDER_L] - rest[:, SHOULDER_R]
    frame = trunk_frame(rest[:, PELVIS], rest[:, NECK], across)[0]
    level = float(np.linalg.norm(across[0, :2]))
    if level <= 0.5 * float(np.linalg.norm(across)) or frame[2, 2] < np.cos(MAX_TILT):
        return np.eye(3)
    x, y = across[0, 1] / level, -across[0, 0] / level
    heading = np.array([[x, y, 0.0], [-y, x, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(heading @ frame)


def _require_a_body(points: Vec) -> None:
    """Refuse a person whose parts are no person's, who is far away, or who never moves."""
    for name, length in measure(points).lengths().items():
        # Lengths that no joint centre tells are the median person's.
        low, high = LENGTHS.get(name.removesuffix("_r").removesuffix("_l"), (0.0, np.inf))
        if not low <= length <= high:
            rule = f"must be {low} to {high} m long, by the unit that the right arm has"
            raise BadMotion([Fault(place=name, value=f"{length:.3f} m", rule=rule)])
    far = float(np.abs(points[:, PELVIS]).max())
    if far > 100.0:
        rule = "must lie within 100 m of the file's origin, in the unit of the skeleton"
        hint = "positions and offsets are probably in two units"
        value = f"{far:.4g} m"
        raise BadMotion([Fault(place="pelvis", value=value, rule=rule, hint=hint)])
    if not np.isfinite(points).all() or np.ptp(points[:, ELBOW_R], axis=0).max() <= 0.0:
        raise BadMotion([Fault(place="frames", value="", rule="show nobody who moves")])


def _require_elbows(points: Vec) -> None:
    """Refuse a person whose elbows bend backward: seen in a mirror, or sides mixed up.

    The elbow's axis points to the right of a person whose arms hang or are raised to the front;
    with arms to the sides it is square to the line across the shoulders.
    """
    across = unit(points[:, SHOULDER_L] - points[:, SHOULDER_R])
    backward = 0.0
    for shoulder in (SHOULDER_R, SHOULDER_L):
        segments = unit(np.diff(points[:, shoulder : shoulder + 3], axis=1))
        normal = np.cross(segments[:, 0], segments[:, 1])
        backward += 0.5 * float(np.einsum("ni,ni->n", normal, across).mean())
    if backward > MAX_BACKWARD:
        rule = f"must be at most {MAX_BACKWARD} of what elbows can bend"
        hint = "left and right are mixed up, or the file shows a mirror image"
        place = "elbows, bent backward"
        raise BadMotion([Fault(place=place, value=f"{backward:.2f}", rule=rule, hint=hint)])
