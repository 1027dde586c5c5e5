"""Conversion of a recorded skeleton to joint centres in metres, z up.

Joints are identified by name (``joint_names.py``), the unit by stature (``length_units.py``),
and the up axis by rest pose, legs and trunk (``up_axis.py``). Stated properties take
precedence. The interpretation is returned as a :class:`~app.sim.mocap.read_options.Reading`.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from app.sim.core.arrays import Vec
from app.sim.mocap.bvh import Bvh, forward, with_ancestors
from app.sim.mocap.faults import bad
from app.sim.mocap.joint_centres import (
    ELBOW_R,
    NECK,
    PELVIS,
    SHOULDER_L,
    SHOULDER_R,
    TRACK_NAMES,
    BodyTrack,
    trunk_frame,
    unit,
)
from app.sim.mocap.joint_names import Joints, find_joints
from app.sim.mocap.length_units import (
    Stature,
    find_lengths,
    find_stature,
    find_unit,
    require_one_unit,
    require_proportions,
)
from app.sim.mocap.read_options import NOTHING_STATED, Reading, ReadOptions, metres
from app.sim.mocap.repeated_frames import without_repeats
from app.sim.mocap.tables import MAX_NAME
from app.sim.mocap.up_axis import (
    BodyDirections,
    find_up_axis,
    require_not_head_down,
    rest_axis,
    z_up,
)

MAX_TILT = np.radians(30.0)
"""Largest lean of the trunk in an upright rest pose [rad]."""
MAX_DEGREES_IN_RADIANS = 6.2832
"""Largest angle of a file in radians, or of one without motion."""
MAX_FAR = 100.0
"""Largest distance of the pelvis from the file's origin [m]."""
MIN_HIPS = 0.02
"""Distance of the hips below which they have no direction [m]."""
MAX_BACKWARD = 0.3
"""Mean backward bend of the elbows, from -1 to 1, above which sides are swapped."""

Centres = Mapping[str, Vec]
"""Joint centres by role, each of shape (n, 3)."""


def body_track(bvh: Bvh, options: ReadOptions = NOTHING_STATED) -> tuple[BodyTrack, Reading]:
    """Return a file's joint centres [m], z up, and its interpretation.

    Raises:
        BadRecording: The file does not show an upright person in a known unit and in degrees,
            or it has two interpretations; the fault names both.
    """
    bvh, repeated = without_repeats(bvh)
    names = [joint.name for joint in bvh.joints]
    joints = find_joints(names, [joint.parent for joint in bvh.joints], options.names)
    _require_degrees(bvh, joints)
    centres, rest = _centres(bvh, joints), _centres(_resting(bvh), joints)
    stature, found = _measured(centres, options)
    standing, moving = _directions(rest), _directions(centres)
    up = options.up or find_up_axis(moving, standing)
    require_not_head_down(moving, up)
    floor, root_unit = "", options.root_unit or found
    if options.root_unit is None:
        floor = _check_root(centres, up, bvh.dt, stature, found)
    elif root_unit != found:
        scaled = _with_root_scaled(bvh, joints, metres(root_unit) / metres(found))
        centres = _centres(scaled, joints)
    placed = {role: metres(found) * z_up(v, up) for role, v in centres.items()}
    points = _stacked(placed)
    _require_a_body(points)
    _require_elbows(points)
    track = BodyTrack(
        times=np.asarray(bvh.dt * np.arange(len(points))),
        points=points,
        upright=_upright(rest, rest_axis(standing)),
        hips=_hips(placed),
    )
    reading = Reading(
        unit=found,
        root_unit=root_unit,
        up=up,
        names={role: " + ".join(names[k][:MAX_NAME] for k in joints[role]) for role in joints},
        rate_hz=1.0 / bvh.dt,
        stature=metres(found) * stature.value,
        notes=tuple(one for one in (repeated, floor) if one),
    )
    return track, reading


def _measured(centres: Centres, options: ReadOptions) -> tuple[Stature, str]:
    """Return the stature [the file's unit] and the unit; check proportions."""
    lengths = find_lengths(centres)
    stature = find_stature(lengths)
    found = options.unit or find_unit(stature)
    require_proportions(lengths, stature, found)
    return stature, found


def _check_root(centres: Centres, up: str, dt: float, stature: Stature, found: str) -> str:
    """Check the root's unit; return a note if the file's zero is not the floor."""
    pelvis, ankles = z_up(centres["pelvis"], up), None
    if {"ankle_r", "ankle_l"} <= centres.keys():
        both = np.stack([centres["ankle_r"], centres["ankle_l"]], axis=1)
        ankles = z_up(both, up) - pelvis[:, None]
    return require_one_unit(pelvis, ankles, dt, stature, found)


def _centres(bvh: Bvh, joints: Joints) -> dict[str, Vec]:
    """Return the joint centres of a file by role [the file's unit], each of shape (n, 3)."""
    wanted = sorted({k for found in joints.values() for k in found})
    points = dict(zip(wanted, forward(bvh, wanted).transpose(1, 0, 2), strict=True))
    return {
        role: np.asarray(np.mean([points[k] for k in found], axis=0))
        for role, found in joints.items()
    }


