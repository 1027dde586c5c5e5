"""Motion files of a person whose 18 joint angles are known: BVH, OpenSim and CSV texts."""

from collections.abc import Callable, Mapping

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.errors import BadRecording
from app.sim.core.arrays import Vec
from app.sim.human.anthropometry import MEDIAN
from app.sim.human.model import JOINT_NAMES, rest_posture

TUM = {
    "hips": "hip",
    "spine": "torso",
    "neck": "neck",
    "collar": "{side}_collar",
    "shoulder": "{side}_upper_arm",
    "elbow": "{side}_forearm",
    "wrist": "{side}_hand",
}
CMU = {
    "hips": "Hips",
    "spine": "LowerBack",
    "neck": "Neck",
    "collar": "{Side}Shoulder",
    "shoulder": "{Side}Arm",
    "elbow": "{Side}ForeArm",
    "wrist": "{Side}Hand",
    "thigh": "{Side}UpLeg",
    "foot": "{Side}Foot",
}
MIXAMO = {role: f"mixamorig:{name}" for role, name in CMU.items()}
SMPL = {
    "hips": "pelvis",
    "spine": "spine1",
    "neck": "neck",
    "collar": "{side}_collar",
    "shoulder": "{side}_shoulder",
    "elbow": "{side}_elbow",
    "wrist": "{side}_wrist",
    "thigh": "{side}_hip",
    "foot": "{side}_ankle",
}
XSENS = {
    "hips": "Hips",
    "spine": "Chest",
    "neck": "Neck",
    "collar": "{Side}Collar",
    "shoulder": "{Side}Shoulder",
    "elbow": "{Side}Elbow",
    "wrist": "{Side}Wrist",
    "thigh": "{Side}Hip",
    "foot": "{Side}Ankle",
}
DAZ = {
    "hips": "hip",
    "spine": "abdomen",
    "neck": "neck",
    "collar": "{letter}Collar",
    "shoulder": "{letter}Shldr",
    "elbow": "{letter}ForeArm",
    "wrist": "{letter}Hand",
    "thigh": "{letter}Thigh",
    "foot": "{letter}Foot",
}
SKELETONS = {"tum": TUM, "cmu": CMU, "mixamo": MIXAMO, "smpl": SMPL, "xsens": XSENS, "daz": DAZ}

TO_FILE = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""From z up to y up."""


def fault_of(read: Callable[..., object], *args: object) -> str:
    """Return the first fault of what a reader refuses."""
    with pytest.raises(BadRecording) as caught:
        read(*args)
    return caught.value.faults[0].text


def working(n: int = 200, dt: float = 0.02, seed: int = 0) -> Vec:
    """A person who works slowly, joints inside their limits and elbows bent: (n, 18)."""
    rng = np.random.default_rng(seed)
    t = dt * np.arange(n)
    q = np.tile(rest_posture(0.3, 1.2, -1.4), (n, 1))
    reach = np.array([0.1, 0.1, 0.3, *[0.2] * 3, *[0.1] * 4, *[0.4, 0.3, 0.5, 0.4] * 2])
    waves = np.sin(1.5 * t[:, None] + rng.uniform(0.0, 6.0, 18))
    q += reach * waves
    q[:, [11, 15]] += 0.4
    q[:, [13, 17]] += 0.5
    return q


def bvh_text(
    q: Vec,
    pelvis_z: Vec | float = 0.95,
    names: Mapping[str, str] = TUM,
    unit: float = 0.001,
    dt: float = 0.02,
) -> str:
    """The BVH file of a person of the simulator's size, arms hanging in its rest pose."""
    turns, height = _turns(q), np.broadcast_to(pelvis_z, len(q))
    place = np.column_stack([q[:, :2], height]) @ TO_FILE.T / unit
    lines, columns = ["HIERARCHY"], [place]

    def joint(role: str, side: str, offset: tuple[float, float, float], depth: int) -> None:
        name = names[role].format(side=side, Side=side.capitalize(), letter=side[:1])
        word, pad = ("ROOT" if role == "hips" else "JOINT"), "  " * depth
        x, y, z = (float(one) for one in TO_FILE @ np.array(offset) / unit)
        position = "Xposition Yposition Zposition " if role == "hips" else ""
        lines.extend(
            [
                f"{pad}{word} {name}",
                f"{pad}{{",
                f"{pad}  OFFSET {x!r} {y!r} {z!r}",
                f"{pad}  CHANNELS {6 if position else 3} {position}"
                "Zrotation Xrotation Yrotation",
            ]
        )
        turn = turns.get(role + side[:1], np.tile(np.eye(3), (len(q), 1, 1)))
        in_file = Rotation.from_matrix(TO_FILE @ turn @ TO_FILE.T)
        columns.append(in_file.as_euler("ZXY", degrees=True))

    def close(depth: int) -> None:
        lines.append("  " * depth + "}")

    joint("hips", "", (0.0, 0.0, 0.0), 0)
    joint("spine", "", (0.0, 0.0, 0.0), 1)
    joint("neck", "", (0.0, 0.0, MEDIAN.trunk), 2)
    close(2)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        joint("collar", side, (0.0, 0.0, MEDIAN.trunk), 2)
        joint("shoulder", side, (0.0, sign * MEDIAN.clavicle_r, 0.0), 3)
        joint("elbow", side, (0.0, 0.0, -MEDIAN.upper_arm_r), 4)
        joint("wrist", side, (0.0, 0.0, -MEDIAN.forearm_r), 5)
        lines.extend(["      End Site", "      {", "        OFFSET 0 0 0", "      }"])
        for depth in (5, 4, 3, 2):
            close(depth)
    close(1)
    if "thigh" in names:
        for side, sign in (("left", 1.0), ("right", -1.0)):
            joint("thigh", side, (0.0, sign * 0.09, -0.05), 1)
            joint("foot", side, (0.0, 0.0, -0.8), 2)
            close(2)
            close(1)
    close(0)
    rows = (" ".join(f"{value:.6f}" for value in row) for row in np.hstack(columns))
    head = ["MOTION", f"Frames: {len(q)}", f"Frame Time: {dt}"]
    return "\n".join([*lines, *head, *rows]) + "\n"