def _stacked(centres: Centres) -> Vec:
    """Return joint centres in the order of TRACK_NAMES, shape (n, 8, 3)."""
    return np.stack([centres[role] for role in TRACK_NAMES], axis=1)


def _resting(bvh: Bvh) -> Bvh:
    """Return a file of one frame, the rest pose: all joints at their offsets."""
    row = [
        bvh.joints[k].offset["XYZ".index(name[0])] if name.endswith("position") else 0.0
        for k, name in bvh.channels
    ]
    return replace(bvh, values=np.array([row]))


def _with_root_scaled(bvh: Bvh, joints: Joints, factor: float) -> Bvh:
    """Return a file with the path of the pelvis scaled."""
    path = with_ancestors(bvh, joints["pelvis"])
    moving = [joint in path and name.endswith("position") for joint, name in bvh.channels]
    return replace(bvh, values=np.where(moving, factor * bvh.values, bvh.values))


def _directions(centres: Centres) -> BodyDirections:
    """Return the directions of body segments."""

    def both(a: str, b: str) -> Vec | None:
        directions = [
            unit(centres[b + side] - centres[a + side])
            for side in ("_r", "_l")
            if a + side in centres and b + side in centres
        ]
        return np.concatenate(directions) if directions else None

    return BodyDirections(
        trunk=unit(centres["neck"] - centres["pelvis"]),
        across=unit(centres["shoulder_l"] - centres["shoulder_r"]),
        legs=both("knee", "ankle") if "knee_r" in centres else both("hip", "ankle"),
        toes=both("ankle", "toe"),
    )


def _hips(placed: Centres) -> Vec | None:
    """Return the vectors from the right to the left hip [m], shape (n, 3); None if unknown.

    Raises:
        BadRecording: Legs and arms have opposite sides.
    """
    if not {"hip_r", "hip_l"} <= placed.keys():
        return None
    hips = placed["hip_l"] - placed["hip_r"]
    if float(np.median(np.linalg.norm(hips, axis=1))) < MIN_HIPS:
        return None
    shoulders = placed["shoulder_l"] - placed["shoulder_r"]
    along = float(np.median(np.einsum("ni,ni->n", unit(hips), unit(shoulders))))
    if along < 0.0:
        value = f"{np.degrees(np.arccos(max(along, -1.0))):.0f} degrees apart"
        rule = "must point to the same side, right to left, in most frames"
        hint = "left and right of the legs, or of the arms, are mixed up"
        raise bad("hips and shoulders", value, rule, hint)
    return hips


def _require_degrees(bvh: Bvh, joints: Joints) -> None:
    """Check that angles are in degrees; those of the root may exceed a full turn in radians."""
    root = with_ancestors(bvh, joints["pelvis"])
    turns = [
        k
        for k, (joint, name) in enumerate(bvh.channels)
        if name.endswith("rotation") and joint not in root
    ]
    if not turns:
        return  # positions alone
    largest = float(np.abs(bvh.values[:, turns]).max())
    if largest > MAX_DEGREES_IN_RADIANS:
        return
    rule = (
        f"is the largest angle; a person's motion in degrees exceeds {MAX_DEGREES_IN_RADIANS}"
    )
    hint = "looks like radians: write degrees"
    place = f"frames from line {bvh.first_line}"
    raise bad(place, f"{largest:.4g}", rule, hint)


def _upright(rest: Centres, axis: str | None) -> Vec:
    """Return the trunk's frame in the rest pose, without its heading, shape (3, 3).

    Args:
        rest: Joint centres of the rest pose.
        axis: Up direction of the rest pose; None if unknown.
    """
    if axis is None:
        return np.eye(3)
    points = z_up(_stacked(rest), axis)
    across = points[:, SHOULDER_L] - points[:, SHOULDER_R]
    frame = trunk_frame(points[:, PELVIS], points[:, NECK], across)[0]
    level = float(np.linalg.norm(across[0, :2]))
    if level <= 0.5 * float(np.linalg.norm(across)) or frame[2, 2] < np.cos(MAX_TILT):
        return np.eye(3)
    x, y = across[0, 1] / level, -across[0, 0] / level
    heading = np.array([[x, y, 0.0], [-y, x, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(heading @ frame)


def _require_a_body(points: Vec) -> None:
    """Check that the person is near the origin and moves."""
    far = float(np.abs(points[:, PELVIS]).max())
    if far > MAX_FAR:
        rule = f"must lie within {MAX_FAR:g} m of the file's origin"
        hint = "positions and offsets are probably in two units"
        value = f"{far:.4g} m"
        raise bad("pelvis", value, rule, hint)
    if not np.isfinite(points).all() or np.ptp(points[:, ELBOW_R], axis=0).max() <= 0.0:
        raise bad("frames", "", "must show a moving person")


def _require_elbows(points: Vec) -> None:
    """Check that elbows do not bend backward, as in mirror images or with swapped sides.

    The elbow's axis points to the person's right with arms down or to the front, and is
    perpendicular to the shoulder line with arms to the sides.
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
        raise bad("elbows, bent backward", f"{backward:.2f}", rule, hint)