def csv_text(q: Vec, dt: float = 0.02, degrees: bool = True) -> str:
    """The table of joint angles in our own columns."""
    values = q.copy()
    values[:, 2:] = np.degrees(q[:, 2:]) if degrees else q[:, 2:]
    rows = (
        ",".join(f"{value:.9f}" for value in (dt * k, *row)) for k, row in enumerate(values)
    )
    said = f"# angles = {'degrees' if degrees else 'radians'}"
    return "\n".join([said, "time," + ",".join(JOINT_NAMES), *rows]) + "\n"


def opensim_text(angles: Mapping[str, Vec], dt: float = 0.02, degrees: bool = True) -> str:
    """A ``.mot`` file of coordinates in radians and metres."""
    n = len(next(iter(angles.values())))
    columns = [dt * np.arange(n)]
    for name, values in angles.items():
        metres = name in ("pelvis_tx", "pelvis_ty", "pelvis_tz")
        columns.append(np.degrees(values) if degrees and not metres else values)
    head = [
        "Coordinates",
        "version=1",
        f"nRows={n}",
        f"nColumns={len(columns)}",
        f"inDegrees={'yes' if degrees else 'no'}",
        "",
        "endheader",
        "\t".join(["time", *angles]),
    ]
    rows = ("\t".join(f"{value:.9f}" for value in row) for row in np.column_stack(columns))
    return "\n".join([*head, *rows]) + "\n"


def _turns(q: Vec) -> dict[str, Vec]:
    """Rotation of each joint in its parent, by role and first letter of the side."""

    def about(axis: str, angle: Vec) -> Vec:
        turn: Vec = Rotation.from_euler(axis, angle[:, None]).as_matrix()
        return turn

    turns = {
        "hips": about("z", q[:, 2]),
        "spine": about("y", q[:, 3]) @ about("x", q[:, 4]) @ about("z", q[:, 5]),
    }
    for side, sign, clavicle, arm in (("r", -1.0, 6, 10), ("l", 1.0, 8, 14)):
        collar = about("z", -sign * q[:, clavicle]) @ about("x", sign * q[:, clavicle + 1])
        upper = about("y", -q[:, arm]) @ about("x", sign * q[:, arm + 1])
        upper = upper @ about("z", q[:, arm + 2])
        turns[f"collar{side}"] = collar
        turns[f"shoulder{side}"] = collar.transpose(0, 2, 1) @ upper
        turns[f"elbow{side}"] = about("y", -q[:, arm + 3])
    return turns
